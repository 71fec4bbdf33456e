"""Derivatives of deformations: dot products, and central differences of the frozen map."""

from __future__ import annotations

import itertools
import lzma
import pickle
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.design import frozen_step
from slideviz.errors import CaseError
from slideviz.mesh.axis_frame import axis_basis
from slideviz.rbf.methods import SLIDING_METHODS
from slideviz.rbf.reduction import Reduction
from slideviz.terms import SLIDING
from tests import builders
from tests.slow import one_of_each_fast
from tests.test_halo import MESHES, both, case_of
from tests.test_laws import METHODS, box, box_case, sector, sector_case

SHARED = Path(__file__).parents[2] / ".." / "shared" / "meshes" / "design"
pytestmark = pytest.mark.filterwarnings("ignore::slideviz.errors.ToleranceWarning")
REDUCED = Reduction(tolerance=1e-3)


def motions(mesh, marker):
    return (Translate(marker, (0.04, -0.03, 0.015)[: mesh.dim]), Rotate(marker, 2.0))


def wave(points):
    """A smooth direction that is not alike anywhere."""
    x, y = points[:, 0], points[:, -1]
    rows = [np.sin(3 * x + k) + np.cos(2 * y - k) * points[:, 1] for k in range(points.shape[1])]
    return np.stack(rows, axis=1)


def alike(deformer, vectors):
    """The vectors with those of images and copies as the mesh repeats."""
    setup, mesh, out = deformer._setup, deformer.mesh, vectors.copy()
    row = {node: k for k, node in enumerate(deformer.nodes.tolist())}
    if mesh.halo is not None:
        halo = mesh.halo
        for copy, origin, turn in zip(halo.receivers, halo.donors, halo.rotations, strict=True):
            if int(copy) in row:
                out[row[int(copy)]] = turn @ out[row[int(origin)]]
        return out
    first: dict[int, int] = {}
    for k, node in enumerate(deformer.nodes.tolist()):
        other = first.setdefault(int(setup.classes.representative[node]), k)
        turn = np.eye(mesh.dim)
        if setup.frame.cylindrical:
            apart = setup.coords[node, 1] - setup.coords[deformer.nodes[other], 1]
            c, s = np.cos(apart / setup.frame.radius), np.sin(apart / setup.frame.radius)
            basis = axis_basis(setup.frame.axis)[:, : mesh.dim]
            turn = basis.T @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ basis
        out[k] = turn @ out[other]
    return out


def check(case, mesh, agree=2e-12):
    """Both checks at a design that is not the reference, and the result at the reference."""
    deformer = sv.Deformer(mesh, case)
    *_, last = sv.deform(case, mesh)
    np.testing.assert_allclose(deformer.deform(), last.mesh.points, rtol=0, atol=agree)
    rng = np.random.default_rng(1)
    design = alike(deformer, 1.1 * deformer.displacement)
    direction = alike(deformer, wave(mesh.points[deformer.nodes]))
    weights = rng.standard_normal(mesh.points.shape)
    forward, reverse = deformer.jvp(design, direction), deformer.vjp(design, weights)
    gap = abs((weights * forward).sum() - (reverse * direction).sum())
    assert gap <= 1e-11 * np.abs(weights * forward).sum()
    step = 1e-5 * mesh.extent
    ahead, behind = (deformer.deform(design + s * direction) for s in (step, -step))
    change = (ahead - behind) / (2 * step)
    np.testing.assert_allclose(forward, change, rtol=0, atol=1e-6 * np.abs(change).max())
    return deformer


def table():
    """Every method, periodicity, dimension, number of steps, with and without data reduction.

    Each method and periodicity is among the fast ones, with the rest in turn.
    """
    frames = ("cartesian", "translational", "rotational")
    cells = itertools.product(frames, METHODS, (2, 3), (1, 5), (None, REDUCED))
    rows = []
    for k, (frame, method, dim, steps, reduction) in enumerate(cells):
        if frame == "cartesian" and method[1] != "none":
            continue
        fast = (dim, steps, reduction is None) == (
            2 + k // 8 % 2 * (steps == 1),
            (1, 5)[k // 8 % 2 == 0],
            k // 16 % 2 == 0,
        )
        name = f"{frame}-{'-'.join(method)}-{dim}d-{steps}-{'reduced' if reduction else 'exact'}"
        marks = () if fast else pytest.mark.slow
        rows.append(pytest.param(frame, method, dim, steps, reduction, id=name, marks=marks))
    return rows


@pytest.mark.parametrize(("frame", "method", "dim", "steps", "reduction"), table())
def test_flat_boundaries(frame, method, dim, steps, reduction):
    settings = {"steps": steps, "reduction": reduction}
    if frame == "rotational":
        mesh = sector(dim)
        motion = motions(mesh, "BLOCK" if dim == 2 else "blade")
        check(sector_case(mesh, method, motion, **settings), mesh)
    else:
        mesh = box(dim)
        check(box_case(mesh, method, motions(mesh, "BLOCK"), **settings), mesh)


def check_relaxed(case, mesh):
    """As ``check``, of a deformer that relaxes; every design alone gives the bits of several."""
    deformer = check(case.change(relax="yes"), mesh, 1e-2)
    designs = np.stack([deformer.displacement, 0.7 * deformer.displacement])
    np.testing.assert_array_equal(
        pickle.loads(pickle.dumps(deformer)).deform(designs),
        np.stack([deformer.deform(each) for each in designs]),
    )
    return deformer


def relaxed_table():
    """Every frame, dimension and way of sliding, with one step and three, and with layers."""
    frames, ways = ("cartesian", "translational", "rotational"), ("none", "ps", "ds")
    several = {"none": "periodic", "ps": "fixed", "ds": "moving"}
    rows = []
    for k, cell in enumerate(itertools.product(frames, ways, (2, 3), (1, 3), ("no", "keep"))):
        frame, sliding, dim, steps, layers = cell
        method = sliding, "none" if frame == "cartesian" else several[sliding]
        reduction = REDUCED if (k // 2 + k // 4) % 2 else None
        marks = () if k % 13 == 4 else pytest.mark.slow
        name = "-".join([frame, *method, f"{dim}d", str(steps), layers])
        row = frame, dim, method, steps, layers, reduction
        rows.append(pytest.param(*row, id=name, marks=marks))
    return rows


@pytest.mark.parametrize(
    ("frame", "dim", "method", "steps", "layers", "reduction"), relaxed_table()
)
def test_relaxation(frame, dim, method, steps, layers, reduction):
    settings = {"steps": steps, "reduction": reduction, "layers": layers}
    if layers == "keep":
        settings["layer_thickness"] = 0.15
    mesh = sector(dim) if frame == "rotational" else box(dim)
    make = sector_case if frame == "rotational" else box_case
    marker = "blade" if (frame, dim) == ("rotational", 3) else "BLOCK"
    check_relaxed(make(mesh, method, motions(mesh, marker), **settings), mesh)


def annulus():
    mesh = builders.annulus(24, 5, 2)
    roles = {"wall": "moving", "far0": "sliding", "far1": "sliding"}
    return mesh, roles, (Rotate("wall", 20.0), Translate("wall", (0.05, 0.02)))


def sphere():
    mesh = builders.sphere_in_box(4, 2)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"x_p": "moving"}
    motion = (Translate("x_p", (0.1, 0.05, 0.02)), Rotate("x_p", 5.0, axis=(1.0, 0, 0)))
    return mesh, roles, motion


def bent_passage():
    mesh = builders.passage((3, 4, 4), 60.0)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"blade": "moving"}
    return mesh, roles, motions(mesh, "blade")


def pushed_inflow():
    """Along the axis at the reference: there no direction of a wall has more than one block."""
    mesh = builders.passage((3, 4, 4), 60.0)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"inflow": "moving"}
    return mesh, roles, (Translate("inflow", (0.0, 0.0, 0.05)),)


def on_axis():
    mesh = builders.wedge(6)
    roles = {"BLOCK": "moving", "outer": "sliding", "per1": "periodic", "per2": "periodic"}
    return mesh, roles, motions(mesh, "BLOCK")


def plate():
    mesh = builders.plate(8)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"below": "moving", "above": "moving"}
    return mesh, roles, (Translate("", (0.03, 0.04)), Rotate(("below", "above"), 8.0))


SHAPES = {f.__name__: f for f in (annulus, sphere, bent_passage, pushed_inflow, on_axis, plate)}


@pytest.mark.parametrize("reduction", [None, REDUCED], ids=["exact", "reduced"])
@pytest.mark.parametrize("steps", [1, pytest.param(5, marks=pytest.mark.slow)])
@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.parametrize("shape", SHAPES)
def test_curved_boundaries_nodes_on_the_axis_and_coinciding_ones(shape, sliding, steps, reduction):
    mesh, roles, motion = SHAPES[shape]()
    case = Case(roles=roles, motions=motion, sliding=sliding, steps=steps, reduction=reduction)
    if shape == "on_axis":
        case = case.change(periodic="moving", periodic_type="rotational")
    check(case, mesh)


@pytest.mark.parametrize("shape", ["annulus", "sphere", "bent_passage", "pushed_inflow"])
def test_curved_boundaries_in_several_steps(shape):
    mesh, roles, motion = SHAPES[shape]()
    check(Case(roles=roles, motions=motion, sliding="ds", steps=3), mesh)


@pytest.mark.parametrize(
    ("steps", "sliding"), [(2, "ds"), pytest.param(1, "ps", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "shape",
    [pytest.param(s, marks=() if s == "on_axis" else pytest.mark.slow) for s in SHAPES],
)
def test_relaxation_with_curved_boundaries(shape, steps, sliding):
    mesh, roles, motion = SHAPES[shape]()
    case = Case(roles=roles, motions=motion, sliding=sliding, steps=steps)
    if shape == "on_axis":
        case = case.change(periodic="moving", periodic_type="rotational")
    check_relaxed(case, mesh)


@pytest.mark.parametrize(("name", "layers"), one_of_each_fast(list(MESHES), ["no", "keep"]))
def test_relaxation_with_halo_layers(tmp_path, name, layers):
    mesh, _, roles = both(name, tmp_path)
    case = case_of(mesh, roles, 0.05, sliding="ds", periodic="moving", steps=2)
    if layers == "keep":
        case = case.change(layers="keep", layer_thickness=0.1)
    check_relaxed(case, mesh)


def test_relaxation_of_a_severe_motion():
    mesh = builders.airfoil(40, 10, 1e-3)
    motion = (Rotate("airfoil", 60.0, (0.5, 0.0)), Translate("airfoil", (0.02, 0.1)))
    check_relaxed(Case(roles={"airfoil": "moving"}, motions=motion), mesh)


def test_a_deformer_made_at_rest_relaxes():
    mesh = builders.airfoil(40, 10, 1e-3)
    case = Case(roles={"airfoil": "moving"}, motions=(Rotate("airfoil", 10.0, (0.5, 0.0)),))
    turned = sv.Deformer(mesh, case).displacement
    designs = np.stack([0.0 * turned, turned])
    plain, relaxed = (
        sv.Deformer(mesh, case.change(relax=relax), designs) for relax in ("no", "auto")
    )
    np.testing.assert_allclose(relaxed.deform(designs[0]), mesh.points, rtol=0, atol=1e-12)
    *_, run = sv.deform(case.change(relax="yes"), mesh)
    gaps = [np.abs(each.deform(turned) - run.mesh.points).max() for each in (plain, relaxed)]
    assert gaps[1] < 0.1 * gaps[0]
    forward = relaxed.jvp(designs[0], turned)
    change = relaxed.deform(1e-4 * turned) - relaxed.deform(-1e-4 * turned)
    np.testing.assert_allclose(forward, change / 2e-4, rtol=0, atol=1e-6)
    alone = sv.Deformer(mesh, case.change(relax="yes"), designs[0])
    np.testing.assert_allclose(alone.deform(turned), relaxed.deform(turned), rtol=0, atol=1e-12)


def test_every_way_of_sliding_has_a_function():
    assert set(SLIDING) == set(SLIDING_METHODS)


@pytest.mark.parametrize("sliding", ["ps", pytest.param("ds", marks=pytest.mark.slow)])
@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("name", MESHES)
def test_halo_layers(tmp_path, name, steps, sliding):
    mesh, _, roles = both(name, tmp_path)
    case = case_of(mesh, roles, 0.05, sliding=sliding, periodic="moving", steps=steps)
    check(case.change(reduction=REDUCED), mesh)


@pytest.mark.parametrize("reduction", [None, REDUCED], ids=["exact", "reduced"])
@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.filterwarnings("ignore:the condition number:slideviz.errors.ConditionWarning")
@pytest.mark.parametrize(
    "kernel", ["thin-plate", "multiquadric", "wendland-c0", "ctps-c1", "quadric"]
)
def test_kernels(kernel, sliding, reduction):
    mesh = builders.square(6)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    case = Case(roles=roles, motions=motions(mesh, "BLOCK"), sliding=sliding, kernel=kernel)
    check(case.change(reduction=reduction, steps=2), mesh)


@pytest.mark.parametrize("reduction", [None, REDUCED], ids=["exact", "reduced"])
@pytest.mark.parametrize("method", [("ps", "moving"), ("ds", "fixed"), ("none", "periodic")])
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("frame", ["translational", "rotational"])
def test_a_polynomial_with_a_definite_kernel(frame, dim, method, reduction):
    settings = {"steps": 2, "reduction": reduction, "polynomial": "yes"}
    if frame == "rotational":
        mesh = sector(dim)
        check(
            sector_case(mesh, method, motions(mesh, "BLOCK" if dim == 2 else "blade"), **settings),
            mesh,
        )
    else:
        mesh = box(dim)
        check(box_case(mesh, method, motions(mesh, "BLOCK"), **settings), mesh)


def test_a_polynomial_over_a_nearly_singular_system():
    """Refined systems, and a motion that is linear: the polynomial alone moves all nodes."""
    mesh = builders.square(6)
    roles = dict.fromkeys(mesh.marker_names, "moving")
    case = Case(roles=roles, motions=(Scale("", (1.1, 1.2)),), kernel="wendland-c6")
    deformer = check(case.change(influence_factor=8.0, polynomial="yes"), mesh)
    expected = (mesh.points - mesh.points.mean(axis=0)) * (0.1, 0.2)
    moved = deformer.deform() - mesh.points
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("sliding", ["ps", "ds"])
@pytest.mark.parametrize("criterion", ["size", "tol"])
@pytest.mark.parametrize("steps", [1, 3])
def test_levels(steps, criterion, sliding):
    mesh = builders.square(6)
    roles = dict.fromkeys(mesh.marker_names, "sliding") | {"BLOCK": "moving"}
    case = Case(roles=roles, motions=motions(mesh, "BLOCK"), sliding=sliding, steps=steps)
    levels = Reduction(tolerance=1e-4, multilevel=True, criterion=criterion, level_size=8)
    check(case.change(reduction=levels), mesh)


@pytest.mark.parametrize("method", ["elastic", "idw"])
def test_methods_without_derivatives_are_refused(method):
    mesh, roles, motion = annulus()
    case = Case(roles=roles, motions=motion, method=method)
    with pytest.raises(CaseError, match=f"METHOD= {method} has no derivatives"):
        sv.Deformer(mesh, case)


def test_dropped_nodes_of_a_boundary_layer():
    """Cells of 1e-6 at a wall that moves with the nodes above it: the pivot guard drops some."""
    mesh = builders.layered(8, 1e-6)
    roles = {"y_m": "moving", "x_m": "sliding", "x_p": "sliding", "y_p": "fixed"}
    case = Case(roles=roles, motions=(Translate("y_m", (0.0, 0.05)),), sliding="ps")
    deformer = sv.Deformer(mesh, case.change(reduction=REDUCED))
    up = np.tile([0.0, 1.0], (len(deformer.nodes), 1))
    design = 1.2 * deformer.displacement
    forward = deformer.jvp(design, up)
    weights = np.random.default_rng(0).standard_normal(forward.shape)
    there, back = (weights * forward).sum(), (deformer.vjp(design, weights) * up).sum()
    assert there == pytest.approx(back, rel=1e-11)


@pytest.mark.skipif(not SHARED.exists(), reason="needs meshes that are not in the repository")
@pytest.mark.parametrize(
    ("sliding", "reduction"), one_of_each_fast(["ps", "ds"], [Reduction(relative=1e-6), None])
)
def test_a_step_along_the_gradient_changes_a_real_objective_as_predicted(
    tmp_path, sliding, reduction
):
    """The heat exchanger among SU2's cases, with the sensitivities of its adjoint solution."""
    for name in ("burner_hx.su2", "solution_adj_custom.csv"):
        (tmp_path / name).write_bytes(lzma.decompress((SHARED / f"{name}.xz").read_bytes()))
    mesh = sv.read(tmp_path / "burner_hx.su2")
    with (tmp_path / "solution_adj_custom.csv").open() as lines:
        heading = next(lines).replace('"', "").strip().split(",")
        numbers = np.loadtxt(lines, delimiter=",")
    columns = [heading.index(f"Sensitivity_{axis}") for axis in "xy"]
    sensitivity = numbers[np.argsort(numbers[:, 0])][:, columns]
    sides = ("symmetry_xm", "symmetry_xp", "outlet")
    roles = {"wall_hx": "moving"} | dict.fromkeys(sides, "sliding")
    x = mesh.points[mesh.marker("wall_hx").nodes][:, 0]
    place = np.pi * (x - x.min()) / np.ptp(x)
    # The shape of the pipe's wall: waves that vanish at its ends.
    modes = np.stack([np.outer(np.sin(k * place), [0.0, 1.0]) for k in range(1, 6)])
    largest = 1e-3 * np.ptp(x)
    case = Case(roles=roles, sliding=sliding, reduction=reduction, steps=2)
    deformer = sv.Deformer(mesh, case, displacements=largest * modes)
    start = np.zeros(modes.shape[1:])
    gradient = np.einsum("kmd,md->k", modes, deformer.vjp(start, sensitivity))
    step = np.einsum("k,kmd->md", gradient, modes)
    step *= largest / np.abs(step).max()
    change = (sensitivity * (deformer.deform(step) - mesh.points)).sum()
    predicted = (deformer.vjp(start, sensitivity) * step).sum()
    assert predicted > 0.0
    assert change == pytest.approx(predicted, rel=0.02)
    halfway = (deformer.vjp(step / 2, sensitivity) * step).sum()
    assert change == pytest.approx(halfway, rel=1e-4)


@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_points_and_derivatives_at_one_design_share_its_factors(monkeypatch, sliding):
    mesh, roles, motion = bent_passage()
    case = Case(roles=roles, motions=motion, sliding=sliding, steps=3)
    deformer, other = sv.Deformer(mesh, case), sv.Deformer(mesh, case)
    design = 1.1 * deformer.displacement
    weights = np.cos(mesh.points)
    calls: list[int] = []
    extend = frozen_step.extend
    monkeypatch.setattr(frozen_step, "extend", lambda *rest: calls.append(1) or extend(*rest))
    other.deform(0.9 * design)
    calls.clear()
    points = deformer.deform(design)
    assert len(calls) >= 2
    calls.clear()
    forward, back = deformer.jvp(design, design), deformer.vjp(design, weights)
    assert not calls
    assert forward.tobytes() == other.jvp(design, design).tobytes()
    assert calls
    assert points.tobytes() == other.deform(design).tobytes()
    assert back.tobytes() == other.vjp(design, weights).tobytes()
