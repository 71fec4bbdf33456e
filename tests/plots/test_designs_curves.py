"""Plots of designs: a curve for each choice of the other numbers, points that can be found."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from slideviz.design.sweeps.table import DesignRow
from slideviz.plots.designs import against_designs, design_curves, failed_designs, nearest_design
from slideviz.session.design_table import DesignTable


@pytest.fixture
def table():
    made = DesignTable().crossed("m.angle", ["2", "1", "3"]).crossed("m.y", ["0", "0.5"])
    rows = [
        DesignRow(n, min=0.1 * n, mean=0.1 * n + 0.2, inverted=int(n == 4), control_nodes=n)
        for n in range(1, 6)
    ]
    return made.with_results([*rows, DesignRow(6, problem="no")])


def test_curves_are_ascending_and_leave_out_what_failed(table):
    first, second = design_curves(table, "m.angle", "quality")
    assert (first.label, second.label, first.others) == ("0", "0.5", "m.y")
    assert first.design.tolist() == [3, 1, 5]
    assert first.places.tolist() == [1.0, 2.0, 3.0]
    assert first.values == pytest.approx([0.3, 0.1, 0.5])
    assert first.mean == pytest.approx([0.5, 0.3, 0.7])
    assert second.design.tolist() == [4, 2]
    assert second.inverted.tolist() == [True, False]
    assert [len(curve.places) for curve in design_curves(table, "m.y", "seconds")] == [2, 2, 1]


def test_words_stand_in_their_order():
    table = DesignTable().crossed("SLIDING_MODE", ["ps", "none", "ds"])
    table = table.with_results(DesignRow(n, min=0.5, mean=0.6) for n in (1, 2, 3))
    (curve,) = design_curves(table, "SLIDING_MODE", "quality")
    assert curve.words == ("ps", "none", "ds")
    assert curve.places.tolist() == [0.0, 1.0, 2.0]


def drawn(table, what="quality", shown=None):
    figure = Figure((5, 3), layout="constrained")
    axes = figure.add_subplot()
    curves = design_curves(table, "m.angle", what)
    failed = failed_designs(table, "m.angle")
    against_designs(axes, curves, "m.angle", what, shown, failed=failed)
    FigureCanvasAgg(figure).draw()
    return axes, curves


def test_what_is_drawn(table):
    axes, _ = drawn(table, shown=3)
    by_gid = {line.get_gid(): line for line in axes.lines}
    assert by_gid["curve:0"].get_ydata() == pytest.approx([0.3, 0.1, 0.5])
    # One with inverted cells is a cross instead of a point; its curve goes through it.
    assert by_gid["curve:0.5"].get_ydata() == pytest.approx([0.4, 0.2])
    assert by_gid["curve:0.5"].get_markevery() == [1]
    assert by_gid["inverted"].get_ydata() == pytest.approx([0.4])
    assert by_gid["shown"].get_ydata() == pytest.approx([0.3])
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["0", "0.5", "failed", "inverted", "minimum", "mean"]
    # One that failed is a cross on the axis.
    (place,), (height,) = by_gid["failed"].get_data()
    assert (place, height) == (3.0, 0.0)
    axes, _ = drawn(table, "control_nodes")
    assert not any(str(line.get_gid()).startswith("mean") for line in axes.lines)


def test_the_nearest_point_is_found(table):
    axes, curves = drawn(table)
    for curve in curves:
        for k, design in enumerate(curve.design.tolist()):
            x, y = axes.transData.transform((curve.places[k], curve.values[k]))
            assert nearest_design(axes, curves, x + 1.0, y - 1.0) == design
            x, y = axes.transData.transform((curve.places[k], curve.mean[k]))
            if curve.mean[k] not in curve.values:
                assert nearest_design(axes, curves, x, y) in {1, 2, 3, 4, 5}
    assert nearest_design(axes, [], 0.0, 0.0) is None
    x, y = axes.get_xaxis_transform().transform((3.0, 0.0))
    assert nearest_design(axes, curves, x, y, failed_designs(table, "m.angle")) == 6


@pytest.mark.parametrize(("lines", "above"), [(3, True), (12, False)])
def test_the_legend_is_above_unless_it_would_be_too_high(lines, above):
    table = DesignTable().crossed("a", [str(k) for k in range(lines)]).crossed("m.angle", ["1"])
    table = table.with_results(DesignRow(n, min=0.5, mean=0.6) for n in range(1, lines + 1))
    figure = Figure((2.8, 2.5), layout="constrained")
    axes = figure.add_subplot()
    against_designs(axes, design_curves(table, "m.angle", "quality"), "m.angle")
    FigureCanvasAgg(figure).draw()
    legend = axes.get_legend().get_window_extent()
    assert (legend.y0 >= axes.bbox.y1) == above
    assert (legend.x0 >= axes.bbox.x1) == (not above)
    assert legend.x1 <= figure.bbox.x1


def test_many_curves_are_points_of_one_look():
    table = DesignTable().crossed("a", [str(k) for k in range(20)]).crossed("m.angle", ["1", "2"])
    table = table.with_results(DesignRow(n, min=0.5, mean=0.6) for n in range(1, 41))
    axes, curves = drawn(table)
    assert len(curves) == 20
    assert {line.get_linestyle() for line in axes.lines if "curve" in str(line.get_gid())} == {
        "None"
    }
    assert axes.get_legend() is None
