"""Span between two walls, and curves of constant span: axial, radial and contoured passages."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import MeshError
from slideviz.machine.span_field import SpanCurves, find_span
from slideviz.samples.impeller import impeller_mesh
from tests.builders import passage, shuffled, square

AXIS, ORIGIN = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
PERIOD = np.radians(30.0)


def tilted(mesh):
    """Return the mesh with its axis along x + y through (1, 2, 3), and that axis and point."""
    axis = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    turn = np.stack([np.cross([0, 0, 1.0], axis), [0, 0, 1.0], axis], axis=1)
    return (
        mesh.with_points(mesh.points @ turn.T + [1.0, 2.0, 3.0]),
        (1.0, 1.0, 0.0),
        (1.0, 2.0, 3.0),
    )


def contoured(mesh):
    """Return an annular passage whose hub waves along theta and z, periodically."""
    x, y, z = mesh.points.T
    r, theta = np.hypot(x, y), np.arctan2(y, x)
    part = (1.0 - r) / 0.5
    wave = 0.03 * part * np.cos(12.0 * theta) * np.sin(np.pi * z)
    factor = (r + wave) / r
    return mesh.with_points(np.stack([factor * x, factor * y, z], axis=1))


def impeller():
    mesh = impeller_mesh(3000)
    field = find_span(mesh, "HUB", "SHROUD", AXIS, ORIGIN, 2 * np.pi / 13)
    coords = field.meridional(mesh.points[mesh.marker("BLADE").nodes])
    return mesh, field, coords, SpanCurves(field, coords[:, :2].mean(axis=0))


@pytest.mark.parametrize("turned", [False, True])
def test_between_cylinders_span_is_a_part_of_the_radius(turned):
    mesh, axis, origin = passage((4, 6, 8)), AXIS, ORIGIN
    expected = (np.hypot(*mesh.points[:, :2].T) - 0.5) / 0.5
    z = mesh.points[:, 2]
    if turned:
        mesh, axis, origin = tilted(mesh)
    field = find_span(mesh, "hub", "shroud", axis, origin, PERIOD)
    coords = field.meridional(mesh.points)
    assert np.abs(field.points(coords) - mesh.points).max() < 1e-14
    span, slope = field.span(coords)
    assert span == pytest.approx(expected, abs=1e-14)
    assert slope == pytest.approx(np.tile([0.0, 2.0, 0.0], (len(span), 1)), abs=1e-11)
    curves = SpanCurves(field, (0.5, 0.7))
    plane = curves.plane(coords)
    assert plane[:, 0] == pytest.approx((z - 0.5) / (0.5 + 0.5 * expected), abs=1e-5)
    assert curves.length(plane) == pytest.approx(z - 0.5, abs=1e-5)
    assert curves.at_length(z - 0.5, span) == pytest.approx(plane[:, 0], abs=1e-5)
    assert np.abs(curves.coords(plane) - coords).max() < 1e-14
    inside = np.abs(z - 0.5) < 0.4
    assert plane[inside, 0] * coords[inside, 1] == pytest.approx(z[inside] - 0.5, abs=1e-9)


def test_slopes_of_points_are_their_derivative():
    mesh, axis, origin = tilted(passage((2, 3, 4)))
    field = find_span(mesh, "hub", "shroud", axis, origin, PERIOD)
    coords = field.meridional(mesh.points)
    for k, step in enumerate(1e-6 * np.eye(3)):
        change = (field.points(coords + step) - field.points(coords - step)) / 2e-6
        assert field.slopes(coords)[:, :, k] == pytest.approx(change, abs=1e-9)


def test_in_an_impeller_the_plane_keeps_angles_and_points_come_back():
    mesh, field, coords, curves = impeller()
    assert field.revolved
    span, slope = field.span(coords)
    on_hub = np.isin(mesh.marker("BLADE").nodes, mesh.marker("HUB").nodes)
    assert np.abs(span[on_hub]).max() < 1e-4
    assert np.abs(slope[:, 2]).max() == 0.0
    plane = curves.plane(coords)
    assert np.abs(curves.coords(plane) - coords).max() < 1e-14
    moved = plane + np.array([0.05, 0.1, 0.0])
    there, by = curves.coords_and_slopes(moved)
    assert np.abs(field.span(there)[0] - span).max() < 1e-14
    assert np.abs(curves.plane(there) - moved).max() < 1e-12
    # Lengths along m' and theta are r times as long: equal, and at a right angle.
    assert np.hypot(by[:, 0, 0], by[:, 1, 0]) == pytest.approx(there[:, 1], rel=2e-3)
    assert np.array_equal(by[:, 2], np.tile([0.0, 1.0], (len(there), 1)))
    # m' is the integral of dm / r, which grows from inflow to exit; m is the way in the plane.
    ends = np.linspace(-0.3, 0.3, 401)
    line = curves.coords(np.column_stack([ends, 0 * ends, np.full(401, 0.5)]))
    way = np.hypot(*np.diff(line[:, :2], axis=0).T)
    middle = 0.5 * (line[1:, 1] + line[:-1, 1])
    assert np.sum(way / middle) == pytest.approx(0.6, rel=1e-4)
    m = curves.length(np.column_stack([ends, 0 * ends, np.full(401, 0.5)]))
    assert np.diff(m) == pytest.approx(way, rel=1e-2)
    assert m[-1] - m[0] == pytest.approx(way.sum(), rel=1e-4)


@pytest.mark.parametrize("make", [passage, lambda: contoured(passage((6, 12, 8)))])
def test_derivatives_of_curves_agree_with_differences(make):
    mesh = make()
    field = find_span(mesh, "hub", "shroud", AXIS, ORIGIN, PERIOD)
    coords = field.meridional(mesh.points)
    coords = coords[np.abs(coords[:, 0] - 0.2) < 0.15]  # before the hole of the blade
    curves = SpanCurves(field, (0.5, 0.7))
    plane = curves.plane(coords) + np.array([0.0123, 0.0234, 0.0])
    here, by = curves.coords_and_slopes(plane)
    assert np.abs(field.span(here)[0] - plane[:, 2]).max() < 1e-12
    for k, step in enumerate(1e-7 * np.eye(3)[:2]):
        change = (curves.coords(plane + step) - curves.coords(plane - step)) / 2e-7
        wrong = np.abs(by[:, :, k] - change).max(axis=1)
        assert np.mean(wrong < 1e-6) > 0.98  # but where two facets meet
    assert not field.revolved or np.abs(by[:, :2, 1]).max() == 0.0


def test_points_on_curves_do_not_depend_on_other_points():
    _, _, coords, curves = impeller()
    plane = curves.plane(coords)
    others = plane.copy()
    others[::2, 0] += 0.05
    assert (curves.coords(plane)[1::2] == curves.coords(others)[1::2]).all()


def test_a_contoured_hub_is_followed_along_theta():
    mesh = contoured(passage((6, 12, 8)))
    field = find_span(mesh, "hub", "shroud", AXIS, ORIGIN, PERIOD)
    assert not field.revolved
    hub = field.meridional(mesh.points[mesh.marker("hub").nodes])
    inside = hub[np.abs(hub[:, 0] - 0.5) < 0.4]
    span, slope = field.span(inside)
    assert np.abs(span).max() < 1e-12
    assert np.abs(slope[:, 2]).max() > 0.1
    curves = SpanCurves(field, (0.5, 0.7))
    plane = curves.plane(inside)
    assert np.abs(curves.coords(plane) - inside).max() < 1e-12
    turned = curves.coords(plane + np.array([0.0, PERIOD, 0.0]))
    assert np.abs(turned - inside - [0.0, 0.0, PERIOD]).max() < 1e-12


def test_what_has_no_span_is_refused():
    mesh = passage((2, 3, 4))
    with pytest.raises(MeshError, match="needs a mesh in 3D"):
        find_span(square(4), "low", "high", AXIS, ORIGIN)
    with pytest.raises(MeshError, match="do not face each other"):
        find_span(mesh, "hub", "per1", AXIS, ORIGIN, PERIOD)
    with pytest.raises(MeshError, match="do not face each other"):
        find_span(mesh, "hub", "hub", AXIS, ORIGIN, PERIOD)
    empty = sv.Mesh(
        mesh.points, mesh.cells, (*mesh.markers, sv.Marker("none", sv.Cells.from_blocks([])))
    )
    with pytest.raises(MeshError, match="'none' has no facets"):
        find_span(empty, "none", "shroud", AXIS, ORIGIN, PERIOD)
    field = find_span(mesh, "hub", "shroud", AXIS, ORIGIN, PERIOD)
    with pytest.raises(MeshError, match="is not between hub and shroud"):
        SpanCurves(field, (0.5, 1.2))
    curves = SpanCurves(field, (0.5, 0.7))
    with pytest.raises(MeshError, match="is on the axis"):
        curves.plane(np.array([[0.5, 0.0, 0.0]]))
    wavy = contoured(passage((6, 12, 8)))
    field = find_span(wavy, "hub", "shroud", AXIS, ORIGIN, PERIOD)
    curves = SpanCurves(field, (0.5, 0.7))
    with pytest.raises(MeshError, match=r"there is no span of 0 at .*: the walls end before"):
        curves.coords(np.array([[0.0, 1.5 * PERIOD + 0.01, 0.0], [3.0, 0.0, 0.0]]))


def test_the_hole_below_a_blade_in_a_contoured_wall_is_closed():
    wavy = contoured(passage((6, 12, 8)))
    field = find_span(wavy, "hub", "shroud", AXIS, ORIGIN, PERIOD)
    solid = contoured(passage((6, 12, 8), blade=False))
    whole = find_span(solid, "hub", "shroud", AXIS, ORIGIN, PERIOD)
    curves = SpanCurves(field, (0.5, 0.7))
    at = np.array([[m, theta, 0.0] for m in (-0.1, 0.0, 0.1) for theta in np.radians((13.5, 16.0))])
    coords = curves.coords(at)
    assert np.abs(whole.span(coords)[0]).max() < 5e-3  # a facet of the wall is so much off its arc
    # Around it nothing changes, to the bit.
    away = solid.points[np.abs(solid.points[:, 2] - 0.5) > 0.3]
    away = field.meridional(away[np.hypot(*away[:, :2].T) < 0.52])
    assert np.array_equal(field.span(away)[0], whole.span(away)[0])


@pytest.mark.parametrize(
    ("mesh", "ends", "period"),
    [
        (impeller_mesh(3000), ("HUB", "SHROUD"), 2 * np.pi / 13),
        (contoured(passage((6, 12, 8))), ("hub", "shroud"), PERIOD),
    ],
)
def test_span_does_not_depend_on_numbers_of_nodes(mesh, ends, period):
    spans = []
    for order, other in ((slice(None), mesh), shuffled(mesh, 1), shuffled(mesh, 2)):
        field = find_span(other, *ends, AXIS, ORIGIN, period)
        span = np.empty(len(mesh.points))
        span[order] = field.span(field.meridional(other.points))[0]
        spans.append(span)
    assert np.ptp(spans, axis=0).max() < 1e-13
