"""Quality in layers along the span."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from slideviz.errors import MeshError, SlidevizError
from slideviz.mesh.model import Cells, Mesh
from slideviz.plots.spanwise import along, spanwise


def strip(count=4):
    """Return squares side by side along x from 1 to 1 + count."""
    x = np.repeat(np.arange(count + 1) + 1.0, 2)
    points = np.stack([x, np.tile([0.0, 1.0], count + 1)], axis=1)
    first = 2 * np.arange(count)[:, None]
    return Mesh(points, Cells.from_blocks([(9, first + np.array([0, 2, 3, 1]))]))


def test_layers_hold_the_cells_whose_middle_is_in_them():
    profile = along(strip(), np.array([0.1, 0.3, 0.5, 0.9]), "x", layers=2, label="run")
    assert profile.edges.tolist() == [1.0, 3.0, 5.0]
    assert profile.minimum.tolist() == [0.1, 0.5]
    np.testing.assert_allclose(profile.mean, [0.2, 0.7])
    assert profile.count.tolist() == [2, 2]
    assert profile.position.tolist() == [2.0, 4.0]
    assert (profile.label, profile.coordinate) == ("run", "x")


def test_a_layer_without_cells_has_no_quality():
    profile = along(strip(2), np.array([0.2, 0.4]), "x", layers=5)
    assert profile.count.tolist() == [0, 1, 0, 1, 0]
    assert np.isnan(profile.minimum[[0, 2, 4]]).all()
    assert np.isnan(profile.mean[[0, 2, 4]]).all()


@pytest.mark.parametrize(("cells", "layers"), [(1, 1), (7, 7), (90, 40)])
def test_a_layer_for_each_layer_of_cells_unless_there_are_many(cells, layers):
    assert len(along(strip(cells), np.ones(cells), "x").count) == layers


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (3.0, 0.0, 0.0), (1.0, 1.0, 0.0)])
def test_radius_is_counted_about_any_axis(axis):
    from slideviz.mesh.axis_frame import axis_basis

    # Three cubes on top of each other, 2, 4 and 6 away from the axis, along e1.
    e1, e2, e3 = axis_basis(axis)
    cube = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    points = np.concatenate([cube + np.array([away, -0.5, 0]) for away in (2.0, 4.0, 6.0)])
    nodes = np.arange(24).reshape(3, 8)
    origin = np.array([5.0, -3.0, 2.0])
    mesh = Mesh(points @ np.stack([e1, e2, e3]) + origin, Cells.from_blocks([(12, nodes)]))
    profile = along(mesh, np.array([0.7, 0.2, 0.5]), "r", axis, tuple(origin), layers=3)
    assert profile.minimum.tolist() == [0.7, 0.2, 0.5]
    np.testing.assert_allclose(profile.edges[[0, -1]], [np.hypot(2, 0.5), np.hypot(7, 0.5)])
    assert profile.coordinate == "r"


def test_what_cannot_be_layered_is_said():
    mesh = strip()
    with pytest.raises(SlidevizError, match=r"3 values for 4 cells"):
        along(mesh, np.zeros(3), "x")
    with pytest.raises(SlidevizError, match=r"0 layers; at least 1"):
        along(mesh, np.zeros(4), "x", layers=0)
    with pytest.raises(SlidevizError, match=r"'z' has no length in this 2D mesh"):
        along(mesh, np.zeros(4), "z")
    with pytest.raises(MeshError, match=r"axis of rotation has length zero"):
        along(mesh, np.zeros(4), "r", (0.0, 0.0, 0.0))
    flat = Mesh(np.column_stack([mesh.points, np.zeros(10)]), mesh.cells)
    with pytest.raises(SlidevizError, match=r"no extent along z"):
        along(flat, np.zeros(4), "z")


def test_the_span_is_vertical_and_gaps_are_bridged():
    axes = Figure().add_subplot()
    profile = along(strip(2), np.array([0.2, 0.4]), "x", layers=5, label="a")
    spanwise(axes, [profile, profile], "mean")
    line = axes.lines[0]
    assert line.get_xdata().tolist() == [0.2, 0.4]
    np.testing.assert_allclose(line.get_ydata(), [1.6, 2.4])
    assert axes.get_ylim() == (1.0, 3.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("mean quality [-]", "x [mesh units]")
    other = Figure().add_subplot()
    spanwise(other, [profile])
    assert other.get_ylim() == (1.0, 3.0)
    assert other.get_legend() is None
