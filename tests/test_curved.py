"""Curved boundaries: slid nodes stay on them, and sliding is worth it."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.mesh.periodic import pair_up
from slideviz.mesh.topology import find_boundary
from slideviz.rbf.closest import ClosestPoints
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import write_sample
from tests import builders
from tests.slow import one_of_each_fast

REDUCTIONS = [None, Reduction(tolerance=1e-4)]


def distance_to(mesh: Mesh, name: str, points: np.ndarray) -> np.ndarray:
    """Return how far points are from a boundary of the undeformed mesh."""
    boundary = find_boundary(mesh)
    facets = boundary.facets[boundary.marker == boundary.names.index(name)]
    corners = mesh.points[facets]
    if mesh.dim == 3:
        corners = np.concatenate([corners[:, :3], corners[:, [0, 2, 3]]])
    return np.linalg.norm(ClosestPoints(corners).query(points) - points, axis=1)


def cylinder() -> Mesh:
    """An O-grid around a cylinder; its circular far field is two markers."""
    around, out = 72, 24
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    r = np.geomspace(0.5, 10.0, out + 1)
    points = np.stack([np.outer(r, np.cos(angle)).ravel(), np.outer(r, np.sin(angle)).ravel()], 1)
    node = np.arange((out + 1) * around).reshape(out + 1, around)
    ring = np.roll(node, -1, axis=1)
    quads = np.stack([node[:-1], node[1:], ring[1:], ring[:-1]], -1).reshape(-1, 4)
    sides = np.stack([node, ring], -1)
    half = around // 2
    markers = {"wall": sides[0], "front": sides[-1, :half], "back": sides[-1, half:]}
    return Mesh(
        points,
        Cells.from_blocks([(9, quads)]),
        tuple(Marker(k, Cells.from_blocks([(3, v)])) for k, v in markers.items()),
    )


@pytest.mark.parametrize("reduction", REDUCTIONS)
@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_a_circular_far_field_slides_as_one(sliding, reduction):
    mesh = cylinder()
    roles = {"wall": "moving", "front": "sliding", "back": "sliding"}
    turned = Case(
        roles=roles, motions=(Rotate("wall", 60.0),), sliding=sliding, steps=5, reduction=reduction
    )
    *_, last = sv.deform(turned, mesh)
    assert last.node_counts["sliding_edge"] == 72
    assert last.node_counts["fixed"] == 0
    far = np.union1d(mesh.marker("front").nodes, mesh.marker("back").nodes)
    gap = np.minimum(*(distance_to(mesh, n, last.mesh.points[far]) for n in ("front", "back")))
    assert gap.max() < 1e-12
    swing = np.linalg.norm(last.mesh.points[far] - mesh.points[far], axis=1)
    assert swing.min() > 0.1
    *_, held = sv.deform(turned.change(sliding="none"), mesh)
    assert sv.quality(last.mesh, mesh).min > sv.quality(held.mesh, mesh).min


def duct() -> Mesh:
    """A square duct with a bend of 90 degrees about z."""
    n, k = 6, 18
    turn, side = np.linspace(0, np.pi / 2, k + 1), np.linspace(-0.5, 0.5, n + 1)
    t, z, x = np.meshgrid(turn, side, side, indexing="ij")
    points = np.stack([(2 + x) * np.cos(t), (2 + x) * np.sin(t), z], -1).reshape(-1, 3)
    node = np.arange(points.shape[0]).reshape(k + 1, n + 1, n + 1)

    def faces(a):
        quads = np.stack([a[:-1, :-1], a[1:, :-1], a[1:, 1:], a[:-1, 1:]], -1)
        return Cells.from_blocks([(9, quads.reshape(-1, 4))])

    low, high = node[:-1], node[1:]

    def corners(a):
        return [a[:, :-1, :-1], a[:, :-1, 1:], a[:, 1:, 1:], a[:, 1:, :-1]]

    cells = np.stack([*corners(low), *corners(high)], -1).reshape(-1, 8)
    sides = {
        "in": node[0],
        "out": node[-1],
        "inner": node[:, :, 0],
        "outer": node[:, :, -1],
        "bottom": node[:, 0],
        "top": node[:, -1],
    }
    markers = tuple(Marker(name, faces(a)) for name, a in sides.items())
    return Mesh(points, Cells.from_blocks([(12, cells)]), markers)


@pytest.mark.parametrize("reduction", REDUCTIONS)
@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_the_walls_of_a_bent_duct(sliding, reduction):
    """The inlet is pushed into the bend; without sliding its first cells fold."""
    mesh = duct()
    walls = ("inner", "outer", "bottom", "top")
    push = (Rotate("in", 8.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),)
    roles = {"in": "moving", "out": "fixed"} | dict.fromkeys(walls, "sliding")
    case = Case(roles=roles, motions=push, sliding=sliding, steps=2, reduction=reduction)
    *_, last = sv.deform(case, mesh)
    found = sv.quality(last.mesh, mesh)
    assert found.inverted == 0
    assert found.min > 0.8
    for name in walls:
        slid = np.setdiff1d(mesh.marker(name).nodes, mesh.marker("in").nodes)
        assert distance_to(mesh, name, last.mesh.points[slid]).max() < 1e-12
    *_, held = sv.deform(case.change(sliding="none"), mesh)
    assert sv.quality(held.mesh, mesh).inverted > 0


@pytest.mark.parametrize(
    ("role", "sliding"), one_of_each_fast(["sliding", "internal"], ["ps", "ds"])
)
def test_hub_and_shroud_of_an_annular_passage(tmp_path, sliding, role):
    """In the cylindrical frame hub and shroud are planes, so their nodes keep their radius."""
    write_sample("stator", tmp_path, 5000)
    mesh = sv.read(tmp_path / "mesh.su2")
    case = sv.Case.read(tmp_path / "stator.cfg")
    case = case.change(
        sliding=sliding, reduction=None, roles={**case.roles, "HUB": role, "SHROUD": role}
    )
    if role == "sliding":
        # The sample's reshaped blade leaves hub and shroud; one that turns about the axis does not.
        turn = Rotate("BLADE", 1.5, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        case = case.change(motions=(turn,))
    *_, last = sv.deform(case, mesh)
    assert sv.quality(last.mesh, mesh).inverted == 0
    before, after = (np.hypot(*m.points[:, :2].T) for m in (mesh, last.mesh))
    for name in ("HUB", "SHROUD"):
        nodes = mesh.marker(name).nodes
        if role == "internal":
            other = np.concatenate([mesh.marker(m).nodes for m in ("INFLOW", "OUTFLOW")])
            nodes = np.intersect1d(nodes, other)
        nodes = np.setdiff1d(nodes, mesh.marker("BLADE").nodes)
        assert np.abs(after[nodes] - before[nodes]).max() < 1e-12
    for name in ("INFLOW", "OUTFLOW"):
        nodes = mesh.marker(name).nodes
        assert np.abs(last.mesh.points[nodes, 2] - mesh.points[nodes, 2]).max() < 1e-12
    (pair,) = pair_up(last.mesh, ("PER1", "PER2"), "rotational")
    assert pair.mismatch < 1e-12
    assert np.degrees(abs(pair.angle)) == pytest.approx(360 / 41, abs=1e-9)


def test_the_far_field_can_be_translated_past():
    """A large motion: nodes of the far field gather, but none leaves the circle."""
    mesh = cylinder()
    case = Case(
        roles={"wall": "moving", "front": "sliding", "back": "sliding"},
        motions=(Translate("wall", (4.0, 2.0)),),
        sliding="ps",
        steps=5,
    )
    for step in sv.deform(case, mesh):
        assert sv.quality(step.mesh, mesh).inverted == 0
        far = np.linalg.norm(step.mesh.points[-72:], axis=1)
        assert far.max() <= 10.0 + 1e-12
        assert far.min() >= 10.0 * np.cos(np.pi / 72) - 1e-12


@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_walls_go_on_beyond_a_moving_end(sliding):
    """The inlet is pulled out of the bend; neighbours follow beyond the old end of the walls."""
    mesh = duct()
    walls = ("inner", "outer", "bottom", "top")
    pull = (Rotate("in", -8.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),)
    roles = {"in": "moving", "out": "fixed"} | dict.fromkeys(walls, "sliding")
    *_, last = sv.deform(Case(roles=roles, motions=pull, sliding=sliding, steps=2), mesh)
    found = sv.quality(last.mesh, mesh)
    assert found.inverted == 0
    assert found.min > 0.8
    followed = np.setdiff1d(mesh.marker("outer").nodes, mesh.marker("in").nodes)
    assert last.mesh.points[followed, 1].min() < -0.05


@pytest.mark.slow
@pytest.mark.parametrize("sliding", ["ps", "ds"])
def test_a_blade_may_leave_its_place_on_the_hub(tmp_path, sliding):
    """Nodes of the hub follow the blade into the place where it stood, which has no facets."""
    write_sample("stator", tmp_path, 5000)
    mesh = sv.read(tmp_path / "mesh.su2")
    case = sv.Case.read(tmp_path / "stator.cfg")
    turn = Rotate("BLADE", 2.5, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    roles = {**case.roles, "HUB": "sliding", "SHROUD": "sliding"}
    case = case.change(sliding=sliding, reduction=None, roles=roles, motions=(turn,), steps=2)
    *_, last = sv.deform(case, mesh)
    assert sv.quality(last.mesh, mesh).min > 0.6
    nodes = np.setdiff1d(mesh.marker("HUB").nodes, mesh.marker("BLADE").nodes)
    before, after = (np.hypot(*m.points[nodes, :2].T) for m in (mesh, last.mesh))
    assert np.abs(after - before).max() < 1e-12


def test_direct_sliding_keeps_to_a_straight_edge_of_a_curved_surface():
    """Only the rim of an internal boundary slides, so nothing that slides is curved here."""

    def place(p):
        x = p / np.array([6.0, 4.0, 4.0])
        bump = 0.1 * np.sin(2 * np.pi * x[:, 0]) * (1 + 0.5 * np.cos(2 * np.pi * x[:, 2]))
        x[:, 1] += bump * (1 - x[:, 1])
        return x

    mesh = builders.grid((6, 4, 4), place=place)
    case = Case(
        roles={"x_m": "sliding", "x_p": "sliding", "y_m": "internal", "y_p": "moving"},
        motions=(Translate("y_p", (3e-5, 2e-5, 1e-5)),),
        sliding="ds",
        steps=3,
    )
    *_, last = sv.deform(case, mesh)
    rim = np.intersect1d(mesh.marker("x_m").nodes, mesh.marker("y_m").nodes)
    moved = last.mesh.points[rim] - mesh.points[rim]
    assert np.abs(moved[:, 2]).max() > 1e-8
    np.testing.assert_allclose(moved[:, :2], 0.0, atol=1e-15)
