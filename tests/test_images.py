"""Periodic images are one node: they move alike, whatever the boundaries around each look like."""

from __future__ import annotations

import json
import lzma
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.case.moving_nodes import displacements
from slideviz.cli import run as command
from slideviz.errors import DeformError, messages_of
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.rbf.frames import make_frame
from slideviz.rbf.images import misfits
from slideviz.rbf.problem import StepSolution
from slideviz.rbf.reduction import Reduction
from slideviz.session import changes
from slideviz.session.node_types import typed_nodes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from slideviz.solver import stepping
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from slideviz.terms import NODE_TYPES
from tests import builders
from tests.slow import one_of_each_fast

SHARED = Path(__file__).parents[1] / ".." / "shared"
ROUNDING = 1e-14


def run(case, mesh):
    *_, step = sv.deform(case, mesh)
    return step


def require_alike(mesh, step, first, second):
    """Nodes of two markers, which are in the same order, keep their distance."""
    before = mesh.points[mesh.marker(second).nodes] - mesh.points[mesh.marker(first).nodes]
    points = step.mesh.points
    after = points[mesh.marker(second).nodes] - points[mesh.marker(first).nodes]
    np.testing.assert_allclose(after, before, rtol=0, atol=ROUNDING)
    assert step.periodic_misfit is not None
    assert step.periodic_misfit < ROUNDING


def half_pin(dim):
    """A channel, periodic in x, whose symmetry plane y = 0 is interrupted by half a pin."""
    hole = [(3, 5), (0, 1), (0, 3)]
    return builders.grid(
        (8, 4, 3)[:dim],
        hole[:dim],
        rules=[*builders.box_rules((8, 4, 3)[:dim])[:-1], ("pin", lambda p: True)],
    )


@pytest.mark.parametrize("amount", [1e-3, 0.06])
@pytest.mark.parametrize(
    ("method", "periodic"),
    one_of_each_fast(["ps", "ds", "reduced", "idw", "elastic"], ["periodic", "fixed", "moving"]),
)
@pytest.mark.parametrize("dim", [2, 3])
def test_what_slides_goes_on_with_what_begins_at_the_other_side(dim, method, periodic, amount):
    """Pushed out at one end, a node finds the piece that begins at the other one."""
    mesh = half_pin(dim)
    roles = dict.fromkeys(mesh.marker_names, "sliding")
    roles |= {"pin": "moving", "x_m": "periodic", "x_p": "periodic"}
    case = Case(
        roles=roles,
        motions=(Translate("pin", (amount, 0.0, 0.0)[:dim]),),
        periodic=periodic,
        sliding=method if method in ("ps", "ds") else "ps",
        method=method if method in ("idw", "elastic") else "rbf",
        reduction=Reduction(tolerance=1e-5) if method == "reduced" else None,
        steps=2,
    )
    step = run(case, mesh)
    require_alike(mesh, step, "x_m", "x_p")
    assert sv.quality(step.mesh, mesh).inverted == 0
    # Nodes that slide stay on their sides, and in the modes without displacement do the periodic.
    for axis, letter in enumerate("xyz"[:dim]):
        for side in (f"{letter}_m", f"{letter}_p"):
            if letter == "x" and periodic != "periodic":
                continue
            nodes = np.setdiff1d(mesh.marker(side).nodes, mesh.marker("pin").nodes)
            gap = step.mesh.points[nodes, axis] - mesh.points[nodes, axis]
            assert np.abs(gap).max() < 1e-13, side
    ends = mesh.marker("x_p").nodes
    slid = step.mesh.points[ends, 0] - 1.0
    if periodic == "moving":
        assert slid.min() > 0.1 * amount, "the periodic boundary goes with the pin"
    elif periodic == "fixed" and dim == 3:
        corner = np.isin(mesh.points[ends, 1:], (0.0, 1.0)).all(axis=1)
        assert not slid[corner].any()
        assert slid[~corner].max() > 0.1 * amount


@pytest.mark.parametrize("method", ["ps", "ds"])
@pytest.mark.parametrize("kind", ["plain", "simplex", "prism"])
def test_a_curved_wall_has_one_tangent_plane_at_both_periodic_sides(kind, method):
    """Triangles make the facets around a node and its image different: normals differed."""
    mesh = builders.passage((4, 6, 6), kind=kind)
    case = Case(
        roles={
            "hub": "moving",
            "shroud": "sliding",
            "per1": "sliding",
            "inflow": "periodic",
            "outflow": "periodic",
        },
        motions=(Translate("hub", (0.01, 0.003, -0.005)),),
        periodic="periodic",
        sliding=method,
    )
    step = run(case, mesh)
    inflow, outflow = (mesh.marker(name).nodes for name in ("inflow", "outflow"))
    shift = step.mesh.points - mesh.points
    order = [np.lexsort(mesh.points[nodes][:, :2].round(9).T) for nodes in (inflow, outflow)]
    np.testing.assert_allclose(
        shift[inflow[order[0]]], shift[outflow[order[1]]], rtol=0, atol=ROUNDING
    )
    assert step.periodic_misfit < ROUNDING
    assert np.abs(shift[inflow][:, :2]).max() > 1e-3


def split_wall(low, high):
    """The unit square, periodic in y, with the wall x = 0 in two markers."""
    shape = (6, 6)
    rules = [
        ("low", lambda p: bool(np.all(p[:, 0] == 0) and p[:, 1].max() <= 3)),
        ("high", lambda p: bool(np.all(p[:, 0] == 0))),
        *builders.box_rules(shape)[1:],
    ]
    roles = {"low": low, "high": high, "x_p": "sliding", "y_m": "periodic", "y_p": "periodic"}
    return builders.grid(shape, rules=rules), roles


@pytest.mark.parametrize("periodic", ["periodic", "fixed", "moving"])
@pytest.mark.parametrize("method", ["ps", "ds"])
@pytest.mark.parametrize("one", ["low", "high"])
def test_a_node_is_fixed_where_its_image_is(one, method, periodic):
    other = "high" if one == "low" else "low"
    mesh, roles = split_wall(**{one: "fixed", other: "sliding"})
    case = Case(
        roles=roles | {"x_p": "moving"},
        motions=(Translate("x_p", (0.1, 0.0)),),
        periodic=periodic,
        sliding=method,
    )
    step = run(case, mesh)
    require_alike(mesh, step, "y_m", "y_p")
    at_rest = np.flatnonzero((mesh.points[:, 0] == 0) & np.isin(mesh.points[:, 1], (0, 1)))
    assert len(at_rest) == 2
    np.testing.assert_array_equal(step.mesh.points[at_rest], mesh.points[at_rest])
    assert step.node_counts["moving"] == 7
    counted = make_setup(prepare(case, mesh)).classes
    assert set(at_rest) <= set(counted.fixed)


@pytest.mark.parametrize("method", ["ps", "ds"])
def test_a_node_moves_where_its_image_is_on_a_moving_boundary(method):
    mesh, roles = split_wall("moving", "sliding")
    case = Case(
        roles=roles,
        motions=(Translate("low", (0.0, 0.03)),),
        periodic="moving",
        sliding=method,
    )
    step = run(case, mesh)
    require_alike(mesh, step, "y_m", "y_p")
    corner = np.flatnonzero((mesh.points == [0, 1]).all(axis=1))
    np.testing.assert_allclose(step.mesh.points[corner], [[0, 1.03]], atol=ROUNDING)
    # Away from the wall that the image slides on, it may not go; nor off a wall that is fixed.
    away = case.change(motions=(Translate("low", (0.03, 0.0)),))
    with pytest.raises(DeformError, match=r"coincide .* asked to move differently, by 0\.03"):
        run(away, mesh)
    with pytest.raises(DeformError, match=r"coincide .* asked to move differently, by 0\.03"):
        run(case.change(roles=roles | {"high": "fixed"}), mesh)


def layers_beyond():
    """The unit square, periodic in y, with a layer of cells more beyond each periodic side."""
    shape = (6, 8)
    mesh = builders.grid(
        shape,
        [(2, 4), (3, 5)],
        place=lambda p: np.stack([p[:, 0] / 6, (p[:, 1] - 1) / 6], axis=1),
        rules=[rule for rule in builders.box_rules(shape) if rule[0] not in ("y_m", "y_p")],
    )
    # The outer sides of the layers are no marker: what is left for the block is inside.
    inside = [
        (5, side)
        for side in mesh.marker("BLOCK").cells.by_type[3][1]
        if np.all(np.abs(mesh.points[side, 1] - 0.5) < 0.6)
    ]
    markers = [mesh.marker("x_m"), mesh.marker("x_p")]
    markers.append(Marker("BLOCK", Cells.from_blocks([(3, np.array([s for _, s in inside]))])))
    for name, height in (("per1", 0.0), ("per2", 1.0)):
        line = np.flatnonzero(np.abs(mesh.points[:, 1] - height) < 1e-9)
        line = line[np.argsort(mesh.points[line, 0])]
        segments = np.stack([line[:-1], line[1:]], axis=1)
        markers.append(Marker(name, Cells.from_blocks([(3, segments)])))
    return Mesh(mesh.points, mesh.cells, tuple(markers))


@pytest.mark.parametrize("periodic", ["fixed", "moving"])
@pytest.mark.parametrize("method", ["ps", "ds"])
def test_boundary_nodes_beyond_a_periodic_side_move_like_their_images(method, periodic):
    mesh = layers_beyond()
    case = Case(
        roles={
            "BLOCK": "moving",
            "x_m": "sliding",
            "x_p": "sliding",
            "per1": "periodic",
            "per2": "periodic",
        },
        motions=(Translate("BLOCK", (0.02, 0.05)),),
        periodic=periodic,
        sliding=method,
    )
    step = run(case, mesh)
    shift = step.mesh.points - mesh.points
    for wall in ("x_m", "x_p"):
        nodes = mesh.marker(wall).nodes
        at = {round(6 * y): node for y, node in zip(mesh.points[nodes, 1], nodes, strict=True)}
        for low in (-1, 0, 1):
            gap = shift[at[low]] - shift[at[low + 6]]
            assert np.abs(gap).max() < ROUNDING, (wall, low)
    assert not any("nearly coincide" in text for text in step.warnings)


@pytest.mark.parametrize("build", ["square", "sector", "passage"])
def test_boundaries_go_on_by_their_period_however_far_nodes_slide(build):
    """Farther than one period, nodes were put onto the end of the boundary, two in one place."""
    roles, periodic = {"BLOCK": "moving"}, ("per1", "per2")
    if build == "square":
        mesh, periodic = builders.square(6), ("y_m", "y_p")
        roles |= dict.fromkeys(("x_m", "x_p"), "sliding")
        motion = Translate("BLOCK", (0.0, 2.3))
    elif build == "sector":
        mesh, motion = builders.sector(8), Rotate("BLOCK", 2.3 * 30.0, point=(0.0, 0.0))
        roles |= dict.fromkeys(("inner", "outer"), "sliding")
    else:
        mesh, motion = builders.passage((3, 6, 6)), Rotate("blade", 2.3 * 30.0, point=(0, 0, 0))
        roles = dict.fromkeys(("hub", "shroud", "inflow", "outflow"), "sliding")
        roles["blade"] = "moving"
    roles |= dict.fromkeys(periodic, "periodic")
    case = Case(roles=roles, motions=(motion,), sliding="ps", periodic="moving", steps=2)
    step = run(case, mesh)
    found = sv.quality(step.mesh, mesh)
    assert found.inverted == 0
    assert found.min > 0.5
    deformer = sv.Deformer(mesh, case)
    np.testing.assert_allclose(deformer.deform(), step.mesh.points, rtol=0, atol=1e-12)
    rng = np.random.default_rng(0)
    change = rng.normal(size=(len(deformer.nodes), mesh.dim))
    given = displacements(case, mesh).vectors
    ends = [deformer.deform(given + h * change) for h in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(deformer.jvp(given, change), slope, rtol=0, atol=1e-6)


# The check


def test_images_that_moved_differently_are_an_error_with_nodes_and_numbers():
    mesh, roles = split_wall("fixed", "sliding")
    case = Case(
        roles=roles | {"x_p": "moving"},
        motions=(Translate("x_p", (0.1, 0.0)),),
        periodic="moving",
        sliding="ps",
    )
    setup = make_setup(prepare(case, mesh))
    node = int(mesh.marker("y_p").nodes[-1])
    wrong = setup.target.copy()
    wrong[setup.known == node, 1] += 1e-9
    with pytest.raises(
        DeformError,
        match=rf"node {node}, now at 1\.1, 1, and its periodic image, node \d+, have moved "
        r"differently, by 1e-09; .* choose PERIODIC_MODE= none",
    ):
        next(sv.deform(case, mesh, setup=replace(setup, target=wrong)))


def test_inverted_cells_are_the_message_where_images_moved_differently_as_well():
    mesh, roles = split_wall("fixed", "sliding")
    case = Case(
        roles=roles | {"x_p": "moving"},
        motions=(Translate("x_p", (-0.9, 0.0)),),
        periodic="moving",
        sliding="ps",
    )
    setup = make_setup(prepare(case, mesh))
    wrong = setup.target.copy()
    wrong[setup.known == mesh.marker("y_p").nodes[-1], 0] += 1.0
    step = next(sv.deform(case, mesh, setup=replace(setup, target=wrong)))
    assert sv.quality(step.mesh, mesh).inverted
    assert step.periodic_misfit == pytest.approx(1.0)
    assert "have moved differently, by 1;" in step.warnings[-1]


@pytest.mark.parametrize("shift", [0.0, 1e3])
@pytest.mark.parametrize("build", [lambda: builders.square(6), lambda: builders.passage((2, 4, 6))])
def test_the_misfit_is_what_images_moved_apart(build, shift):
    mesh = build()
    names = ("per1", "per2") if mesh.dim == 3 else ("y_m", "y_p")
    offset = np.array([0.0, 0.0, shift])[-mesh.dim :]
    pair = sv.mesh.periodic.match(mesh, *names)
    frame = make_frame(mesh.points, [pair], periodic_distance=True)[0]
    coords = frame.coords(mesh.points)
    turned = coords + 0.01 * frame.shift()
    assert misfits(frame, coords, frame.points(turned), pair.nodes).max() < 1e-15
    turned[pair.nodes[3, 1]] += np.eye(mesh.dim)[-1] * 1e-3
    found = misfits(frame, coords, frame.points(turned) + offset, pair.nodes)
    assert found[3] == pytest.approx(1e-3, rel=1e-9 + 1e-9 * shift)
    assert np.delete(found, 3).max() < 1e-15 + 1e-15 * shift


def test_an_undeformed_misfit_is_no_misfit_of_the_motion():
    """Images need match to the tolerance of the pairing only; they move alike all the same."""
    mesh = builders.square(6)
    points = mesh.points.copy()
    points[mesh.marker("y_p").nodes[1:-1], 1] += 4e-6
    mesh = mesh.with_points(points)
    case = Case(
        roles=dict.fromkeys(("x_m", "x_p"), "sliding")
        | {"BLOCK": "moving", "y_m": "periodic", "y_p": "periodic"},
        motions=(Translate("BLOCK", (0.05, 0.05)),),
        sliding="ps",
    )
    for periodic in ("periodic", "fixed", "moving"):
        step = run(case.change(periodic=periodic), mesh)
        assert 0 <= step.periodic_misfit < ROUNDING
    assert run(case.change(periodic="none"), mesh).periodic_misfit is None


@pytest.mark.parametrize("periodic", ["none", "moving"])
def test_the_report_has_the_misfit(tmp_path, periodic, capsys):
    mesh = builders.square(6)
    sv.write(tmp_path / "m.su2", mesh)
    Case(
        mesh_file=tmp_path / "m.su2",
        mesh_out=tmp_path / "out.su2",
        roles=dict.fromkeys(("x_m", "x_p"), "sliding")
        | {"BLOCK": "moving", "y_m": "periodic", "y_p": "periodic"},
        motions=(Translate("BLOCK", (0.05, 0.05)),),
        sliding="ps",
        periodic=periodic,
        steps=2,
    ).write(tmp_path / "c.cfg")
    assert command(["run", str(tmp_path / "c.cfg"), "--json", str(tmp_path / "r.json")]) == 0
    report = json.loads((tmp_path / "r.json").read_text())
    assert "periodic_misfit" in report
    out = capsys.readouterr().out
    if periodic == "none":
        assert report["periodic_misfit"] is None
        assert "periodic misfit" not in out
    else:
        assert 0 <= report["periodic_misfit"] < ROUNDING
        assert "periodic misfit" in out


def test_nodes_left_out_are_harmless_only_where_the_interpolation_meets_them():
    mesh = builders.square(6)
    zeros = np.zeros((len(mesh.points), 2))
    setup = make_setup(
        prepare(Case(roles={"BLOCK": "moving"}, motions=(Rotate("BLOCK", 1.0),)), mesh)
    )
    for error, note in ((1e-12, True), (1e-3, False)):
        solution = StepSolution(zeros, 1, 0.0, np.array([3]), 1.0, dropped_error=error)
        (warning,) = messages_of(stepping._dropped_warning(setup, solution, 1, 2, mesh))
        assert (warning.level == "note") == note
        assert f"error there is at most {error:.2g}" in str(warning)
        assert "no harm" not in str(warning)


def test_the_view_has_the_same_types_as_a_run():
    mesh, roles = split_wall("fixed", "sliding")
    case = Case(
        roles=roles | {"x_p": "moving"},
        motions=(Translate("x_p", (0.1, 0.0)),),
        periodic="moving",
        sliding="ps",
    )
    plain = replace(mesh, name="m")
    session = open_mesh(StepFrame(plain, sv.quality(plain)), None, (), case)
    found = typed_nodes(changes.set_view(session, points="types"))
    fixed = found.nodes[found.kinds == list(NODE_TYPES).index("fixed")]
    np.testing.assert_array_equal(fixed, make_setup(prepare(case, mesh)).classes.fixed)
    # Markers that do not match are told beside the Run button; the types are there all the same.
    points = mesh.points.copy()
    points[mesh.marker("y_p").nodes[2], 0] += 0.03
    wrong = plain.with_points(points)
    session = open_mesh(StepFrame(wrong, sv.quality(wrong)), None, (), case)
    found = typed_nodes(changes.set_view(session, points="types"))
    assert np.sum(found.kinds == list(NODE_TYPES).index("fixed")) == len(fixed) - 1


# Real meshes


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real meshes are not here")
@pytest.mark.parametrize(
    ("method", "periodic", "amount"),
    [("ps", "fixed", 6e-4), ("ps", "moving", 1e-5), ("ds", "fixed", 1e-5), ("ds", "moving", 6e-4)],
)
def test_a_pin_array_between_symmetry_planes(tmp_path, method, periodic, amount):
    packed = SHARED / "meshes" / "su2" / "incomp_chtPinArray_3d_coarse.su2.xz"
    (tmp_path / "pins.su2").write_bytes(lzma.decompress(packed.read_bytes()))
    mesh = sv.read(tmp_path / "pins.su2", zone=1)
    roles = dict.fromkeys(("fluid_top", "fluid_bottom_interface", "fluid_sym_sides"), "sliding")
    roles |= {"fluid_pin2": "moving", "fluid_inlet": "periodic", "fluid_outlet": "periodic"}
    case = Case(
        roles=roles,
        motions=(Translate("fluid_pin2", (amount, 0.0, 0.0)),),
        periodic=periodic,
        sliding=method,
    )
    step = run(case, mesh)
    assert step.periodic_misfit < 1e-17
    found = sv.quality(step.mesh, mesh)
    assert found.inverted == 0
    assert found.min > 0.7


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real meshes are not here")
@pytest.mark.parametrize("method", ["ps", "ds"])
def test_a_turbine_with_layers_of_cells_beyond_its_periodic_sides(method):
    """Inflow and outflow reach into the layers: their ends there were held."""
    packed = SHARED / "meshes" / "su2" / "nicf_LS89_mesh_vki_turbine_halo.su2"
    mesh = sv.read(packed)
    case = Case(
        roles={
            "airfoil": "moving",
            "inflow": "sliding",
            "outflow": "sliding",
            "periodic_1": "periodic",
            "periodic_2": "periodic",
        },
        motions=(Rotate("airfoil", 4.0),),
        periodic="moving",
        sliding=method,
        reduction=Reduction(tolerance=1e-6 * mesh.extent),
    )
    step = run(case, mesh)
    found = sv.quality(step.mesh, mesh)
    assert found.inverted == 0
    assert found.min == pytest.approx(0.23665, abs=1e-4)
    assert step.periodic_misfit < ROUNDING


@pytest.mark.skipif(not SHARED.is_dir(), reason="the inputs are not here")
@pytest.mark.parametrize("name", ["per_refused", "periodic_3722"])
def test_prisms_on_a_curved_shroud(name):
    case = Case.read(SHARED / "faults" / f"{name}.cfg")
    step = run(case, sv.read(SHARED / "faults" / f"{name}.su2"))
    assert step.periodic_misfit < ROUNDING
