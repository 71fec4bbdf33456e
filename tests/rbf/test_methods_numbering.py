"""The numbers of nodes and cells decide nothing, not even on meshes where much is equally near."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Scale, Translate
from slideviz.rbf.classify import FansAround, _clusters
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.evaluate import Basis, no_tick
from slideviz.rbf.level import TIE, tie_breaker
from slideviz.rbf.methods import correct, correction_of
from slideviz.rbf.problem import Problem
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import sample
from tests import builders
from tests.test_laws import METHODS

CHOICES = {
    "all": None,
    "block": Reduction(relative=1e-2),
    "double": Reduction(relative=1e-2, selection="double"),
    "one": Reduction(relative=1e-2, selection="one"),
    "levels by size": Reduction(relative=3e-3, multilevel=True, level_size=4, selection="double"),
    "levels by error": Reduction(relative=3e-3, multilevel=True, criterion="tol"),
}
MESHES = {
    "square": lambda: builders.square(8),
    "mixed": lambda: builders.square(8, "mixed"),
    "cube": lambda: builders.cube(4),
    "sector": lambda: builders.sector(8),
    "passage": lambda: builders.passage((3, 4, 4)),
    "square sample": lambda: sample("square", 9, "motion").mesh,
    "hexahedron sample": lambda: sample("hexahedron", 5, "motion").mesh,
}
PAIRS = [("y_m", "y_p"), ("per1", "per2"), ("LOWER", "UPPER")]


def last_points(case, mesh):
    *_, last = sv.deform(case, mesh)
    return last.mesh.points


def case_on(mesh, way, motion, **others):
    names = mesh.marker_names
    pair = next(pair for pair in PAIRS if pair[0] in names)
    moving = "BLOCK" if "BLOCK" in names else "blade"
    roles = dict.fromkeys(names, "sliding") | dict.fromkeys(pair, "periodic") | {moving: "moving"}
    made = (
        Scale(moving, (0.9,)) if motion == "scale" else Translate(moving, (0.05, 0, 0)[: mesh.dim])
    )
    return Case(roles=roles, motions=(made,), sliding=way[0], periodic=way[1], **others)


@settings(max_examples=15, deadline=None)
@given(
    name=st.sampled_from(list(MESHES)),
    method=st.sampled_from(list(METHODS)),
    choice=st.sampled_from(list(CHOICES)),
    motion=st.sampled_from(["scale", "shift"]),
    seed=st.integers(0, 99),
)
@example(name="square", method=("none", "none"), choice="one", motion="scale", seed=0)
@example(name="square", method=("ds", "periodic"), choice="block", motion="scale", seed=0)
@example(name="cube", method=("none", "fixed"), choice="block", motion="scale", seed=0)
@example(name="passage", method=("ps", "moving"), choice="double", motion="shift", seed=0)
@example(name="passage", method=("ds", "fixed"), choice="one", motion="scale", seed=0)
def test_another_numbering_gives_the_same_mesh(name, method, choice, motion, seed):
    mesh = MESHES[name]()
    case = case_on(mesh, method, motion, reduction=CHOICES[choice], steps=2)
    order, other = builders.shuffled(mesh, seed)
    found = last_points(case, other)
    np.testing.assert_allclose(found, last_points(case, mesh)[order], rtol=0, atol=1e-10)


@pytest.mark.parametrize(("method", "near"), [("idw", 1e-13), ("elastic", 1e-7)])
@pytest.mark.parametrize("name", ["square", "passage"])
def test_another_numbering_gives_the_same_mesh_with_the_other_methods(name, method, near):
    mesh = MESHES[name]()
    case = case_on(mesh, ("ps", "moving"), "scale", method=method, steps=2)
    order, other = builders.shuffled(mesh, 0)
    found = last_points(case, other)
    np.testing.assert_allclose(found, last_points(case, mesh)[order], rtol=0, atol=near)


def problem_of(points, same_as=None, shift=(0.0, 0.0)):
    """A problem with nothing but what the correction looks at."""
    none = np.empty(0, np.int64)
    return Problem(
        basis=Basis(1.0),
        features=points.T,
        known=none,
        values=np.empty((0, 2)),
        edge=none,
        surface=none,
        normal_nodes=none,
        normals=np.empty((0, 2)),
        same_as=np.arange(len(points)) if same_as is None else np.array(same_as),
        project=lambda _, free: free,
        curved=False,
        cartesian=lambda coords: coords,
        coords=points,
        shift=np.array(shift),
        reduction=Reduction(1.0, gamma=4.0),
    )


def corrected(problem, nodes, errors):
    out = np.zeros_like(problem.coords)
    correction = correction_of(problem, np.array(nodes), np.array(errors))
    correct(problem, out, np.array(nodes), correction, no_tick)
    return out


def test_the_correction_is_the_mean_of_what_is_equally_near():
    points = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [-0.5, 0.0]])
    found = corrected(problem_of(points), [0, 1, 2], [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.9]])
    share = 0.75**4 * 2.0
    np.testing.assert_allclose(found[3], [0.0, 0.3 * share], rtol=0, atol=1e-15)
    nearer = 0.5 / 4.0
    np.testing.assert_allclose(found[4], [(1 - nearer) ** 4 * (1 + 4 * nearer), 0.0], rtol=1e-15)


def test_the_correction_does_not_jump_where_the_nearest_node_changes():
    step = np.linspace(-2e-4, 2e-4, 4001)
    points = np.concatenate([[[-1.0, 0.0], [1.0, 0.0]], np.stack([step, 0 * step], axis=1)])
    found = corrected(problem_of(points), [0, 1], [[1.0, 0.0], [-1.0, 0.0]])[2:, 0]
    assert found[0] > 0.6
    assert found[-1] < -0.6
    assert np.abs(np.diff(found)).max() < 0.01


def test_images_and_coinciding_nodes_count_once_in_the_correction():
    """The node at 1 is the image of that at 0: the mean is not in favour of what has images."""
    points = np.array(
        [[0.0, 0.0], [1.0, 0.0], [0.25, 0.25], [0.25, 0.25], [0.0, 0.25], [1.0, 0.25]]
    )
    problem = problem_of(points, [0, 0, 2, 2, 4, 5], (1.0, 0.0))
    found = corrected(problem, [0, 1, 2, 3], [[0.2, 0.0]] * 2 + [[0.0, 0.2]] * 2)
    assert found[4, 0] == pytest.approx(found[4, 1])
    np.testing.assert_allclose(found[5], found[4], rtol=1e-14)


def test_closest_points_do_not_depend_on_the_order_of_the_facets():
    corner = np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]])
    many = np.concatenate([corner, corner - 2.0, corner + 2.0])
    for order in permutations(range(len(many))):
        found = ClosestPoints(many[list(order)]).query(np.array([[0.5, 0.5]]))
        np.testing.assert_array_equal(found, [[0.0, 0.5]])


def test_fans_are_joined_over_others_between_them_in_any_order():
    angles = np.radians([0.0, 8.0, 16.0, 90.0])
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    roles = np.array(["sliding"] * 4, object)
    merge, one = np.cos(np.radians(10.0)), np.zeros(4, np.int64)
    around = FansAround(one, one, roles, normals, merge, merge)
    for order in permutations(range(4)):
        labels = _clusters(around, np.array(order), np.array([4]))
        assert sorted(np.bincount(labels)) == [1, 3]


@pytest.mark.parametrize("dim", [2, 3])
def test_no_two_points_of_a_grid_are_favoured_alike(dim):
    points = np.stack(np.meshgrid(*[np.arange(6.0)] * dim), axis=-1).reshape(-1, dim)
    assert np.diff(np.sort(tie_breaker(points))).min() > 1e-4 * TIE
