"""Boundaries laid onto surfaces of which the answer is known."""

import meshio
import numpy as np
import pytest

import slideviz as sv
from slideviz.case.moving_nodes import displacements
from slideviz.mesh.topology import facet_vectors
from slideviz.samples.stator import CHORD, LEADING_EDGE, RADII, STACK
from slideviz.samples.table import sample, sample_case
from tests.builders import airfoil, sphere_in_box

SLIDING = sample_case("stator").roles | {"HUB": "sliding", "SHROUD": "sliding"}
MIDDLE = 0.5 * (RADII[0] + RADII[-1])


def stator_onto(path):
    """The case in which a stator's blade goes to a target, along hub and shroud."""
    return sample_case("stator").change(roles=SLIDING, motions=(sv.Onto(path, "BLADE"),))


def reshaped(points):
    """The blade twisted by 5 degrees, leaned and 3 % longer, at the same radii."""
    r, theta = np.hypot(*points.T[:2]), np.arctan2(points[:, 1], points[:, 0])
    span = (r - RADII[0]) / (RADII[-1] - RADII[0])
    stack = LEADING_EDGE + STACK * CHORD
    z, arc = 1.03 * (points[:, 2] - stack), 1.03 * r * theta
    turn = np.radians(5.0) * span
    z, arc = np.cos(turn) * z - np.sin(turn) * arc, np.sin(turn) * z + np.cos(turn) * arc
    angle = arc / r + np.radians(1.3) * np.sin(0.5 * np.pi * span)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z + stack], axis=1)


def blade(mesh):
    """The nodes of a stator's blade, and its quadrilaterals by their places among these."""
    quads = mesh.marker("BLADE").cells.by_type[9][1]
    nodes = np.unique(quads)
    return nodes, np.searchsorted(nodes, quads)


def write_target(path, points, quads, noise=0.0):
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    random = np.random.default_rng(4)
    points = points + noise * CHORD * random.standard_normal(points.shape)
    meshio.write(path, meshio.Mesh(points, [("triangle", triangles)]), binary=True)
    return points[triangles]


def far(points, triangles):
    from slideviz.rbf.closest import ClosestPoints

    return np.linalg.norm(ClosestPoints(triangles).query(points) - points, axis=1).max() / CHORD


@pytest.fixture(scope="module")
def stators():
    return sample("stator", 16_000).mesh, sample("stator", 10_000).mesh


@pytest.mark.parametrize(("noise", "height"), [(0.0, 1.1), (0.0, 1.0), (0.0, 0.999), (1e-3, 1.0)])
def test_a_blade_is_laid_onto_itself_turned_bent_and_longer(noise, height, stators, tmp_path):
    source, other = stators
    nodes, quads = blade(other)
    r = np.hypot(*other.points[nodes].T[:2])
    target = reshaped(other.points[nodes])
    target[:, :2] *= ((MIDDLE + height * (r - MIDDLE)) / r)[:, None]
    path = tmp_path / "target.stl"
    triangles = write_target(path, target, quads, noise)
    nodes, quads = blade(source)
    points, true = source.points[nodes], reshaped(source.points[nodes])
    assert far(points, triangles) > 0.15
    case = stator_onto(path)
    laid = displacements(case, source)
    moved = points + laid.at(nodes)
    rim = np.isin(nodes, np.concatenate([source.marker(n).nodes for n in ("HUB", "SHROUD")]))
    # The rim stays on hub and shroud, also where the target ends before them.
    off = np.hypot(*moved[rim].T[:2]) - np.hypot(*points[rim].T[:2])
    assert np.abs(off).max() / CHORD < 1e-10
    beyond = max(1.0 - height, 0.0) * (RADII[-1] - RADII[0]) / CHORD
    assert far(moved[~rim], triangles) < 1e-5
    # The target's facets are coarse: their rims are not round.
    allowed = 1e-5 if height > 1.0 else 2e-3 if noise else 1e-4 + beyond
    assert far(moved[rim], triangles) < allowed
    assert "its rim stays on HUB and SHROUD, at most" in str(laid.warnings[0])
    areas, wanted = (facet_vectors(x, quads) for x in (moved, true))
    assert (np.einsum("fd,fd->f", areas, wanted) > 0.0).all()
    share = np.linalg.norm(areas, axis=1) / np.linalg.norm(wanted, axis=1)
    if not noise:
        assert share.min() > 0.8
        assert share.max() < 1.2
        assert np.linalg.norm(moved - true, axis=1).max() / CHORD < 0.03
        last = list(sv.deform(case, source))[-1]
        quality = sv.quality(last.mesh, reference=source)
        assert quality.inverted == 0
        assert quality.min > 0.65  # 0.83 by the true motion; rims off the wall by 5e-4 chords 0.36


def test_the_reverse_is_the_same_motion(stators, tmp_path):
    _, mesh = stators
    nodes, quads = blade(mesh)
    write_target(tmp_path / "hot.stl", reshaped(mesh.points[nodes]), quads)
    case = stator_onto(tmp_path / "hot.stl")
    built = list(sv.deform(case, mesh))[-1].mesh
    sv.write(tmp_path / "cold.su2", mesh)
    case = stator_onto(tmp_path / "cold.su2")
    laid = displacements(case, built)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    assert far(built.points[nodes] + laid.at(nodes), mesh.points[nodes][triangles]) < 1e-4
    assert laid.warnings[0].report["distance"] < 1e-4 * CHORD


def test_a_sharp_trailing_edge_meets_the_one_of_the_target(tmp_path):
    mesh, fine = airfoil(40), airfoil(64)
    turn = np.radians(8.0)
    matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])

    def bent(points):
        x, y = points.T
        return np.stack([1.05 * x, y + 0.1 * x * (1.0 - x)], axis=1) @ matrix.T

    near = np.hypot(*(fine.points - [0.5, 0.0]).T) < 2.0
    sv.write(
        tmp_path / "target.su2",
        fine.with_points(np.where(near[:, None], bent(fine.points), fine.points)),
    )
    case = sv.Case(
        roles={"airfoil": "moving"}, motions=(sv.Onto(tmp_path / "target.su2", "airfoil"),)
    )
    nodes = mesh.marker("airfoil").nodes
    moved = mesh.points[nodes] + displacements(case, mesh).at(nodes)
    tail = np.argmax(mesh.points[nodes, 0])
    assert moved[tail] == pytest.approx(bent(mesh.points[nodes[tail]][None])[0], abs=1e-9)
    assert np.linalg.norm(moved - bent(mesh.points[nodes]), axis=1).max() < 0.03


def test_a_closed_surface_has_no_rim(tmp_path):
    mesh, fine = sphere_in_box(6), sphere_in_box(10)
    target = fine.points * [1.3, 1.0, 0.9] + [0.1, 0.05, 0.0]
    quads = fine.marker("sphere").cells.by_type[9][1]
    write_target(tmp_path / "target.stl", target, quads)
    case = sv.Case(
        roles={"sphere": "moving"}, motions=(sv.Onto(tmp_path / "target.stl", "sphere"),)
    )
    last = list(sv.deform(case, mesh))[-1]
    nodes = mesh.marker("sphere").nodes
    x = (last.mesh.points[nodes] - [0.1, 0.05, 0.0]) / [1.3, 1.0, 0.9]
    assert np.hypot(np.hypot(*x.T[:2]), x[:, 2]) == pytest.approx(0.4, rel=0.02)
    assert sv.quality(last.mesh, reference=mesh).inverted == 0
