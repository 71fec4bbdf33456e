"""Counts of cells by value, and the bars and outlines drawn of them."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from slideviz.mesh.quality import INVERTED, quality
from slideviz.view.distribution import BAND, BINS, Outline, distribution, draw_distribution
from slideviz.view.plots import ON_DARK, PRINT
from slideviz.view.state import Frame


@pytest.fixture(scope="module")
def frames(square):
    rng = np.random.default_rng(3)
    found = []
    for size in (0.0, 0.25, 0.9):
        mesh = square.with_points(square.points + size * rng.uniform(-1, 1, square.points.shape))
        found.append(Frame(mesh, quality(mesh, square)))
    return found


@pytest.mark.parametrize("what", ["size_skew", "size", "skew"])
@pytest.mark.parametrize("index", [0, 1, 2])
def test_every_cell_is_counted_once_inverted_ones_apart(frames, what, index):
    frame = frames[index]
    found = distribution(frame, what)
    right = frame.quality.status != INVERTED
    wanted = np.histogram(frame.values(what)[right], BINS, range=(0.0, 1.0))[0]
    assert found.counts.tolist() == wanted.tolist()
    assert found.inverted == frame.quality.inverted
    assert found.counts.sum() + found.inverted == 16
    assert len(found.edges) == BINS + 1


def test_displacements_are_counted_between_the_limits_of_the_colours(frames, square):
    found = distribution(frames[1], "displacement", (0.0, 0.5), square)
    values = frames[1].values("displacement", square)
    assert found.counts.tolist() == np.histogram(values, BINS, range=(0.0, 0.5))[0].tolist()
    # What is beyond the last limit is in the last interval.
    assert distribution(frames[1], "displacement", (0.0, 0.01), square).counts[-1] == 16


def drawn(frames, log, style=PRINT, shown=1):
    axes = Figure().add_subplot()
    outlines = [
        Outline("undeformed", distribution(frames[0], "skew"), None),
        Outline("run 2", distribution(frames[2], "skew"), 1),
    ]
    one = distribution(frames[shown], "skew")
    colours = ["#123456"] * BINS
    draw_distribution(axes, one, outlines, ("run 1", "skew quality [-]"), colours, log, style)
    return axes, one, outlines


@pytest.mark.parametrize("log", [False, True])
def test_bars_are_as_high_as_there_are_cells(frames, log):
    axes, one, _ = drawn(frames, log)
    bars = axes.containers[0].patches
    tops = np.array([bar.get_y() + bar.get_height() for bar in bars])
    there = one.counts > 0
    assert tops[there].tolist() == one.counts[there].tolist()
    # Empty intervals have no height at all, on a logarithmic axis too.
    assert all(bar.get_height() == 0 for bar, some in zip(bars, there, strict=True) if not some)
    assert axes.get_yscale() == ("log" if log else "linear")
    assert axes.get_xlabel() == "skew quality [-]"


def test_others_are_outlines_with_a_name_the_undeformed_one_thin(frames):
    axes, _, outlines = drawn(frames, False)
    stairs = {patch.get_label(): patch for patch in axes.patches if "StepPatch" in str(type(patch))}
    assert stairs["undeformed"].get_linewidth() < stairs["run 2"].get_linewidth()
    for other in outlines:
        values = stairs[other.label].get_data().values
        assert values.tolist() == other.distribution.counts.tolist()
    names = [text.get_text() for text in axes.get_legend().get_texts()]
    assert sorted(names) == ["run 1", "run 2", "undeformed"]


def test_inverted_cells_have_a_strip_left_of_the_values(frames):
    assert frames[2].quality.inverted
    axes, one, _ = drawn(frames, True, ON_DARK, shown=2)
    assert axes.get_xlim() == pytest.approx((-BAND, 1.0))
    strip = axes.containers[1].patches[0]
    assert strip.get_height() == one.inverted
    assert strip.get_x() < 0
    assert "inverted" in [text.get_text() for text in axes.texts]


def test_without_inverted_cells_there_is_no_strip(frames):
    axes = Figure().add_subplot()
    one = distribution(frames[0], "size")
    draw_distribution(axes, one, [], ("undeformed", "size quality [-]"))
    assert axes.get_xlim() == (0.0, 1.0)
    assert not axes.texts
