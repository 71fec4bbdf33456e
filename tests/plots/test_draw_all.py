"""Plots drawn onto plain axes: what they show, in which order, and that letters are legible."""

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from slideviz.color_scheme import DARK, LIGHT
from slideviz.plots.draw import (
    GreedyRun,
    Outcome,
    StepRun,
    against_steps,
    convergence,
    quality_by_step,
)
from slideviz.plots.histogram import QualityRun, histogram
from slideviz.plots.style import PRINT, Style


@pytest.fixture
def axes():
    figure = Figure(figsize=(4, 3), layout="constrained")
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def letters(axes):
    """Return all texts of the drawn figure."""
    axes.figure.canvas.draw()
    legend = axes.get_legend()
    texts = [axes.xaxis.label, axes.yaxis.label, *axes.get_xticklabels(), *axes.get_yticklabels()]
    return [*texts, *axes.texts, *(legend.get_texts() if legend else [])]


def two_qualities():
    good = np.array([0.05, 0.15, 0.15, 1.0])
    folded = np.array([0.0, 0.0, 0.95, 0.95])
    return [QualityRun("a", good), QualityRun("b", folded, folded == 0)]


def test_histogram_counts_inverted_cells_apart(axes):
    histogram(axes, two_qualities(), edges=np.linspace(0.0, 1.0, 11))
    first, second = (patch.get_data().values for patch in axes.patches[:2])
    assert first.tolist() == [1, 2, 0, 0, 0, 0, 0, 0, 0, 1]
    assert second.tolist() == [0] * 9 + [2]
    stem, _cap = axes.lines
    assert stem.get_ydata()[1] == 2
    assert all(x < 0 for x in stem.get_xdata())
    assert axes.get_xlim()[0] < stem.get_xdata()[0]
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts == ["a", "b (2 inverted)"]


def test_histogram_without_inverted_cells_begins_at_zero(axes):
    histogram(axes, two_qualities()[:1], log=True)
    assert axes.get_xlim() == (0.0, 1.0)
    assert axes.get_yscale() == "log"
    assert not axes.lines


def test_steps_show_minimum_and_mean_of_each_run(axes):
    runs = [
        StepRun("a", np.arange(3), np.array([1.0, 0.8, 0.6]), np.array([1.0, 0.9, 0.8])),
        StepRun("b", np.arange(2), np.array([1.0, 0.5]), np.array([1.0, 0.7])),
    ]
    quality_by_step(axes, runs)
    drawn = {line.get_gid(): line.get_ydata().tolist() for line in axes.lines if line.get_gid()}
    assert drawn == {
        "minimum:a": [1.0, 0.8, 0.6],
        "mean:a": [1.0, 0.9, 0.8],
        "minimum:b": [1.0, 0.5],
        "mean:b": [1.0, 0.7],
    }
    texts = [text.get_text() for text in axes.get_legend().get_texts()]
    assert texts == ["a", "b", "minimum", "mean"]
    assert axes.get_ylim()[0] == 0


@pytest.mark.parametrize("count", [2, 7, 14, 40])
def test_the_last_step_has_a_marker(axes, count):
    values = np.linspace(1.0, 0.5, count)
    runs = [StepRun(name, np.arange(count), values, values) for name in "ab"]
    quality_by_step(axes, runs)
    for line in axes.lines[:4]:
        assert line.get_markevery()[-1] == count - 1
        assert len(line.get_markevery()) <= 8


def test_convergence_marks_levels_and_tolerance(axes):
    run = GreedyRun(
        "a",
        np.array([0, 4, 8, 12]),
        np.array([1.0, 0.1, 0.05, 0.0]),
        np.array([1, 1, 2, 2]),
        1e-2,
    )
    convergence(axes, [run, run])
    assert axes.get_yscale() == "log"
    curve, level, *_ = axes.lines
    assert curve.get_ydata().tolist() == [1.0, 0.1, 0.05]  # 0 has no place on this axis
    assert curve.get_markevery() == [0, 2]
    assert level.get_ydata() == [1e-2, 1e-2]
    assert [text.get_text() for text in axes.texts] == ["tolerance 0.01"]
    assert "[mesh units]" in axes.get_ylabel()
    low = axes.get_ylim()[0]
    assert low < 1e-2 / 2


def test_of_many_levels_some_are_marked(axes):
    count = np.arange(400)
    convergence(axes, [GreedyRun("a", count, np.ones(400), count)])
    (line,) = axes.lines
    assert len(line.get_markevery()) == 10
    assert line.get_linewidth() < PRINT.width


def outcomes():
    return [
        Outcome("ps", 20, 0.5, 0.7, 0, 2.0),
        Outcome("ps", 1, 0.0, 0.6, 3, 0.1),
        Outcome("ps", 5, 0.4, 0.65, 0, 0.5),
        Outcome("ds", 5, 0.3, 0.66, 0, 9.0),
    ]


def test_rows_are_joined_in_order_of_steps_and_inverted_ones_are_crosses(axes):
    against_steps(axes, outcomes(), "minimum")
    ps, cross, ds = axes.lines
    assert ps.get_xdata().tolist() == [1, 5, 20]
    assert np.isnan(ps.get_ydata()[0])
    assert ps.get_ydata()[1:].tolist() == [0.4, 0.5]
    assert (cross.get_gid(), cross.get_xdata().tolist()) == ("inverted:ps", [1])
    assert ds.get_xdata().tolist() == [5]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["1", "5", "20"]


@pytest.mark.parametrize("steps", [(1, 2, 3, 4), tuple(range(1, 15)), (5,)])
def test_labels_of_steps_keep_apart(axes, steps):
    against_steps(axes, [Outcome("ps", n, 0.5, 0.7, 0, 1.0) for n in steps], "minimum")
    axes.figure.set_size_inches(2.3, 2.1)
    axes.figure.draw_without_rendering()
    labels = axes.get_xticklabels()
    words = [label.get_text() for label in labels]
    assert (words[0], words[-1]) == (str(steps[0]), str(steps[-1]))
    assert len(words) == len(steps) if len(steps) < 5 else len(words) >= 5
    boxes = [label.get_window_extent() for label in labels]
    assert all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))


@pytest.mark.parametrize(
    ("what", "label", "scale"),
    [
        ("mean", "mean quality [-]", "linear"),
        ("seconds", "processor time [s]", "log"),
    ],
)
def test_every_value_has_its_label_and_a_fitting_scale(axes, what, label, scale):
    against_steps(axes, outcomes(), what)
    assert axes.get_ylabel() == label
    assert axes.get_yscale() == scale
    assert len(axes.lines) == (3 if what == "mean" else 2)


@pytest.mark.parametrize("style", [PRINT, Style(LIGHT), Style(DARK)])
def test_letters_are_large_enough_and_stand_out(axes, style):
    histogram(axes, two_qualities(), style=style)
    background = np.array(to_rgb(style.scheme.background))
    for text in letters(axes):
        assert text.get_fontsize() >= 8
        assert np.abs(np.array(to_rgb(text.get_color())) - background).max() > 0.4


@pytest.mark.parametrize(
    ("draw", "run"),
    [
        (histogram, QualityRun("a", np.array([0.5]), series=4)),
        (quality_by_step, StepRun("a", np.arange(1), np.ones(1), np.ones(1), 4)),
        (convergence, GreedyRun("a", np.arange(1), np.ones(1), np.ones(1), None, 4)),
        (against_steps, Outcome("a", 1, 0.5, 0.5, series=4)),
    ],
)
def test_a_run_can_keep_its_look_when_others_are_left_out(axes, draw, run):
    draw(axes, [run])
    artist = axes.patches[0] if draw is histogram else axes.lines[0]
    color = artist.get_edgecolor() if draw is histogram else artist.get_color()
    assert to_rgb(color) == to_rgb(PRINT.series(4).color)


def test_a_style_without_legend_leaves_it_to_the_figure(axes):
    from dataclasses import replace

    against_steps(axes, outcomes(), style=replace(PRINT, legend=False))
    assert axes.get_legend() is None
    assert axes.get_legend_handles_labels()[1] == ["ps", "ds"]


@pytest.mark.parametrize("style", [PRINT, Style(DARK)])
def test_series_differ_without_their_color(style):
    looks = [style.series(index) for index in range(49)]
    assert len({(look.marker, str(look.dash)) for look in looks[:7]}) == 7
    assert len({(look.color, look.marker, str(look.dash)) for look in looks}) == 49
    for one, other in itertools.combinations(looks[:7], 2):
        assert one.marker != other.marker
        assert str(one.dash) != str(other.dash)


@pytest.mark.parametrize("draw", [histogram, against_steps, quality_by_step, convergence])
def test_an_empty_plot_is_only_empty(axes, draw):
    draw(axes, [])
    axes.figure.canvas.draw()
    assert not any(len(line.get_xdata()) for line in axes.lines)
    assert axes.get_xlabel()
