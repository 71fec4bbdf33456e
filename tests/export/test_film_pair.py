"""Films of two runs beside each other: one camera, one range, the steps that belong together."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from slideviz.errors import SlidevizError
from slideviz.export import offscreen_renderer as module
from slideviz.export.film import FilmOptions, film, image_options, require_pair_width
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import panes
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.scene.stage import STRIP
from slideviz.session.opening import session_of_runs
from slideviz.session.state import Run, StepFrame, round_up
from slideviz.solver.deform import deform

SIZE = (800, 400)
USUAL = FilmOptions(SIZE)


@pytest.fixture(scope="module")
def made():
    return sample("passage", 12)


@pytest.fixture(scope="module")
def runs(made):
    """Four steps with pseudo sliding, and two steps with all sides held."""

    def run(number, name, **changes):
        case = made.case.change(**changes)
        meshes = [step.mesh for step in deform(case, made.mesh)]
        frames = [StepFrame(mesh, quality(mesh, reference=made.mesh)) for mesh in meshes]
        return Run(number, case, tuple(frames), "done", name=name)

    held = {"sliding": "none", "periodic": "none"}
    return run(1, "SLIDING_MODE= ps", steps=4), run(2, "SLIDING_MODE= none", steps=2, **held)


@pytest.fixture(scope="module")
def shoot(made):
    def film_of(runs, file, film_options=USUAL, color_by="size-skew", **options):
        session = session_of_runs(StepFrame(made.mesh, quality(made.mesh)), runs, color_by)
        return list(film(session, file, film_options, **options))[-1].done

    return film_of


@pytest.fixture
def told(monkeypatch):
    """Words above the pictures, in the order in which they are written."""
    words = []
    write = module.write_title

    def tell(plotter, text, scheme, letters, room):
        words.append((text, letters))
        write(plotter, text, scheme, letters, room)

    monkeypatch.setattr(module, "write_title", tell)
    return words


def test_each_run_has_its_half_its_name_and_its_numbers(runs, tmp_path, told, shoot):
    assert shoot(runs, tmp_path / "p_%d.png") == 5
    pairs = list(zip(told[::2], told[1::2], strict=True))
    lines = [(left[0].split("\n"), right[0].split("\n")) for left, right in pairs]
    assert {left[0] for left, _ in lines} == {"SLIDING_MODE= ps"}
    assert {right[0] for _, right in lines} == {"SLIDING_MODE= none"}
    last = [run.frames[-1].quality for run in runs]
    assert lines[-1][0][1] == f"step 4 of 4: min {last[0].min:.4f}, mean {last[0].mean:.4f}"
    assert lines[-1][1][1].startswith(f"step 2 of 2: min {last[1].min:.4f}")
    # As far deformed: the run of two steps is half way when that of four is.
    assert lines[2][1][1].startswith("step 1 of 2")
    with Image.open(tmp_path / "p_4.png") as image:
        assert image.size == SIZE


def test_both_halves_are_one_picture_when_the_runs_are_the_same(runs, tmp_path, shoot):
    twice = [replace(runs[0], number=number, name="a") for number in (1, 2)]
    shoot(twice, tmp_path / "p_%d.png", color_by="displacement")
    with Image.open(tmp_path / "p_4.png") as image:
        whole = np.asarray(image).astype(int)
    figure = image_options(SIZE, both=True)
    first, second = panes(figure, figure.gap)
    left, right = whole[:, : first.size[0]], whole[:, -second.size[0] :][:, : first.size[0]]
    # The same but for a part of a pixel by which one of them may be wider.
    boxes = [np.argwhere(half[60:].min(axis=2) < 250) for half in (left, right)]
    for ends in (np.min, np.max):
        assert np.abs(ends(boxes[0], axis=0) - ends(boxes[1], axis=0)).max() <= 1, "one camera"
    inside = [half[100:-100].reshape(-1, 3).mean(axis=0) for half in (left, right)]
    assert np.abs(inside[0] - inside[1]).max() < 0.5, "one range of colors"
    assert (left.min(axis=2) < 100).any()
    bar = whole[:, -round(STRIP * figure.scale) :]
    assert (np.ptp(bar, axis=2) > 100).any(), "the color bar is at the right"


def test_the_range_of_displacements_holds_both_runs(made, runs, tmp_path, monkeypatch, shoot):
    ranges = []
    draw = OffscreenRenderer.draw_panes

    def spy(self, shown, *rest):
        ranges.extend(one.color_range for one in shown)
        return draw(self, shown, *rest)

    monkeypatch.setattr(OffscreenRenderer, "draw_panes", spy)
    first = made.mesh
    far = first.with_points(first.points + np.array([3.0, 0.0]))
    frames = (StepFrame(far, quality(far, reference=first)),)
    moved = Run(2, runs[0].case, frames, "done", name="far")
    for pair in ((runs[0], moved), (moved, runs[0])):
        ranges.clear()
        shoot(pair, tmp_path / "p_%d.png", color_by="displacement", overwrite=True)
        assert len(set(ranges)) == 1
        assert ranges[0] == (
            0.0,
            round_up(np.linalg.norm(far.points - first.points, axis=1).max()),
        )


def test_images_in_between_are_there_for_both(runs, tmp_path, told, shoot):
    assert shoot(runs, tmp_path / "p_%02d.png", FilmOptions(SIZE, between=1)) == 9
    second = [text.split("\n")[1] for text, _ in told[1::2]]
    assert second[1].startswith("step 0.25 of 2, interpolated")
    assert second[4].startswith("step 1 of 2: min")
    assert len({letters for _, letters in told}) == 1, "words must not tremble"


def test_long_names_have_smaller_letters(runs, tmp_path, told, shoot):
    shoot(runs, tmp_path / "a_%d.png")
    usual = told[0][1]
    told.clear()
    shoot((replace(runs[0], name="KEY= value, " * 7), runs[1]), tmp_path / "b_%d.png")
    assert told[0][1] < usual


def test_what_cannot_be_is_told(runs, tmp_path, shoot):
    with pytest.raises(SlidevizError, match="no steps to make a film of"):
        shoot((runs[0], replace(runs[1], frames=())), tmp_path / "a.gif")
    with pytest.raises(SlidevizError, match=r"300x300 pixels are too narrow.*take 408 or more"):
        shoot(runs, tmp_path / "a.gif", FilmOptions((300, 300)))
    require_pair_width((408, 300))
    assert not list(tmp_path.iterdir())
