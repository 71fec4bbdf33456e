"""The layer zone: first heights, both sides of thin bodies, images, sliding and fixed walls."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.cli import run
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.samples.table import sample
from slideviz.samples.turbine_row import SPAN, extruded
from slideviz.session import jobs
from slideviz.session.run_messages import remarks_of
from slideviz.session.state import Run, StepFrame
from slideviz.solver.layers import height_warnings
from slideviz.solver.prepare import prepare
from slideviz.solver.remedies import remedies
from slideviz.solver.repair_stage import mended_frame
from slideviz.solver.setup import make_setup
from tests import builders
from tests.design.test_deformer_derivatives import check, motions
from tests.test_laws import box, box_case, sector, sector_case
from tools.study.flows import c_mesh, grid_mesh, joukowski, layered_o_mesh

pytestmark = pytest.mark.filterwarnings("ignore::slideviz.errors.ToleranceWarning")


def around(shape, rings, count, first=1e-4, far=20.0):
    """An O-mesh of quadrilaterals about a closed curve; ``shape`` maps angles to points.

    ``first``: the height of the first layer, or the heights (count,).
    """
    angle = np.arange(count) * 2 * np.pi / count
    wall = shape(angle)
    ring = 10.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along = np.roll(wall, -1, axis=0) - np.roll(wall, 1, axis=0)
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.multiply.outer((1.2 ** np.arange(rings) - 1.0) / 0.2, np.full(count, first))
    straight = wall + height[:, :, None] * normal
    part = np.clip(height / height[-1], 0.0, 1.0)[:, :, None] ** 2
    points = ((1 - part) * straight + part * ring).reshape(-1, 2)
    node = np.arange(rings * count).reshape(rings, count)
    near, beyond = np.roll(node, -1, axis=1)[:-1], np.roll(node, -1, axis=1)[1:]
    quads = np.stack([node[:-1], node[1:], beyond, near], axis=-1).reshape(-1, 4)
    sides = [np.stack([row, np.roll(row, -1)], axis=1) for row in (node[0], node[-1])]
    markers = [Marker(n, Cells.from_blocks([(3, s)])) for n, s in zip("wf", sides, strict=True)]
    return Mesh(points, Cells.from_blocks([(9, quads)]), tuple(markers))


def ellipse(angle, thickness=0.12):
    return np.stack([np.cos(angle), thickness * np.sin(angle)], axis=1)


def thin(angle):
    """A plate, 0.2 % thick at its sharp ends' neighbours."""
    x = np.cos(angle)
    return np.stack([x, 0.05 * np.sign(np.sin(angle)) * (1 - x**2)], axis=1)


def bent(x):
    return np.stack([0 * x[:, 0], 0.1 * x[:, 0] ** 2], axis=1)


def thicker(x):
    return np.stack([0 * x[:, 0], 0.1 * x[:, 1]], axis=1)


def deformed(mesh, motion, **settings):
    nodes = mesh.marker("w").nodes
    if callable(motion):
        motion = Prescribed(nodes, motion(mesh.points[nodes]), "w")
    case = Case(roles={"w": "moving"}, motions=(motion,), **{"layers": "auto", **settings})
    *_, last = sv.deform(case, mesh)
    return case, last


SHAPES = {"thick": ellipse, "thin": thin}
MOTIONS = {"turned": Rotate("w", 20.0), "bent": bent, "thicker": thicker}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_first_heights_and_angles_stay(shape, motion):
    mesh = around(SHAPES[shape], 40, 80)
    for steps in (1, 3):
        _, last = deformed(mesh, MOTIONS[motion], steps=steps)
        walls = sv.walls(last.mesh, mesh).summary()["w"]
        assert walls["first_height"]["ratio"]["min"] > 0.999
        assert walls["first_height"]["ratio"]["max"] < 1.001
        assert walls["angle"]["change"]["max"] < 0.5
        assert sv.quality(last.mesh, mesh).inverted == 0


@pytest.mark.parametrize("motion", MOTIONS)
def test_first_heights_that_differ_along_the_wall_stay(motion):
    first = 8e-3 * (1.5 + np.cos(np.arange(160) * np.pi / 80))
    mesh = around(ellipse, 22, 160, first=first)
    _, last = deformed(mesh, MOTIONS[motion])
    ratio = sv.walls(last.mesh, mesh).summary()["w"]["first_height"]["ratio"]
    assert 0.99 < ratio["min"] <= ratio["max"] < 1.01


@pytest.mark.parametrize("slender", [0.12, 0.03])
def test_a_zone_is_thinner_where_facets_are_shorter(slender):
    """At the ends of an ellipse facets are shorter by its slenderness."""
    mesh = around(lambda angle: ellipse(angle, slender), 40, 80)
    case, _ = deformed(mesh, Translate("w", (0.0, 0.1)))
    zone = make_setup(prepare(case, mesh)).zone
    wall = mesh.points[:80]
    length = np.linalg.norm(np.roll(wall, -1, axis=0) - wall, axis=1)
    near = np.max([np.roll(length, k) for k in range(-2, 3)], axis=0)
    apart = np.linalg.norm(mesh.points[zone.nodes, None] - wall, axis=2)
    at = apart.argmin(axis=1)
    assert set(at) == set(range(80))
    assert (apart.min(axis=1) < 1e-4 + 2.0 * near[at]).all()


@pytest.mark.parametrize(("part", "least"), [(0.3, 0.7), (0.6, 0.64), (1.0, 0.57)])
def test_a_much_thicker_nose_keeps_heights_and_good_cells(part, least):
    """A zone as thick as the long facets beside the nose held round cells: lowest 0.49."""
    mesh = c_mesh(joukowski, first=2e-6)
    nodes = np.unique(mesh.marker("airfoil").nodes)
    y = mesh.points[nodes, 1]
    case = Case(
        roles={"airfoil": "moving"},
        motions=(Prescribed(nodes, np.stack([0 * y, part * y], axis=1), "airfoil"),),
        relax="auto",
        layers="auto",
        repair="auto",
    )
    *_, last = sv.deform(case, mesh)
    ratio = sv.walls(last.mesh, mesh).summary()["airfoil"]["first_height"]["ratio"]
    assert 0.98 < ratio["min"] <= ratio["max"] < 1.02
    assert sv.quality(last.mesh, mesh).min > least


def test_a_wall_that_only_turns_takes_its_zone_along_exactly():
    mesh = around(ellipse, 40, 80)
    case, last = deformed(mesh, Rotate("w", 25.0, (0.3, 0.1)), steps=2)
    zone = make_setup(prepare(case, mesh)).zone
    c, s = np.cos(np.radians(25)), np.sin(np.radians(25))
    turned = (mesh.points - [0.3, 0.1]) @ np.array([[c, s], [-s, c]]) + [0.3, 0.1]
    whole = zone.nodes[zone.share[:, 0] == 1.0]
    assert len(whole) >= 80
    np.testing.assert_allclose(last.mesh.points[whole], turned[whole], rtol=0, atol=1e-13)


def test_without_motion_no_bit_changes():
    mesh = around(ellipse, 20, 30)
    _, last = deformed(mesh, Translate("w", (0.0, 0.0)))
    assert np.array_equal(last.mesh.points, mesh.points)


def test_a_fixed_wall_keeps_its_layers_in_place():
    """Two walls: of a channel the lower one moves, the upper one has layers and stays."""
    y = np.r_[0.0, 1e-3 * (1.3 ** np.arange(1, 16) - 1) / 0.3, 0.6, 0.8, 0.95, 0.99, 1.0]
    x = np.linspace(0, 2, 21)
    node = np.arange(x.size * y.size).reshape(y.size, x.size)
    sides = {"w": node[0], "top": node[-1], "in": node[:, 0], "out": node[:, -1]}
    mesh = grid_mesh(x + 1j * y[:, None], node.T, sides)
    roles = {"w": "moving", "in": "sliding", "out": "sliding"}
    case = Case(roles=roles, motions=(Translate("w", (0.0, 0.1)),), sliding="ps", layers="auto")
    *_, last = sv.deform(case, mesh)
    walls = sv.walls(last.mesh, mesh).summary()
    for name in ("w", "top"):
        assert walls[name]["first_height"]["ratio"]["min"] > 1 - 1e-9
        assert walls[name]["first_height"]["ratio"]["max"] < 1 + 1e-9
    assert last.mesh.points[node[-2], 1] == pytest.approx(0.99, abs=1e-12)
    # Nodes at the ends slide along them, as their wall takes them.
    assert np.array_equal(last.mesh.points[node[:, 0], 0], np.zeros(len(y)))
    report = last.kept_layers.report()
    assert [wall["boundaries"] for wall in report["walls"]] == [("w",), ("top",)]
    plain = sv.walls(list(sv.deform(case.change(layers="no"), mesh))[-1].mesh, mesh).summary()
    assert plain["top"]["first_height"]["ratio"]["min"] < 0.95


@pytest.mark.parametrize("thickness", [0.0, 0.05, 1.0])
@pytest.mark.parametrize("rows", [5, 2])  # of two rows, the nodes between are as near to both walls
def test_walls_nearer_than_their_zones_share_the_gap(thickness, rows):
    mesh = builders.grid((39, rows), place=lambda p: p * [1 / 39, 0.02 / rows])
    roles = {"y_m": "moving", "y_p": "fixed", "x_m": "sliding", "x_p": "sliding"}
    case = Case(
        roles=roles,
        motions=(Translate("y_m", (0.0, 0.01)),),
        sliding="ps",
        layers="keep",
        layer_thickness=thickness,
    )
    *_, last = sv.deform(case, mesh)
    assert sv.quality(last.mesh, mesh).inverted == 0


@pytest.mark.parametrize(("thickness", "told"), [("auto", False), (0.019, False), (0.021, True)])
def test_a_zone_thicker_than_a_channel_is_told(thickness, told):
    mesh = builders.grid((39, 5), place=lambda p: p * [1 / 39, 0.02 / 5])
    roles = {"y_m": "moving", "y_p": "fixed", "x_m": "sliding", "x_p": "sliding"}
    motions = (Translate("y_m", (0.0, 0.001)),)
    case = Case(
        roles=roles, motions=motions, sliding="ps", layers="keep", layer_thickness=thickness
    )
    said = [text for text in make_setup(prepare(case, mesh)).warnings if "LAYER_THICKNESS" in text]
    assert len(said) == 2 * told  # of both walls
    if told:
        assert "0.021 is more than the distance from y_m to the next wall, 0.02:" in said[0]
        assert "write less than 0.01, or AUTO" in said[0]
    first = remedies(case)[0].keys
    assert (first == "LAYER_THICKNESS= AUTO") == (thickness != "auto")


@pytest.mark.parametrize(("thickness", "words"), [(2e-4, ""), (9e-5, "layer at w, 0.0001")])
def test_a_zone_thinner_than_the_first_layer_is_told(thickness, words):
    mesh = around(ellipse, 40, 80)
    case, _ = deformed(mesh, MOTIONS["bent"], layer_thickness=thickness)
    said = [text for text in make_setup(prepare(case, mesh)).warnings if "LAYER_THICKNESS" in text]
    assert len(said) == bool(words)
    assert words in "".join(said)


@pytest.mark.parametrize(("thickness", "told"), [(0.0, True), (0.01, True), (0.1, False)])
def test_a_zone_without_nodes_is_told(thickness, told, tmp_path):
    mesh = around(ellipse, 12, 80, first=0.05)
    case, _ = deformed(mesh, MOTIONS["bent"], layers="keep", layer_thickness=thickness)
    said = [
        text for text in make_setup(prepare(case, mesh)).warnings if "LAYERS= KEEP has no" in text
    ]
    assert len(said) == told


def test_the_next_wall_may_be_the_periodic_image():
    row = sample("turbine-row", 5000)
    for thickness in (0.2, 2.0):
        pitch = row.mesh.extent * thickness
        case = row.case.change(layers="keep", layer_thickness=pitch)
        said = [
            text
            for text in make_setup(prepare(case, row.mesh)).warnings
            if "LAYER_THICKNESS" in text
        ]
        assert [text.partition("from ")[2].partition(" to")[0] for text in said] == ["BLADE"]
    case = row.case.change(layers="keep", layer_thickness=1e-2 * row.mesh.extent)
    assert not [
        text for text in make_setup(prepare(case, row.mesh)).warnings if "LAYER_THICK" in text
    ]


def test_walls_without_layers_carry_nothing_unless_they_are_asked_to():
    mesh = around(ellipse, 12, 80, first=0.05)
    case, last = deformed(mesh, MOTIONS["bent"])
    assert make_setup(prepare(case, mesh)).zone is None
    assert last.kept_layers is None
    case, last = deformed(mesh, MOTIONS["bent"], layers="keep", layer_thickness=0.1)
    assert last.kept_layers.nodes == len(make_setup(prepare(case, mesh)).zone.nodes) > 0


def test_periodic_images_are_carried_alike():
    """A vane whose zone reaches the periodic side: `deform` refuses images that differ."""
    row = sample("turbine-row", 5000)
    case = row.case.change(motions=(Rotate("BLADE", 8.0),), layers="keep", layer_thickness=0.01)
    zone = make_setup(prepare(case, row.mesh)).zone
    setup = make_setup(prepare(case, row.mesh))
    assert np.isin(setup.images[:, 0], zone.nodes).sum() > 5
    *_, last = sv.deform(case, row.mesh)
    assert last.periodic_misfit < 1e-15


CASES = [
    ("translational", ("ps", "moving"), 2, 3, None),
    ("translational", ("ds", "fixed"), 3, 1, None),
    ("rotational", ("ps", "moving"), 3, 1, None),
    pytest.param("rotational", ("ds", "periodic"), 2, 3, None, marks=pytest.mark.slow),
    pytest.param("rotational", ("ds", "moving"), 3, 3, None, marks=pytest.mark.slow),
    pytest.param("cartesian", ("none", "none"), 2, 3, None, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("frame", "method", "dim", "steps", "reduction"), CASES)
def test_derivatives(frame, method, dim, steps, reduction):
    settings = {"steps": steps, "reduction": reduction, "layers": "keep", "layer_thickness": 0.6}
    make, case = (sector, sector_case) if frame == "rotational" else (box, box_case)
    mesh = make(dim)
    motion = motions(mesh, "blade" if (frame, dim) == ("rotational", 3) else "BLOCK")
    deformer = check(case(mesh, method, motion, **settings), mesh)
    assert len(deformer._setup.zone.nodes)


def test_derivatives_at_a_cusp():
    mesh = c_mesh(joukowski, 40, 8, first=1e-4)
    motion = Rotate("airfoil", 5.0, (0.3, 0.0)), sv.HicksHenne("airfoil", 0.02, 0.8)
    settings = {"layers": "keep", "layer_thickness": 0.05, "kernel": "wendland-c0", "steps": 2}
    case = Case(roles={"airfoil": "moving"}, motions=motion, reduction=None, **settings)
    walls = check(case, mesh)._setup.zone.walls
    assert len(walls.start) == len(np.unique(walls.known)) + 1  # the edge has two sides


def test_a_streamed_mesh_with_a_cusp_has_the_same_bits(tmp_path):
    sv.write(tmp_path / "mesh.su2", c_mesh(joukowski, 60, 12, first=2e-6))
    case = Case(roles={"airfoil": "moving"}, motions=(Rotate("airfoil", 10.0),), layers="auto")
    case.change(mesh_file=tmp_path / "mesh.su2", steps=2).write(tmp_path / "case.cfg")
    for name, more in (("memory", []), ("streamed", ["--stream"])):
        files = [str(tmp_path / "case.cfg"), "-o", str(tmp_path / f"{name}.su2")]
        assert run(["run", *files, *more]) == 0
    one, two = (sv.read(tmp_path / f"{name}.su2").points for name in ("memory", "streamed"))
    assert np.array_equal(one, two)


def test_the_numbering_does_not_matter():
    """Of a symmetric mesh, too, where several wall nodes are equally far from a node."""
    mesh = around(ellipse, 30, 40, first=5e-3)
    order, other = builders.shuffled(mesh, 3)
    settings = {"layers": "keep", "layer_thickness": 0.3, "reduction": None}
    motion = Rotate("w", 10.0, (0.2, 0.0))
    points = deformed(mesh, motion, **settings)[1].mesh.points
    shuffled = deformed(other, motion, **settings)[1].mesh.points
    np.testing.assert_allclose(shuffled, points[order], rtol=0, atol=1e-12)


@pytest.mark.parametrize("motion", ["turned", "stretched", "twisted"])
def test_in_3d_with_nodes_that_slide_on_hub_and_shroud(motion):
    """Nodes of the zone on hub and shroud slide as the wall takes them."""
    mesh = builders.layered_cylinder(10, 24, 1e-3)
    nodes = mesh.marker("wall").nodes
    x = mesh.points[nodes]
    angle = np.radians(8.0 if motion == "turned" else 8.0 * x[:, 2] * (motion == "twisted"))
    c, s = np.cos(angle), np.sin(angle)
    turned = np.stack([c * x[:, 0] - s * x[:, 1], s * x[:, 0] + c * x[:, 1], x[:, 2]], axis=1)
    turned[:, 0] *= 1.1 if motion == "stretched" else 1.0
    roles = {"wall": "moving", "hub": "sliding", "shroud": "sliding"}
    case = Case(
        roles=roles,
        motions=(Prescribed(nodes, turned - x, "wall"),),
        sliding="ps",
        layers="auto",
        steps=2,
    )
    setup = make_setup(prepare(case, mesh))
    assert len(setup.zone.sliding) >= 48
    *_, last = sv.deform(case, mesh)
    walls = sv.walls(last.mesh, mesh).summary()["wall"]
    assert walls["first_height"]["ratio"]["min"] > 0.999
    assert walls["first_height"]["ratio"]["max"] < 1.001
    assert walls["angle"]["change"]["max"] < 0.5
    for name in ("hub", "shroud"):
        on = mesh.marker(name).nodes
        assert np.array_equal(last.mesh.points[on, 2], mesh.points[on, 2])


def carried(mesh, moved, **changes):
    """The walls' summary and the number of inverted cells, with layers kept and without."""
    nodes = np.unique(mesh.marker("airfoil").nodes)
    motion = Prescribed(nodes, moved(mesh.points[nodes]), "airfoil")
    case = Case(roles={"airfoil": "moving"}, motions=(motion,), layers="auto", **changes)
    (*_, last), (*_, plain) = (sv.deform(one, mesh) for one in (case, case.change(layers="no")))
    inverted = [sv.quality(one.mesh, mesh).inverted for one in (last, plain)]
    return sv.walls(last.mesh, mesh).summary()["airfoil"], *inverted


def lifted(x):
    return np.stack([0 * x[:, 0], 0.08 * x[:, 0] ** 2], axis=1)


THICKER = sv.Scale("w", (1.0, 2.0))


@pytest.mark.parametrize(
    ("motion", "settings", "remedy"),
    [
        (THICKER, {"layers": "no"}, "LAYERS= AUTO keeps it"),
        (sv.Scale("w", (1.0, 0.4)), {"layers": "no"}, "LAYERS= AUTO keeps it"),
        (THICKER, {"method": "elastic", "layers": "no"}, "METHOD= rbf with LAYERS= AUTO keeps it"),
        (THICKER, {"layers": "auto"}, None),
        (sv.Scale("w", (1.0, 1.3)), {"layers": "no"}, None),
    ],
)
def test_first_heights_that_changed_much_are_a_warning_with_wall_place_and_remedy(
    motion, settings, remedy, tmp_path, capsys
):
    mesh = around(ellipse, 30, 60)
    case = Case(roles={"w": "moving"}, motions=(motion,), mesh_file=tmp_path / "mesh.su2")
    case = case.change(mesh_out=tmp_path / "out.su2", **settings)
    sv.write(case.mesh_file, mesh)
    case.write(tmp_path / "case.cfg")
    assert run(["run", str(tmp_path / "case.cfg"), "--json", str(tmp_path / "report.json")]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    said = [text for text in report["warnings"] if "the first height" in text]
    frames = []
    jobs.compute(case, mesh, jobs.Job(frames.append))
    ended = Run(1, case, tuple(x for x in frames if isinstance(x, StepFrame)), "done")
    shown = [text for text in remarks_of(ended, "warning") if "the first height" in text]
    assert len(said) == len(shown) == (remedy is not None)
    if remedy is None:
        return
    assert said[0] in capsys.readouterr().err
    assert said[0].endswith(remedy)
    ratios = report["walls"]["w"]["first_height"]["ratio"]
    worst = max((ratios["min"], ratios["max"]), key=lambda ratio: abs(np.log(ratio)))
    place = re.search(rf"layers at w is {worst:.3g} times that before at \((.*), (.*)\)", said[0])
    moved = sv.read(case.mesh_out)
    away = moved.points[moved.marker("w").nodes] - [float(place[1]), float(place[2])]
    assert np.abs(away).max(axis=1).min() < 1e-5


def sharp(edge_deg, camber):
    """A cambered airfoil whose trailing edge has an angle; on one side its facets are shorter."""

    def outline(t):
        x = np.abs(t) ** np.where(t < 0.0, 1.6, 2.0)
        wedge = np.tan(np.radians(edge_deg / 2.0)) * x**3 * (1.0 - x)
        half = 0.185 * np.sqrt(x) * (1.0 - x) ** 1.5 + wedge
        return x + 1j * (4.0 * camber * x * (1.0 - x) + np.sign(t) * half)

    return outline


@pytest.mark.parametrize("outline", [joukowski, sharp(0.0, 0.04)])
def test_nodes_beside_a_cusp_see_it_from_both_sides(outline):
    """Though, without sides of its own, the edge has the normal of one side only."""
    mesh = c_mesh(outline, 80, 16, first=2e-6)
    wall, inverted, _ = carried(mesh, lifted, feature_angle_deg=180.0)
    assert inverted == 0
    assert (
        0.99 < wall["first_height"]["ratio"]["min"] <= wall["first_height"]["ratio"]["max"] < 1.01
    )
    assert wall["angle"]["change"]["max"] < 1.0


@given(
    edge_deg=st.floats(0.0, 20.0),
    camber=st.floats(-0.05, 0.05),
    kind=st.sampled_from([c_mesh, layered_o_mesh]),
    waves=st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=3),
    thicker=st.floats(-0.3, 0.3),
)
@settings(max_examples=20, deadline=None)
def test_layers_of_cambered_airfoils_are_kept_at_any_trailing_edge(
    edge_deg, camber, kind, waves, thicker
):
    def moved(points):
        x, y = points.T
        waved = sum(size * np.cos(k * np.pi * x) for k, size in enumerate(waves, 1))
        return np.stack([waves[0] * x, waved + thicker * y], axis=1)

    wall, inverted, plain = carried(kind(sharp(edge_deg, camber), 60, first=2e-6), moved)
    assert inverted <= plain
    assert (
        0.99 < wall["first_height"]["ratio"]["min"] <= wall["first_height"]["ratio"]["max"] < 1.01
    )
    assert wall["angle"]["change"]["max"] < 1.0


def test_the_sides_of_a_sharp_edge_in_3d_turn_by_themselves():
    """A wing of constant section, thickened and turned between two sliding planes."""
    flat = c_mesh(sharp(16.0, 0.04), 60, 12, first=2e-6)
    straight = extruded(flat, 4)
    mesh = straight.with_points(straight.points * [1.0, 1.0, 0.4 / SPAN])

    def moved(x):
        return np.stack([-0.2 * x[:, 1], 0.2 * x[:, 0] + 0.5 * x[:, 1], 0.0 * x[:, 2]], axis=1)

    nodes = np.unique(mesh.marker("airfoil").nodes)
    case = Case(
        roles={"airfoil": "moving", "HUB": "sliding", "SHROUD": "sliding"},
        motions=(Prescribed(nodes, moved(mesh.points[nodes]), "airfoil"),),
        sliding="ps",
        layers="auto",
    )
    *_, last = sv.deform(case, mesh)
    wall = sv.walls(last.mesh, mesh).summary()["airfoil"]
    assert (
        0.99 < wall["first_height"]["ratio"]["min"] <= wall["first_height"]["ratio"]["max"] < 1.01
    )
    assert sv.quality(last.mesh, mesh).inverted == 0


@pytest.mark.parametrize("afterwards", [False, True])
def test_repair_of_poor_cells_keeps_first_heights(afterwards):
    mesh = around(ellipse, 40, 80)
    x = mesh.points[mesh.marker("w").nodes, 0]
    stretched = np.stack([0.5 * x * np.abs(x), 0 * x], axis=1)
    case, plain = deformed(mesh, lambda _: stretched)
    case = case.change(repair="yes", repair_below=0.9)
    if afterwards:
        last = mended_frame(case, mesh, plain, lambda _: None)
    else:
        *_, last = sv.deform(case, mesh)
    heights = [
        sv.walls(step.mesh, mesh).summary()["w"]["first_height"]["ratio"] for step in (plain, last)
    ]
    assert len(last.repaired.nodes)
    assert heights[0] == heights[1]
    assert not height_warnings(case, sv.walls(last.mesh, mesh), last.mesh)
    assert not any("of layers" in text for text in last.warnings)


@pytest.mark.parametrize("layers", ["auto", "no"])
@pytest.mark.parametrize("degrees", [-5.0, -30.0])
def test_a_run_that_keeps_layers_says_where_those_of_a_sliding_wall_are_spoiled(layers, degrees):
    """A wall with layers leans against one with layers in which its foot slides."""
    height = np.append(0.002 * (1.2 ** np.arange(20) - 1.0) / 0.2, 1.0)
    mesh = builders.grid((20, 20), place=lambda p: height[np.asarray(p).astype(int)])
    roles = {"x_m": "moving", "y_m": "sliding", "y_p": "sliding"}
    case = Case(roles=roles, relax="yes", layers=layers, sliding="ps", rims="slide")
    case = case.change(motions=(Rotate("x_m", degrees, (0.0, 0.0)),))
    *_, last = sv.deform(case, mesh)
    walls = sv.walls(last.mesh, mesh)
    ratio = walls.summary()["y_m"]["first_height"]["ratio"]
    said = [text for text in height_warnings(case, walls, last.mesh) if "layers at y_m" in text]
    assert len(said) == (layers == "auto" and degrees == -30.0)
    for text in said:
        assert f"is {ratio['min']:.3g} times" in text
        assert "only moving and fixed boundaries keep their layers; move x_m less" in text


def test_lifting_the_lowest_cells_after_a_relaxation_keeps_first_heights():
    mesh = c_mesh(around=60, wake=10, first=1e-3)
    case = Case(roles={"airfoil": "moving"}, motions=(sv.Rotate("airfoil", 30.0),), relax="yes")
    case = case.change(layers="auto")
    steps = [list(sv.deform(case.change(repair=repair), mesh))[-1] for repair in ("no", "yes")]
    low = [sv.quality(step.mesh, mesh).min for step in steps]
    assert low[1] > low[0]
    heights = [sv.walls(step.mesh, mesh).summary()["airfoil"]["first_height"] for step in steps]
    assert heights[0] == heights[1]


def test_layers_move_where_cells_stay_folded_else_and_a_warning_says_so():
    """A bump leaves less room in a channel than the first layers of both walls need."""
    mesh = builders.grid((30, 20), place=lambda p: p * [1 / 30, 0.01])
    wall = mesh.marker("y_m").nodes
    bump = 0.185 * np.sin(np.pi * mesh.points[wall, 0]) ** 2
    motion = Prescribed(wall, np.stack([0 * bump, bump], axis=1), "y_m")
    case = Case(roles={"y_m": "moving"}, motions=(motion,), layers="keep", repair="yes")
    *_, plain = sv.deform(case.change(repair="no"), mesh)
    *_, last = sv.deform(case, mesh)
    assert sv.quality(plain.mesh, mesh).inverted
    assert not sv.quality(last.mesh, mesh).inverted
    (said,) = [text for text in last.warnings if "of layers moved to mend folded cells" in text]
    rigid = make_setup(prepare(case, mesh)).rigid
    assert said.startswith(f"{np.isin(rigid, last.repaired.nodes).sum()} nodes")
