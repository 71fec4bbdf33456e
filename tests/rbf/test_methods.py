"""One step of each method against the literal systems of the thesis, in every frame.

Which node slides where is known from the grid, not from the code under test.
"""

from __future__ import annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.errors import DeformError
from slideviz.rbf.constraint_rows import merge
from slideviz.rbf.evaluate import Basis
from slideviz.rbf.methods import SLIDING_METHODS
from slideviz.rbf.problem import PhaseTimer, Problem
from tests import builders
from tests.oracles import radial, sliding

PERIODIC = [
    (method, periodic)
    for method in ("none", "ps", "ds")
    for periodic in ("periodic", "fixed", "moving")
    if (method, periodic) != ("none", "moving")
]
SIDES = ("x_m", "x_p", "y_m", "y_p", "z_m", "z_p")


def turn(dim, seed=4):
    """A rotation matrix that leaves no axis alone."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(dim, dim)))
    return q * np.sign(np.linalg.det(q))


def box_case(dim, method, periodic, across=1):
    sides = SIDES[: 2 * dim]
    roles = dict.fromkeys(sides, "sliding")
    if periodic is not None:
        roles |= dict.fromkeys(sides[2 * across : 2 * across + 2], "periodic")
    shift = (0.1, -0.07, 0.05)[:dim]
    return Case(
        roles=roles | {"BLOCK": "moving"},
        motions=(Rotate("BLOCK", 20.0), Translate("BLOCK", shift)),
        sliding=method,
        periodic=periodic or "none",
        periodic_type="translational",
    )


def known_and_sliding(mesh, grid_places, n, normals_of, free=None, hold=True):
    """Known nodes, and for edge and surface nodes (position, normals): from the grid alone.

    ``free``: the periodic axis whose sides do not hold their nodes; ``hold``: keep vertices.
    """
    block = set(mesh.marker("BLOCK").nodes.tolist())
    known, edge, surface = sorted(block), [], []
    dim = grid_places.shape[1]
    for node, p in enumerate(grid_places):
        on = [a for a in range(dim) if p[a] in (0, n)]
        solid = [a for a in on if a != free]
        if node in block or not solid:
            continue
        if len(solid) == dim or (free is not None and hold and len(on) == dim):
            known.append(node)
        elif len(solid) == dim - 1:
            edge.append((node, normals_of[solid]))
        else:
            surface.append((node, normals_of[solid]))
    return known, edge, surface


@pytest.mark.parametrize(
    ("method", "periodic"), [("none", None), ("ps", None), ("ds", None), *PERIODIC]
)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("polynomial", ["no", "yes"])
def test_a_turned_box_moves_as_the_literal_system_says(polynomial, dim, method, periodic):
    n = 6 if dim == 2 else 4
    base = builders.square(n) if dim == 2 else builders.cube(n)
    places = (base.points * n).round()
    q = turn(dim)
    mesh = base.with_points(base.points @ q.T + 3.0)
    (last,) = sv.deform(box_case(dim, method, periodic).change(polynomial=polynomial), mesh)
    found = last.mesh.points - mesh.points

    free = 1 if periodic in ("fixed", "moving") else None
    known, edge, surface = known_and_sliding(mesh, places, n, q.T, free, hold=periodic == "fixed")
    values = np.zeros((len(known), dim))
    block = mesh.marker("BLOCK").nodes
    values[[known.index(b) for b in block]] = moved_block(mesh, block)
    radius = 2.5 * mesh.extent
    x, distance = mesh.points, radial.euclidean
    if periodic:
        x, distance = base.points, radial.translational(1.0, 1)

    def terms(x):
        along = 2 * np.pi * x[:, 1:2]
        repeated = [x[:, [0, *range(2, dim)]], np.cos(along), np.sin(along)] if periodic else [x]
        return np.c_[np.ones(len(x)), np.hstack(repeated)]

    if polynomial == "no":
        terms = radial.no_terms
    at = [known, [i for i, _ in edge], [i for i, _ in surface]]
    spots = [x[i] for i in at]
    pairs = [[(x[i], rows) for i, rows in level] for level in (edge, surface)]
    if method == "none":
        held = np.concatenate([values, np.zeros((len(at[1]) + len(at[2]), dim))])
        expected = radial.regular(
            x, np.concatenate([s.reshape(-1, dim) for s in spots]), held, radius, distance, terms
        )
    elif method == "ds":
        expected, _ = sliding.direct(
            x, (spots[0], values), pairs[0] + pairs[1], radius, distance, terms
        )
    else:
        expected = sliding.pseudo(x, (spots[0], values), pairs, radius, distance, terms)
    np.testing.assert_allclose(found, expected, atol=2e-9)
    np.testing.assert_allclose(np.abs(expected).max(), np.abs(values).max(), rtol=0.5)
    assert last.max_error < 1e-9


def moved_block(mesh, block):
    """Where the block of ``box_case`` goes, by hand."""
    dim = mesh.dim
    x = mesh.points[block]
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    r = np.eye(dim)
    r[:2, :2] = [[c, -s], [s, c]]
    middle = x.mean(axis=0)
    return (x - middle) @ r.T + middle + np.array((0.1, -0.07, 0.05)[:dim]) - x


@pytest.mark.parametrize(
    ("method", "periodic"), [("none", "none"), ("ps", "none"), ("ds", "none"), *PERIODIC]
)
@pytest.mark.parametrize("polynomial", ["no", "yes"])
def test_a_sector_moves_as_the_literal_system_in_polar_coordinates_says(
    polynomial, method, periodic
):
    n = 6
    mesh = builders.sector(n, 30.0)
    roles = {"inner": "sliding", "outer": "sliding", "per1": "periodic", "per2": "periodic"}
    case = Case(
        roles=roles | {"BLOCK": "moving"},
        motions=(Rotate("BLOCK", 3.0, (0.0, 0.0)),),
        sliding=method,
        periodic=periodic,
        periodic_type="rotational",
        polynomial=polynomial,
    )
    (last,) = sv.deform(case, mesh)

    def terms(x):
        r, across = x[:, 0], 12 * x[:, 1]
        if periodic == "none":
            return np.c_[np.ones(len(x)), r * np.cos(x[:, 1]), r * np.sin(x[:, 1])]
        return np.c_[np.ones(len(x)), r, np.cos(across), np.sin(across)]

    if polynomial == "no":
        terms = radial.no_terms

    def polar(points):
        return np.stack([np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])], axis=1)

    x, found = polar(mesh.points), polar(last.mesh.points) - polar(mesh.points)
    places = np.stack([(x[:, 0] - 0.5) / 0.5, x[:, 1] / np.radians(30.0)], axis=1)
    places = (places * n).round()
    free = 1 if periodic in ("fixed", "moving") else None
    known, edge, surface = known_and_sliding(
        mesh, places, n, np.eye(2), free, hold=periodic == "fixed"
    )
    assert not surface
    values = np.zeros((len(known), 2))
    block = set(mesh.marker("BLOCK").nodes.tolist())
    values[[k for k, i in enumerate(known) if i in block], 1] = np.radians(3.0)
    radius = 2.5 * mesh.extent
    distance = radial.cylindrical if periodic == "none" else radial.rotational(np.radians(30.0))
    level = [(x[i], rows) for i, rows in edge]
    if method == "none":
        held = [x[known], np.array([p for p, _ in level])]
        values = np.concatenate([values, np.zeros((len(level), 2))])
        expected = radial.regular(x, np.concatenate(held), values, radius, distance, terms)
    elif method == "ds":
        expected, _ = sliding.direct(x, (x[known], values), level, radius, distance, terms)
    else:
        expected = sliding.pseudo(x, (x[known], values), [level, []], radius, distance, terms)
    np.testing.assert_allclose(found, expected, atol=2e-9)


def test_the_coefficients_of_direct_sliding_have_no_tangential_part():
    """Eq. 2.19, for the oracle itself: it is the system that the thesis means."""
    mesh = builders.square(4)
    sides = [(mesh.points[i], np.array([[0.6, 0.8]])) for i in range(3)]
    values = np.array([[0.1, 0.2], [0.0, 0.1]])
    at = mesh.points[10:12]
    found, alpha = sliding.direct(mesh.points, (at, values), sides, 2.5)
    np.testing.assert_allclose(alpha[2:] @ [-0.8, 0.6], 0.0, atol=1e-10)
    np.testing.assert_allclose(found[:3] @ [0.6, 0.8], 0.0, atol=1e-10)
    np.testing.assert_allclose(found[10:12], values, atol=1e-10)


def problem(nodes, values, same_as, normals=None):
    x = np.random.default_rng(0).uniform(size=(2, 6))
    empty = np.empty(0, np.int64)
    return Problem(
        basis=Basis(2.0),
        features=x,
        known=np.array(nodes),
        values=np.array(values, float),
        edge=empty if normals is None else np.array([n for n, _ in normals]),
        surface=empty,
        normal_nodes=empty if normals is None else np.array([n for n, _ in normals]),
        normals=np.empty((0, 2)) if normals is None else np.array([v for _, v in normals]),
        same_as=np.array(same_as),
        project=lambda nodes, free: free,
        curved=False,
        cartesian=lambda x: x,
        coords=x.T,
        shift=np.zeros(2),
    )


SILENT = PhaseTimer(lambda phase, fraction: None)


def test_coinciding_nodes_that_agree_are_one_control_node():
    one = problem([0, 1, 2], [[1, 0], [1, 0], [0, 1]], [0, 0, 2, 3, 4, 5])
    nodes, values = merge(one, one.known, one.values)
    assert nodes.tolist() == [0, 2]
    np.testing.assert_array_equal(values, [[1, 0], [0, 1]])
    for method in SLIDING_METHODS.values():
        assert method(one, SILENT).control_nodes == 2


@pytest.mark.parametrize("method", SLIDING_METHODS)
def test_coinciding_nodes_that_disagree_are_named(method):
    one = problem([0, 1, 2], [[1, 0], [1, 0.5], [0, 1]], [0, 0, 2, 3, 4, 5], [(4, (0.0, 1.0))])
    with pytest.raises(DeformError, match=r"nodes [01] and [01] .* by 0\.5; a moving boundary"):
        SLIDING_METHODS[method](one, SILENT)


def test_a_known_node_may_not_leave_the_plane_in_which_its_image_slides():
    # Node 0 is moved off the plane in which node 1, in the same place, may slide.
    one = problem([0], [[0.0, 0.3]], [0, 0, 2, 3, 4, 5], [(1, (0.0, 1.0))])
    with pytest.raises(DeformError, match=r"nodes 1 and 0 coincide .* by 0\.3"):
        SLIDING_METHODS["ds"](one, SILENT)


def test_a_known_node_may_move_along_the_plane_in_which_its_image_slides():
    one = problem([0], [[0.3, 0.0]], [0, 0, 2, 3, 4, 5], [(1, (0.0, 1.0))])
    found = SLIDING_METHODS["ds"](one, SILENT)
    np.testing.assert_allclose(found.displacement[0], [0.3, 0.0])
    assert found.control_nodes == 1
