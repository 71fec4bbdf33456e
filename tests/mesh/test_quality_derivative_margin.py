"""The margin: how far coefficients of the Jacobian are from zero, and its derivative."""

from __future__ import annotations

import numpy as np
import pytest

from slideviz.errors import CaseError, MeshError
from slideviz.formats.files import read
from slideviz.mesh.quality import VALID, quality
from slideviz.mesh.quality_derivative import cell_margins, smooth_margin
from slideviz.system.threads import ordered_map
from tests.builders import grid, halo_text
from tests.mesh.test_quality_derivative import TYPES, shaken, shaken_mesh, soup


def differences(value, mesh, points, h=1e-6):
    out = np.empty(points.shape)
    for at in np.ndindex(points.shape):
        up, down = points.copy(), points.copy()
        up[at] += h
        down[at] -= h
        out[at] = (value(mesh.with_points(up)) - value(mesh.with_points(down))) / (2 * h)
    return out


@pytest.mark.parametrize("folded", [False, True], ids=["valid", "folded"])
@pytest.mark.parametrize("vtk", TYPES)
def test_the_derivative_is_exact_for_each_type(vtk, folded):
    before = soup(vtk, shaken(vtk, 3, 0.05, seed=1))
    mesh = soup(vtk, shaken(vtk, 3, 0.1))
    if folded:
        points = mesh.points.copy()
        points[-1] = 2 * points[: len(points) // 3].mean(axis=0) - points[-1]  # of another cell
        mesh = mesh.with_points(points)
    p = 7.0
    found = smooth_margin(mesh, before, p)
    assert (found.value < 0) == folded
    expected = differences(lambda each: smooth_margin(each, before, p).value, mesh, mesh.points)
    np.testing.assert_allclose(found.of_points, expected, atol=1e-7 * np.abs(expected).max())
    margins = cell_margins(mesh, before)
    assert (margins < 0).any() == folded
    assert found.value <= margins.min() if not folded else found.value <= margins.min() < 0


def determinant(vtk, nodes, at):
    """Return det J of a hexahedron or a prism (n, 3) at a place of its parameters, literally."""
    u, v, w = at
    if vtk == 12:
        low = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v])
        slopes = [np.array([v - 1, 1 - v, v, -v]), np.array([u - 1, -u, u, 1 - u])]
    else:
        low, slopes = np.array([1 - u - v, u, v]), [np.array([-1, 1, 0]), np.array([-1, 0, 1])]
    rows = [np.r_[slope * (1 - w), slope * w] @ nodes for slope in slopes]
    return np.linalg.det([*rows, np.r_[-low, low] @ nodes])


@pytest.mark.parametrize("vtk", [12, 13])
def test_no_point_of_a_cell_has_a_smaller_jacobian_than_its_margin_says(vtk):
    cells = shaken(vtk, 40, 0.45, seed=3)
    ideal = np.repeat(shaken(vtk, 1, 0.0), 40, axis=0)
    mesh, reference = soup(vtk, cells), soup(vtk, ideal)
    margins = cell_margins(mesh, reference)
    places = np.random.default_rng(1).uniform(0, 1, (200, 3))
    if vtk == 13:
        places[:, :2] *= 0.5
    scale = determinant(vtk, ideal[0], (0.25, 0.25, 0.5))  # the same everywhere
    least = np.array([min(determinant(vtk, c, at) for at in places) for c in cells]) / scale
    assert (margins <= least + 1e-12).all()
    assert (margins > 0).any()
    assert (margins < 0).any()
    assert (quality(mesh, reference).status[margins > 0] == VALID).all()


@pytest.mark.parametrize("kind", ["tri", "quad"])
def test_it_is_one_where_nothing_changed_and_continuous_where_a_cell_folds(kind):
    _, mesh = shaken_mesh(kind, 2)
    assert (cell_margins(mesh, mesh) == 1).all()
    assert smooth_margin(mesh, mesh, 1e6).value == pytest.approx(1.0, abs=1e-4)
    node = int(np.linalg.norm(mesh.points - 0.5, axis=1).argmin())

    def at(part):
        points = mesh.points.copy()
        points[node, 0] += part * 0.25
        return smooth_margin(mesh.with_points(points), mesh, 30.0).value

    values = np.array([at(part) for part in np.linspace(0.9, 1.1, 201)])
    assert values[0] > 0 > values[-1]
    assert np.abs(np.diff(values)).max() < 0.01


def test_cells_numbered_the_other_way_round_and_a_halo(tmp_path):
    moved, mesh = shaken_mesh("hex", 3)
    flipped = [each.with_points(each.points * (1, 1, -1)) for each in (moved, mesh)]
    one, other = smooth_margin(moved, mesh), smooth_margin(*flipped)
    assert one.value == pytest.approx(other.value, rel=1e-12)
    np.testing.assert_allclose(one.of_points, other.of_points * (1, 1, -1), atol=1e-12)
    path = tmp_path / "halo.su2"
    shift = np.array([[0, 0, 0], [0, 0, 0], [0, -1.0, 0]])
    path.write_text(halo_text(grid((4, 4)), "y_m", "y_p", shift))
    halo = read(path)
    points = halo.points.copy()
    outer = np.setdiff1d(np.arange(len(points)), halo.cells.take(~halo.halo.cells).connectivity)
    points[outer] = 0.0  # cells of the halo fold
    assert cell_margins(halo.with_points(points), halo).min() < 0
    assert smooth_margin(halo.with_points(points), halo).value > 0.5


def test_what_cannot_be_a_margin_is_told():
    moved, mesh = shaken_mesh("quad", 2)
    with pytest.raises(CaseError, match=r"exponent of the smooth minimum is p = 0.5; give"):
        smooth_margin(moved, mesh, 0.5)
    flat = mesh.with_points(mesh.points * (1, 0))
    with pytest.raises(MeshError, match="cell 0 of the undeformed mesh has no positive volume"):
        cell_margins(moved, flat)


def test_bits_do_not_depend_on_the_number_of_threads(monkeypatch):
    monkeypatch.setattr("slideviz.mesh.quality_derivative.PART", 4)
    mesh = grid((5, 4, 3))
    rng = np.random.default_rng(3)
    moved = mesh.with_points(mesh.points + rng.uniform(-0.2, 0.2, mesh.points.shape))
    ran = set()

    def seen(work, blocks):
        ran.add(len(blocks))
        return ordered_map(work, blocks)

    monkeypatch.setattr("slideviz.mesh.quality_derivative.ordered_map", seen)
    found = []
    for threads in (1, 2, 4):
        monkeypatch.setattr("slideviz.system.threads.cores", lambda threads=threads: threads)
        one = smooth_margin(moved, mesh)
        found.append((one.value, one.of_points.tobytes(), cell_margins(moved, mesh).tobytes()))
    assert found[0] == found[1] == found[2]
    assert ran == {15}, "it works on all cores"
