"""Polyhedra are drawn as cells of their file: faces, cuts and cells of a plane, in one piece."""

import csv
import json
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.cli import run
from slideviz.export.titles import mark_words
from slideviz.mesh.metrics import metric
from slideviz.mesh.model import Mesh
from slideviz.mesh.polyhedra import outlines
from slideviz.mesh.quality_derivative import cell_margins
from slideviz.mesh.surfaces import coarse_surfaces, find_surfaces, is_closed
from slideviz.mesh.walls import walls
from slideviz.scene.actors import CELL, POINT, part_shape
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.inspect import cell_at, cell_centers, cell_info, worst_cells
from slideviz.session.jobs import Job, save_quality
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from slideviz.terms import METRICS
from tests.builders import grid
from tests.polymesh_files import extruded, honeycomb, merged, sides_of, write_mesh, write_polymesh

ENDS = {
    "ends": lambda corners: np.ptp(corners[:, 2]) == 0,
    "sides": lambda corners: True,
}


@pytest.fixture(scope="module")
def hexagons(tmp_path_factory):
    """Hexagonal prisms, nine in each of two layers."""
    folder = tmp_path_factory.mktemp("case")
    write_polymesh(folder / "polyMesh", *extruded(*honeycomb(), [0.0, 1.0, 2.0]), ENDS)
    return sv.read(folder / "polyMesh")


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    """Hexagons, a layer between two empty patches."""
    folder = tmp_path_factory.mktemp("case")
    kinds = {"ends": "empty"}
    write_polymesh(folder / "polyMesh", *extruded(*honeycomb(), [0.0, 1.0]), ENDS, kinds)
    return sv.read(folder / "polyMesh")


def areas(polygons):
    """Return the area of each polygon."""
    out = []
    for nodes in np.split(polygons.connectivity, polygons.offsets[1:-1])[: len(polygons)]:
        at = polygons.points[nodes]
        out.append(np.linalg.norm(np.cross(at[1:-1] - at[0], at[2:] - at[0]).sum(axis=0)) / 2)
    return np.array(out)


def test_boundaries_have_the_faces_of_the_file(hexagons):
    ends, sides = find_surfaces(hexagons)
    assert Counter(6 - (ends.facets[:, 1:] == ends.facets[:, :-1]).sum(axis=1)) == {6: 18}
    assert Counter(6 - (sides.facets[:, 1:] == sides.facets[:, :-1]).sum(axis=1)) == {4: 44}
    first = np.flatnonzero(np.diff(hexagons.whole_cells, prepend=-1))
    assert {*ends.owner} == {*first}
    assert {*sides.owner} <= {*first}
    assert is_closed([ends, sides])


def test_coarse_boundaries_of_polyhedra_cover_the_same(hexagons, monkeypatch):
    monkeypatch.setattr("slideviz.mesh.surfaces.LEAST", 1)
    full = find_surfaces(hexagons)
    coarse = coarse_surfaces(full, hexagons.points, cubes=1000)
    for one, other in zip(full, coarse, strict=True):
        assert {*one.owner} == {*other.owner}
        assert other.facets.shape[1] == 4
        totals = []
        for surface in (one, other):
            at = hexagons.points[surface.nodes[surface.facets]]
            around = at - at[:, :1]
            crossed = np.cross(around[:, 1:-1], around[:, 2:]).sum(axis=1)
            totals.append(np.linalg.norm(crossed, axis=1).sum())
        assert totals[0] == pytest.approx(totals[1])


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), whole=st.booleans())
def test_a_section_has_one_polygon_of_each_cell(hexagons, seed, whole):
    random = np.random.default_rng(seed)
    normal = random.normal(size=3)
    origin = random.uniform(hexagons.points.min(axis=0), hexagons.points.max(axis=0))
    plane = Section.of("plane", tuple(origin), tuple(normal / np.linalg.norm(normal)), 0.0)
    cutter = Cutter(hexagons)
    cut = cutter.cut(hexagons.points, plane)
    parts = Cutter(Mesh(hexagons.points, hexagons.cells)).cut(hexagons.points, plane)
    assert areas(cut).sum() == pytest.approx(areas(parts).sum())
    assert len({*cut.cells}) == len(cut)
    assert {*hexagons.whole_cells[cut.cells]} == {*hexagons.whole_cells[parts.cells]}
    assert {*cut.cells} <= {*np.flatnonzero(np.diff(hexagons.whole_cells, prepend=-1))}
    if whole:
        sides = cutter.surface(hexagons.points, cut.cell_ids)
        assert {*sides.sizes} <= {4, 6}
        assert {*sides.cells} <= {*cut.cells}


def test_cells_of_a_plane_are_drawn_in_one_piece(flat):
    assert len(flat.cells) == 54
    cells = Cutter(flat).all_cells(flat.points)
    assert cells.sizes.tolist() == [6] * 9
    assert areas(cells) == pytest.approx(1.5 * np.sqrt(3))
    shape = part_shape(flat, np.array([1, 7]))
    assert shape.GetPolys().GetNumberOfCells() == 2
    assert shape.cell_data[CELL].tolist() == [0, 6]
    [surface] = find_surfaces(flat)
    assert surface.facets.shape == (22, 2)


@pytest.mark.parametrize("chosen", [[0], [3], [17, 18]])
def test_any_part_stands_for_its_polyhedron(hexagons, chosen):
    shape = part_shape(hexagons, np.array(chosen))
    sizes = np.diff(np.array(shape.GetPolys().GetOffsetsArray()))
    count = len({*hexagons.whole_cells[chosen]})
    assert Counter(sizes) == {4: 6 * count, 6: 2 * count}
    assert shape.point_data[POINT].max() < len(hexagons.points) - 18


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), groups=st.integers(1, 12))
def test_polygons_of_a_group_are_one_if_a_simple_line_is_around_them(seed, groups):
    cells = grid((4, 4), kind="mixed").cells
    random = np.random.default_rng(seed)
    group = random.integers(0, groups, len(cells))
    offsets, nodes, kept = outlines(cells.offsets, cells.connectivity, group)
    assert len({*kept}) == len(kept)
    pieces = np.split(nodes, offsets[1:-1])
    for number in {*group.tolist()}:
        mine = [piece.tolist() for piece, k in zip(pieces, kept, strict=True) if group[k] == number]
        all_nodes = np.split(cells.connectivity, cells.offsets[1:-1])
        before = [piece.tolist() for piece, k in zip(all_nodes, group, strict=True) if k == number]

        def lines(polygons):
            every = [(a, b) for p in polygons for a, b in zip(p, [*p[1:], p[0]], strict=True)]
            count = Counter(frozenset(line) for line in every)
            return {line for line in every if count[frozenset(line)] == 1}

        assert lines(mine) == lines(before)
        assert len(mine) in (1, len(before))
        starts = [line[0] for line in lines(before)]
        if len(mine) > 1:
            follow = dict(lines(before))
            walk = [starts[0]]
            while follow[walk[-1]] not in walk:
                walk.append(follow[walk[-1]])
            assert len({*starts}) < len(starts) or len(walk) < len(starts)


def test_elements_are_not_changed(tmp_path):
    mesh = grid((2, 2, 2), kind="mixed")
    read = sv.read(write_mesh(tmp_path, mesh))
    for one, other in zip(find_surfaces(read), find_surfaces(mesh), strict=True):
        assert {frozenset(one.nodes[f]) for f in one.facets} == {
            frozenset(other.nodes[f]) for f in other.facets
        }


def test_cells_of_several_faces_between_the_same_two(tmp_path):
    """Faces that lie in one plane stay apart, as the file has them."""
    mesh = grid((2, 2, 4))
    groups = (mesh.points[mesh.cells.connectivity.reshape(-1, 8)].mean(axis=1)[:, 2] > 0.5) * 1
    cells = merged(sides_of(mesh), groups.tolist())
    patches = {"all": lambda corners: True}
    write_polymesh(tmp_path / "polyMesh", mesh.points, cells, patches)
    [surface] = find_surfaces(sv.read(tmp_path / "polyMesh"))
    assert len(surface.facets) == 2 * 4 + 4 * 8


@pytest.fixture
def folded(hexagons, tmp_path):
    """The case of the hexagons with a node of two cells moved, its mesh, and the folded cells."""
    node = int(np.argmax(hexagons.points[:-18] @ [1.0, -0.9, -0.01]))
    points = hexagons.points.copy()
    points[node] += [-3.0, 1.0, 0.0]
    case = tmp_path / "folded"
    sv.write(f"{case}.foam", hexagons.with_points(points))
    mesh = hexagons.with_points(points)
    parts = sv.quality(Mesh(points, mesh.cells), Mesh(hexagons.points, mesh.cells))
    cells = {*hexagons.whole_cells[parts.inverted_cells()].tolist()}
    assert 0 < len(cells) < 10
    return case, mesh, cells


def test_reports_have_numbers_and_types_of_the_files_cells(folded, hexagons, tmp_path, capsys):
    case, _, cells = folded
    original = hexagons.source.parent
    assert run(["info", str(case), "--json", str(tmp_path / "i.json")]) == 0
    report = json.loads((tmp_path / "i.json").read_text())
    assert (report["cells"], report["cells_by_type"]) == (18, {"polyhedron": 18})
    given = ["quality", str(case), "--reference", str(original)]
    given += ["--metrics", "skewness,aspect-ratio", "--limits", "( inverted = 0 )"]
    assert run([*given, "--json", str(tmp_path / "q.json")]) == 3
    report = json.loads((tmp_path / "q.json").read_text())
    assert {*report["inverted_cells"]} == cells
    assert {one["cell"] for one in report["worst"][: len(cells)]} == cells
    assert {one["type"] for one in report["worst"]} == {"polyhedron"}
    assert {*report["limits"][0]["cells"]} == cells
    assert all(one["worst_at"] < 18 for one in report["metrics"].values())
    assert run([*given, "-o", str(tmp_path / "q.csv")]) == 3
    rows = list(csv.DictReader((tmp_path / "q.csv").read_text().splitlines()))
    assert [int(row["cell"]) for row in rows] == list(range(18))
    assert {int(row["cell"]) for row in rows if row["status"] == "inverted"} == cells
    capsys.readouterr()


@pytest.mark.parametrize("seed", range(3))
def test_a_limit_on_the_margin_counts_every_part(hexagons, seed):
    random = np.random.default_rng(seed)
    points = hexagons.points + random.uniform(-0.05, 0.05, hexagons.points.shape)
    moved = hexagons.with_points(points)
    margins = cell_margins(moved, hexagons)
    first = np.flatnonzero(np.diff(hexagons.whole_cells, prepend=-1))
    least = np.minimum.reduceat(margins, first)
    limit = float(np.median(least))
    [found] = sv.quality(moved, hexagons, limits=f"margin > {limit!r}").limits
    assert found.actual == margins.min() < margins[first].min()
    assert {*found.cells} == {*first[least <= limit]}
    assert len({*found.cells}) == len(found.cells)


@pytest.mark.parametrize("name", [name for name, row in METRICS.items() if row.where == "nodes"])
def test_a_polyhedron_has_the_worst_value_of_all_its_nodes(hexagons, name):
    random = np.random.default_rng(1)
    points = hexagons.points + random.uniform(-0.05, 0.05, hexagons.points.shape)
    found = metric(hexagons.with_points(points), name)
    worst = min if METRICS[name].best == "high" else max
    parts = np.split(hexagons.cells.connectivity, hexagons.cells.offsets[1:-1])
    for number in range(18):
        mine = np.flatnonzero(hexagons.whole_cells == number)
        nodes = np.concatenate([parts[part] for part in mine])
        assert {*found.of_cells[mine]} == {worst(found.values[nodes])}


def test_all_parts_of_a_polyhedron_at_a_wall_have_its_value(hexagons):
    found = walls(hexagons, markers=["ends"])
    heights = found.at_cells("first_height")
    assert len(found.columns.boundary.owner)
    for owner in found.columns.boundary.owner:
        mine = hexagons.whole_cells == hexagons.whole_cells[owner]
        assert len({*heights[mine]}) == 1
        assert np.isfinite(heights[mine]).all()


def test_messages_have_numbers_of_the_files_cells(folded, hexagons, tmp_path, capsys):
    _, mesh, cells = folded
    moved = np.flatnonzero((mesh.points != hexagons.points).any(axis=1))
    shift = (mesh.points - hexagons.points)[moved[0]]
    table = "\n".join(
        f"{k} {' '.join(map(repr, (shift * (k == moved[0])).tolist()))}"
        for k in hexagons.nodes_of(["ends", "sides"])
    )
    (tmp_path / "d.txt").write_text(table)
    (tmp_path / "case.cfg").write_text(
        f"MESH_FILENAME= {hexagons.source.parent}\nMARKER_MOVING= ( sides, ends )\n"
        "DEFORMATION_FILENAME= d.txt\nRELAX= NO\nGENERATE_QUALITY= YES\nSUPPORT_RADIUS= 0.1\n"
    )
    out = tmp_path / "out.foam"
    case = str(tmp_path / "case.cfg")
    assert run(["run", case, "-o", str(out), "--json", str(tmp_path / "r")]) == 3
    report = json.loads((tmp_path / "r").read_text())
    assert {*report["quality"]["inverted_cells"]} == cells
    assert {*report["quality"]["inverted_at_step"]} == {1}
    assert report["safe_cell"] in cells
    assert report["safe_kind"] == "polyhedron"
    words = capsys.readouterr().err
    assert f"{len(cells)} of 18 cells are inverted: {min(cells)} (polyhedron, step 1)" in words
    assert len((tmp_path / "out" / "out_qual.txt").read_text().split()) == 18
    plane = ",".join(map(str, (0.0, 0.0, 1.0, *mesh.points[moved[0]][:2], 0.5)))
    given = ["section", str(tmp_path / "out"), "--reference", str(hexagons.source.parent)]
    given += ["--plane", plane, "-o", str(tmp_path / "s.svg"), "--json", str(tmp_path / "s")]
    assert run(given) == 3
    report = json.loads((tmp_path / "s").read_text())
    assert report["worst_cell"] in cells
    assert report["cells"] <= 9


def test_repair_counts_the_files_cells(folded, hexagons, capsys):
    _, mesh, cells = folded
    done = sv.repair(mesh, hexagons, fixed=["ends", "sides"])
    assert {*done.folded.tolist()} == cells
    assert {*done.cells.tolist()} >= cells
    assert {cell for cell, _ in done.unmendable} <= cells
    assert done.report()["folded_before"] == len(cells)
    capsys.readouterr()


def test_the_window_names_cells_of_the_file(folded, hexagons, tmp_path):
    _, mesh, cells = folded
    frame = StepFrame(mesh, sv.quality(mesh, hexagons))
    session = open_mesh(StepFrame(hexagons, sv.quality(hexagons)), None)
    session = changes.add_frames(changes.start_run(session), [frame])
    worst = worst_cells(session.frames, 1, "size-skew")
    assert {*worst.known_as[: len(cells)].tolist()} == cells
    assert len(worst) == 18
    assert {*worst.kinds} == {"polyhedron"}
    cell = int(worst.cells[0])
    info = cell_info(frame, cell)
    assert (info.cell, info.kind, info.state) == (worst.known_as[0], "polyhedron", "inverted")
    assert info.position == pytest.approx(worst.positions[0])
    assert (info.jacobians < 0).any()
    session = changes.mark_cell(session, cell)
    assert mark_words(session) == f"cell {info.cell}: inverted"
    save_quality(tmp_path / "w.csv", frame, Job())
    rows = list(csv.DictReader((tmp_path / "w.csv").read_text().splitlines()))
    assert len(rows) == 18
    assert {int(row["cell"]) for row in rows if row["status"] == "inverted"} == cells


def test_cells_of_several_regions_are_numbered_one_after_the_other(tmp_path):
    for name in ("one", "two"):
        where = tmp_path / "constant" / name / "polyMesh"
        write_polymesh(where, *extruded(*honeycomb(), [0.0, 1.0]), ENDS)
    text = "FoamFile { format ascii; }\nregions ( fluid (one two) );\n"
    (tmp_path / "constant" / "regionProperties").write_text(text)
    mesh = sv.read(tmp_path)
    assert mesh.file_counts[1] == 18
    assert [part.first_cell for part in mesh.parts] == [0, 9]
    frame = StepFrame(mesh, sv.quality(mesh))
    last = len(mesh.cells) - 1
    info = cell_info(frame, last)
    assert (info.cell, info.zone) == (17, 2)
    assert tuple(sorted(worst_cells([frame], 0, "size-skew").zones)) == (1,) * 9 + (2,) * 9


def test_a_point_of_a_plane_is_in_the_cell_of_the_file(flat):
    values = np.ones(len(flat.cells))
    for number, (x, y) in enumerate(cell_centers(flat, np.arange(0, 54, 6))):
        assert cell_at(flat, x + 0.4, y + 0.2, values) == 6 * number
