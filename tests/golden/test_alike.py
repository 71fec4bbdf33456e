"""The comparison finds what a user would see, and nothing that only a machine sees."""

from __future__ import annotations

from functools import cache
from io import BytesIO

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image, ImageDraw

from tests.golden import record
from tests.golden.alike import difference, lines_alike, picture_difference, text_difference
from tests.golden.desk import flat, keep_picture, mesh_lines, steady, tidy, untimed
from tests.golden.drawings import facts


def kept(folder, name):
    """Return a picture that was recorded."""
    with Image.open(record.KEPT / folder / f"{name}.png") as image:
        return image.convert("RGB")


def painted(image, box, color):
    """Return a picture with a rectangle over a part of it."""
    changed = image.copy()
    ImageDraw.Draw(changed).rectangle(box, fill=color)
    return changed


@cache
def plot(labels="0.0 0.2 0.4 0.6 0.8 1.0", **rules):
    """Return a small plot with letters, lines and cells."""
    with rc_context(rules):
        figure = Figure((4.0, 2.5), dpi=100)
        axes = figure.subplots()
        axes.pcolormesh(np.arange(64).reshape(8, 8), edgecolor="gray", linewidth=0.3)
        axes.plot([0, 3, 8], [1, 7, 2])
        axes.set_yticks(np.linspace(0, 8, len(labels.split())), labels.split())
        axes.set_title("quality of each cell")
        data = BytesIO()
        figure.savefig(data)
    return Image.open(data).convert("RGB")


def test_letters_that_are_smoothed_in_another_way_are_the_same():
    other = plot(**{"text.hinting": "none"})
    assert np.asarray(plot()).tolist() != np.asarray(other).tolist()
    assert picture_difference(plot(), other) == ""


def test_noise_and_colors_of_a_palette_are_the_same(tmp_path):
    shown = np.asarray(plot()).astype(int)
    noise = np.random.default_rng(3).integers(-12, 13, shown.shape)
    assert (
        picture_difference(plot(), Image.fromarray((shown + noise).clip(0, 255).astype("u1"))) == ""
    )
    keep_picture(plot(), tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as small:
        assert picture_difference(plot(), small) == ""


def test_another_number_at_an_axis_is_found():
    assert "pixels differ" in picture_difference(plot(), plot("0.0 0.2 0.4 0.6 0.9 1.0"))
    assert "pixels differ" in picture_difference(plot(), plot("0.0 0.2 0.4 0.6 0.8 1."))


@pytest.mark.parametrize(
    ("folder", "name", "box", "what"),
    [
        ("pictures", "passage", (413, 62, 428, 249), "the color bar"),
        ("pictures", "passage", (431, 134, 451, 144), "a number beside it"),
        ("pictures", "passage", (10, 6, 240, 14), "the title"),
        ("pictures", "inverted", (425, 240, 440, 250), "the box for inverted cells"),
        ("sections", "line_curve", (130, 145, 145, 151), "some cells of a section"),
        ("comparison", "2d_histogram_03_steps", (90, 210, 130, 216), "an entry of a legend"),
        ("window", "section", (150, 20, 470, 180), "the view"),
        ("window", "section", (84, 63, 95, 71), "the number of elements of a boundary"),
        ("window", "section", (3, 321, 39, 334), "the button that runs"),
    ],
)
def test_what_is_missing_in_a_picture_is_found(folder, name, box, what):
    picture = kept(folder, name)
    near = picture.getpixel((box[0] - 1, box[1] - 1))
    assert "pixels differ" in picture_difference(picture, painted(picture, box, near)), what


def test_one_cell_of_another_color_is_found():
    picture = kept("pictures", "passage")
    yellow = picture.getpixel((30, 112))
    green = (90, 200, 100)
    assert sum(abs(a - b) for a, b in zip(yellow, green, strict=True)) > 150
    assert "pixels differ" in picture_difference(
        picture, painted(picture, (28, 108, 34, 114), green)
    )


def test_a_picture_of_another_size_is_told():
    assert picture_difference(plot(), plot().resize((200, 125))) == (
        "  200x125 pixels instead of 400x250"
    )


@pytest.mark.parametrize(
    ("old", "now", "alike"),
    [
        ("minimum quality  0.527020", "minimum quality  0.527021", True),
        ("minimum quality  0.527020", "minimum quality  0.527023", False),
        ("max_error = 8.3e-17", "max_error = 0.0", True),
        ("max_error = 0.00097", "max_error = 0.00096", False),
        ("x = 0.123456789012", "x = 0.123456789013", True),
        ("x = 0.123456789012", "x = 0.123456799012", False),
        ("inverted  3", "inverted  4", False),
        ("STEPS_GAIN= a number   [0.02]", "STEPS_GAIN= a number   [0.03]", False),
        ("a  6.6e-14     0", "a 1.06e-13  0", True),
        ("color bar", "colour bar", False),
        ("  indented", "indented", False),
        ("wendland-c2", "wendland-c4", False),
        ("condition = [131.5]", "condition = [140.5]", True),
        ("condition = [131.5]", "condition = [1315.0]", False),
        ("walls.a.angle.change.min = 0.00973202743", "walls.a.angle.change.min = 0.00973202", True),
        ("walls.a.angle.change.min = 0.00973202743", "walls.a.angle.change.min = 0.009742", False),
        ("walls.a.angle.after.min = 80.0000000001", "walls.a.angle.after.min = 80.00001", False),
        ("1 2", "1 2 3", False),
    ],
)
def test_lines_are_alike_but_for_rounding(old, now, alike):
    assert lines_alike(old, now) is alike


def test_a_difference_of_texts_names_line_and_command():
    before = "$ slideviz info a\ncells 3\nexit code 0\n\n$ slideviz info b\ncells 4\nexit code 0"
    assert text_difference(before, before) == ""
    told = text_difference(before, before.replace("cells 4", "cells 5"))
    assert told == "  line 6, under $ slideviz info b\n    - cells 4\n    + cells 5"
    told = text_difference(before, before.replace("cells 4\n", ""))
    assert told == "  line 6, under $ slideviz info b\n    - cells 4"
    told = text_difference("\n".join("abcdefghijklmnop"), "\n".join("ABCDEFGHIJKLMNOP"))
    assert told.endswith("  and 4 more")


MESH = "NDIME= 2\nNELEM= 1\n5 0 1 2 0\nNPOIN= 3\n0.0 0.0 0\n1.0 0.0 1\n0.0 0.5 2\nNMARK= 0\n"


@pytest.mark.parametrize(
    ("old", "new", "alike"),
    [
        ("0.5 2", "0.50000000000001 2", True),
        ("0.5 2", "0.5000001 2", False),
        ("1.0 0.0 1\n0.0 0.5 2", "0.0 0.5 1\n1.0 0.0 2", False),
        ("5 0 1 2 0", "5 1 2 0 0", False),
        ("NMARK= 0", "NMARK= 1", False),
    ],
)
def test_a_mesh_is_the_same_but_for_rounding(old, new, alike):
    before, after = (list(mesh_lines(text)) for text in (MESH, MESH.replace(old, new)))
    assert (text_difference("\n".join(before), "\n".join(after)) == "") is alike


def test_seconds_and_digits_of_rounding_are_not_kept():
    assert tidy("  0.27 s (classify 0.22, solve 0.02)") == "  ... s"
    assert tidy("0.12345678901234567 of 3") == "0.123456789012 of 3"
    assert list(flat({"a": {"b": [1, 2.5]}, "seconds": {"c": 1}, "d": [{"e": 1}]})) == [
        *("a.b = [1, 2.5]", "d[0] = e = 1"),
    ]
    assert steady("steps,seconds,min\n1,0.3,0.5\n") == ["steps , min", "1 , 0.5"]
    assert untimed(["head", "min  seconds", "0.5    0.030"]) == ["head", "min  ", "0.5  "]


def test_facts_of_a_drawing_tell_a_missing_line(tmp_path):
    def drawn(count, ending):
        figure = Figure()
        axes = figure.subplots()
        for number in range(count):
            axes.plot([0, 1], [0, number])
        figure.savefig(tmp_path / f"a.{ending}")
        return facts(tmp_path / f"a.{ending}")

    for ending in ("svg", "pdf"):
        assert drawn(2, ending) == drawn(2, ending)
        assert drawn(2, ending) != drawn(3, ending)


def test_recording_changes_only_what_differs(tmp_path):
    old, new = tmp_path / "old", tmp_path / "new"
    for folder, texts in ((old, ("a 0.30000000", "b", "")), (new, ("a 0.30000001", "c", None))):
        folder.mkdir()
        for name, text in zip(("same.txt", "other.txt", "gone.txt"), texts, strict=True):
            if text is not None:
                (folder / name).write_text(text)
    (new / "more.txt").write_text("d")
    assert difference(old / "same.txt", new / "same.txt") == ""
    assert set(record.take(old, new)) == {"other.txt", "gone.txt", "more.txt"}
    assert (old / "same.txt").read_text() == "a 0.30000000"
    assert (old / "other.txt").read_text() == "c"
    assert not (old / "gone.txt").exists()
    assert record.changes(old, new) == {}
