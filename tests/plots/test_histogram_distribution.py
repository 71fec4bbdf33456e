"""Counts of cells by value, and the bars and outlines drawn of them."""

from itertools import pairwise

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle, StepPatch

from slideviz.color_scheme import DARK, PAPER
from slideviz.mesh.quality import INVERTED, quality
from slideviz.plots.histogram import BAND, Bars, Distribution, Outline, draw_distribution
from slideviz.plots.session_plots import BINS, distribution
from slideviz.plots.style import PRINT, Style
from slideviz.session.state import StepFrame


@pytest.fixture(scope="module")
def frames(square):
    rng = np.random.default_rng(3)
    found = []
    for size in (0.0, 0.25, 0.9):
        mesh = square.with_points(square.points + size * rng.uniform(-1, 1, square.points.shape))
        found.append(StepFrame(mesh, quality(mesh, square)))
    return found


@pytest.mark.parametrize("what", ["size-skew", "size", "skew"])
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


def test_displacements_are_counted_between_the_limits_of_the_colors(frames, square):
    found = distribution(frames[1], "displacement", (0.0, 0.5), square)
    values = frames[1].values("displacement", square)
    assert found.counts.tolist() == np.histogram(values, BINS, range=(0.0, 0.5))[0].tolist()
    # What is beyond the last limit is in the last interval.
    assert distribution(frames[1], "displacement", (0.0, 0.01), square).counts[-1] == 16


SHOWN = "#123456"


def drawn(frames, log, style=PRINT, shown=1):
    axes = Figure().add_subplot()
    outlines = [
        Outline("run 2", distribution(frames[2], "skew"), 1),
        Outline("undeformed", distribution(frames[0], "skew"), None),
    ]
    one = distribution(frames[shown], "skew")
    bars = Bars("run 1", one, [SHOWN] * BINS)
    draw_distribution(axes, bars, outlines, "skew quality [-]", log, style)
    return axes, one, outlines


def outlines_of(axes):
    return {patch.get_label(): patch for patch in axes.patches if isinstance(patch, StepPatch)}


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


@pytest.mark.parametrize("style", [PRINT, Style(DARK)])
def test_others_are_outlines_that_differ_from_each_other_and_from_the_bars(frames, style):
    axes, one, outlines = drawn(frames, False, style)
    stairs = outlines_of(axes)
    for other in outlines:
        values = stairs[other.label].get_data().values
        assert values.tolist() == other.distribution.counts.tolist()
    assert stairs["undeformed"].get_linewidth() < stairs["run 2"].get_linewidth()
    own = next(patch for patch in axes.patches if patch.get_gid() == "outline")
    assert own.get_data().values.tolist() == one.counts.tolist()
    assert own.get_linewidth() > stairs["run 2"].get_linewidth(), "seen below a line on it"
    every = [own, *(stairs[other.label] for other in outlines)]
    assert len({str(patch.get_linestyle()) for patch in every}) == 3, "in grey, too"
    assert len({patch.get_edgecolor() for patch in every}) == 3
    assert not any(patch.get_path_effects() for patch in every), "no halo"


def test_bars_are_paler_where_lines_cross_them(frames):
    axes, one, _ = drawn(frames, False)
    own, white = np.array(to_rgb(SHOWN)), np.array(to_rgb(PAPER.background))
    seen = np.array(axes.containers[0].patches[0].get_facecolor()[:3])
    assert 0.3 < np.linalg.norm(seen - own) / np.linalg.norm(white - own) < 0.6
    for others in ([], [Outline("undeformed", one, None)]):
        alone = Figure().add_subplot()
        draw_distribution(alone, Bars("run 1", one, [SHOWN] * BINS), others, "skew quality [-]")
        assert to_rgb(alone.containers[0].patches[0].get_facecolor()) == to_rgb(SHOWN)
        boxes = alone.get_legend().findobj(Rectangle) if others else []
        shown = [to_rgb(box.get_facecolor()) for box in boxes if box.get_fill()]
        assert not others or to_rgb(SHOWN) in shown


def test_the_legend_shows_what_is_drawn_as_it_is_drawn(frames):
    axes, _, _ = drawn(frames, False)
    legend = axes.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["run 1", "run 2", "undeformed"]
    colors = [to_rgb(bar.get_facecolor()) for bar in axes.containers[0].patches]
    boxes = [part for part in legend.findobj(Rectangle) if part.get_transform() is not None]
    filled = [to_rgb(box.get_facecolor()) for box in boxes if box.get_fill()]
    assert colors[0] in filled, "the key of the bars has their colors"
    lines = [to_rgb(handle.get_color()) for handle in legend.legend_handles[1:]]
    stairs = outlines_of(axes)
    assert lines == [to_rgb(stairs[name].get_edgecolor()) for name in ("run 2", "undeformed")]


def test_the_undeformed_mesh_does_not_press_the_rest_flat():
    def some(count):
        counts = np.zeros(BINS, np.int64)
        counts[-1], counts[3] = count, 5
        return Distribution(counts, np.linspace(0.0, 1.0, BINS + 1), 0)

    axes = Figure().add_subplot()
    outlines = [Outline("run 2", some(40), 1), Outline("undeformed", some(10_000), None)]
    draw_distribution(axes, Bars("run 1", some(20)), outlines, "size quality [-]")
    assert 40 < axes.get_ylim()[1] < 50
    alone = Figure().add_subplot()
    draw_distribution(alone, Bars("undeformed", some(10_000)), [], "size quality [-]")
    assert alone.get_ylim()[1] > 10_000


@pytest.mark.parametrize("log", [False, True])
def test_inverted_cells_have_a_strip_left_of_the_values(frames, log):
    bad = frames[2].quality.inverted
    assert bad
    axes, one, _ = drawn(frames, log, Style(DARK), shown=2)
    assert axes.get_xlim() == pytest.approx((-BAND, 1.0))
    strip = axes.containers[1].patches[0]
    assert strip.get_y() + strip.get_height() == one.inverted
    assert strip.get_x() < 0
    assert "inverted" in [text.get_text() for text in axes.texts]
    stem, cap = axes.lines
    assert stem.get_ydata()[1] == cap.get_ydata()[0] == bad
    assert max(*stem.get_xdata(), *cap.get_xdata()) < 0
    assert stem.get_color() == cap.get_color() == Style(DARK).series(1).color


def test_long_numbers_at_the_ticks_do_not_touch():
    axes = Figure(figsize=(3.0, 3.0)).add_subplot()
    edges = np.linspace(0.98625, 1.00125, BINS + 1)
    bars = Bars("run 1", Distribution(np.ones(BINS, np.int64), edges, 0))
    draw_distribution(axes, bars, [], "height ratio [-]")
    axes.figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.get_xticklabels()]
    assert len(boxes) > 2
    assert all(one.x1 < two.x0 for one, two in pairwise(boxes))


def test_without_inverted_cells_there_is_no_strip(frames):
    axes = Figure().add_subplot()
    bars = Bars("undeformed", distribution(frames[0], "size"))
    draw_distribution(axes, bars, [], "size quality [-]")
    assert axes.get_xlim() == (0.0, 1.0)
    assert not axes.texts
