"""CGNS files are read as their standard says; VTK's own reader is the judge."""

from itertools import pairwise

import h5py
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOCGNSReader import vtkCGNSReader

from slideviz.errors import MeshError
from slideviz.formats.cgns.read import read_cgns
from slideviz.formats.files import read
from slideviz.mesh.periodic import match
from tests.builders import box_rules, make_mesh
from tests.cgns_files import (
    PITCH,
    add_period,
    base,
    block,
    cgns_root,
    condition,
    interface,
    lists,
    node,
    passage_grid,
    save_passage,
    section,
    wavy,
    zone,
)
from tests.formats.su2_samples import SOLID, SQUARE, bits, save


def as_sets(mesh):
    """Return cells and markers as sets of positions, whatever the numbers are."""
    at = [tuple(point) for point in mesh.points.tolist()]

    def sets(cells):
        flat, ends = cells.connectivity.tolist(), cells.offsets.tolist()
        return sorted(sorted(at[k] for k in flat[a:b]) for a, b in pairwise(ends))

    return sets(mesh.cells), {marker.name: sets(marker.cells) for marker in mesh.markers}


def judged(path, bnd=False):
    """Return what VTK's own reader reads: {zone: dataset}, or patches as {(zone, name): ...}."""
    reader = vtkCGNSReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    reader.EnableAllBases()
    reader.EnableAllFamilies()
    reader.SetDoublePrecisionMesh(True)
    reader.SetLoadBndPatch(bnd)
    reader.Update()
    found = {}

    def walk(block, names):
        for k in range(block.GetNumberOfBlocks()):
            one = block.GetBlock(k)
            here = [*names, block.GetMetaData(k).Get(block.NAME())]
            if one is None:
                continue
            if one.IsA("vtkMultiBlockDataSet"):
                walk(one, here)
            else:
                found[tuple(here[1:])] = one

    walk(reader.GetOutput(), [])
    return found


def points_of(data):
    return vtk_to_numpy(data.GetPoints().GetData())


def cells_of(data):
    """Return (type, nodes) of each cell of a VTK dataset."""
    return [
        (data.GetCellType(k), [data.GetCell(k).GetPointId(n) for n in range(cell_size(data, k))])
        for k in range(data.GetNumberOfCells())
    ]


def cell_size(data, k):
    return data.GetCell(k).GetNumberOfPoints()


@pytest.fixture(scope="module")
def passage(tmp_path_factory):
    return save_passage(tmp_path_factory.mktemp("cgns") / "passage.cgns", passage_grid())


def expected_passage(grid):
    """Return the passage made without the code under test."""
    shape = [n - 1 for n in grid.shape[:3]]
    index = np.arange(grid[..., 0].size).reshape(grid.shape[:3])
    corners = [
        index[i : i + n, j : j + m, k : k + o].ravel()
        for n, m, o in [shape]
        for i, j, k in (
            *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)),
            *((0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
        )
    ]
    params = np.stack(np.unravel_index(index.ravel(), index.shape), axis=1)
    names = {"x_m": "INFLOW", "x_p": "OUTFLOW", "y_m": "lower", "y_p": "upper", "z_p": "SHROUD"}
    rules = [(names[name], rule) for name, rule in box_rules(shape) if name in names]
    half = len(grid) // 2
    rules.append(("BLADE", lambda p: bool(np.all(p[:, 2] == 0) and np.all(p[:, 0] <= half))))
    rules.append(("HUB", lambda p: bool(np.all(p[:, 2] == 0))))
    return make_mesh(grid.reshape(-1, 3), [(12, np.stack(corners, axis=1))], rules, params)


def test_two_blocks_are_one_mesh(passage):
    mesh, wanted = read(passage), expected_passage(passage_grid())
    assert len(mesh.points) == len(wanted.points) == 7 * 5 * 4
    assert as_sets(mesh) == as_sets(wanted)
    assert mesh.remarks == ()
    assert (mesh.name, mesh.source) == ("passage.cgns", passage)
    pair = match(mesh, "lower", "upper")
    assert pair.describe() == match(wanted, "lower", "upper").describe()
    assert "0.7" in pair.describe()


@pytest.mark.parametrize(("real", "whole"), [("f8", "i4"), ("f4", "i8")])
def test_points_and_cells_are_those_of_vtk(tmp_path, real, whole):
    grid = passage_grid((4, 3, 2))
    path = save_passage(tmp_path / "a.cgns", grid, real, whole)
    mesh = read_cgns(path)
    seen = judged(path)
    assert sorted(seen) == [("blk-1", "Internal"), ("blk-2", "Internal")] or sorted(seen) == [
        ("blk-1",),
        ("blk-2",),
    ]
    theirs = []
    for data, number in zip(seen.values(), mesh.origin.numbers, strict=True):
        assert bits(points_of(data)) == bits(mesh.points[number])
        theirs += [sorted(number[nodes].tolist()) for _, nodes in cells_of(data)]
    ends = mesh.cells.offsets
    flat = mesh.cells.connectivity
    ours = [sorted(flat[a:b].tolist()) for a, b in pairwise(ends)]
    assert ours == theirs


def test_boundaries_are_those_of_vtk(passage):
    mesh, seen = read(passage), judged(passage, bnd=True)
    family = {"in": "INFLOW", "out": "OUTFLOW", "blade": "BLADE", "hub": "HUB"}
    found = [key for key in seen if key[-1] in family]
    assert len(found) == 4
    for key in found:
        theirs = {tuple(point) for point in points_of(seen[key]).tolist()}
        marker = mesh.marker(family[key[-1]])
        assert {tuple(point) for point in mesh.points[marker.nodes].tolist()} == theirs
        assert len(marker.cells) == seen[key].GetNumberOfCells()


def test_volumes_are_positive_whichever_way_a_block_is_turned(passage):
    from slideviz.mesh.quality import quality

    mesh = read(passage)
    assert quality(mesh).inverted == 0
    from slideviz.mesh.orientation import corner_sums

    assert (corner_sums(mesh) > 0).all()


# Unstructured ------------------------------------------------------------------------------


def columns_of(mesh, real="f8"):
    return [np.ascontiguousarray(mesh.points[:, k], real) for k in range(mesh.dim)]


CGNS_TYPE = {3: 3, 5: 5, 9: 7, 10: 10, 14: 12, 13: 14, 12: 17}


def nodes_of(cells):
    """Return (VTK type, nodes from 1) of each cell."""
    ends = cells.offsets.tolist()
    flat = (cells.connectivity + 1).tolist()
    return [(int(vtk), flat[a:b]) for vtk, a, b in zip(cells.types, ends, ends[1:], strict=False)]


def save_unstructured(path, mesh, mixed="", physical=None, given="PointList", whole="i4"):
    """Write a mesh as sections of cells, or as MIXED, and its markers as conditions."""
    with cgns_root(path) as file:
        columns = columns_of(mesh)
        if physical == 3 and mesh.dim == 2:
            columns.append(np.full(len(mesh.points), 0.25))
        sizes = ([len(mesh.points)], [len(mesh.cells)])
        top = zone(base(file, mesh.dim, physical), "zone 1", sizes, columns, "Unstructured", whole)
        rows = nodes_of(mesh.cells)
        for marker in mesh.markers:
            rows += nodes_of(marker.cells)
        if mixed:
            flat = np.concatenate([[CGNS_TYPE[vtk], *nodes] for vtk, nodes in rows])
            group = section(top, "all", 20, 1, len(rows), flat, whole)
            if mixed == "offsets":
                ends = np.cumsum([0, *(len(nodes) + 1 for _, nodes in rows)])
                node(group, "ElementStartOffset", "DataArray_t", ends.astype(whole))
        else:
            for number, (vtk, nodes) in enumerate(rows, 1):
                section(top, f"s{number}", CGNS_TYPE[vtk], number, 1, nodes, whole)
        at = len(mesh.cells) + 1
        where = "EdgeCenter" if mesh.dim == 2 else "FaceCenter"
        for marker in mesh.markers:
            numbers = np.arange(at, at + len(marker.cells))
            ends = [[numbers[0]], [numbers[-1]]]
            if given.endswith("Range"):
                label, values = "IndexRange_t", ends
            else:
                label, values = "IndexArray_t", numbers[:, None]
            here = "" if given.startswith("Element") else where
            if given == "Vertex":
                label, values, here = "IndexArray_t", marker.nodes[:, None] + 1, "Vertex"
            child = "PointList" if given == "Vertex" else given
            condition(top, marker.name, values, where=here, label=label, child=child)
            at += len(marker.cells)
    return path


def as_rows(mesh):
    return nodes_of(mesh.cells), {m.name: nodes_of(m.cells) for m in mesh.markers}


@pytest.mark.parametrize("given", ["PointList", "PointRange", "ElementList", "ElementRange"])
@pytest.mark.parametrize("text", [SQUARE, SOLID], ids=["2D", "3D"])
def test_sections_are_cells_and_markers(tmp_path, text, given):
    mesh = read(save(tmp_path, text))
    path = save_unstructured(tmp_path / "a.cgns", mesh, given=given)
    found = read_cgns(path)
    assert bits(found.points) == bits(mesh.points)
    assert as_rows(found) == as_rows(mesh)
    assert found.remarks == ()


@pytest.mark.parametrize("mixed", ["plain", "offsets"])
@pytest.mark.parametrize("text", [SQUARE, SOLID], ids=["2D", "3D"])
def test_mixed_sections(tmp_path, text, mixed):
    mesh = read(save(tmp_path, text))
    found = read_cgns(save_unstructured(tmp_path / "a.cgns", mesh, mixed, whole="i8"))
    assert as_rows(found) == as_rows(mesh)


@pytest.mark.parametrize("text", [SQUARE, SOLID], ids=["2D", "3D"])
@pytest.mark.parametrize("mixed", ["", "offsets"])
def test_unstructured_cells_are_those_of_vtk(tmp_path, text, mixed):
    path = save_unstructured(tmp_path / "a.cgns", read(save(tmp_path, text)), mixed)
    mesh = read_cgns(path)
    (data,) = judged(path).values()
    theirs = points_of(data)
    assert bits(theirs[:, : mesh.dim]) == bits(mesh.points)
    seen = [(vtk, [n + 1 for n in nodes]) for vtk, nodes in cells_of(data)]
    inside = [row for row in seen if row[0] in mesh.cells.by_type]
    assert inside[: len(mesh.cells)] == nodes_of(mesh.cells)


def test_vertices_are_the_faces_between_them(tmp_path):
    mesh = read(save(tmp_path, SOLID))
    path = save_unstructured(tmp_path / "a.cgns", mesh, given="Vertex")
    found = read_cgns(path)
    assert {m.name: sorted(m.nodes.tolist()) for m in found.markers} == {
        m.name: sorted(m.nodes.tolist()) for m in mesh.markers
    }
    assert [len(m.cells) for m in found.markers] == [len(m.cells) for m in mesh.markers]


def test_vertices_of_a_block_and_a_range_of_them(tmp_path):
    with cgns_root(tmp_path / "a.cgns") as file:
        one = block(base(file, 3), "b", passage_grid((2, 2, 2)))
        side = [[1, j, k] for k in (1, 2, 3) for j in (1, 2, 3)]
        condition(one, "in", side, label="IndexArray_t", child="PointList")
    mesh = read_cgns(tmp_path / "a.cgns")
    assert len(mesh.marker("in").cells) == 4
    assert set(mesh.points[mesh.marker("in").nodes, 0]) == {0.0}
    flat = read(save(tmp_path, SQUARE))
    path = save_unstructured(tmp_path / "b.cgns", flat)
    with h5py.File(path, "a") as file:
        condition(file["Base/zone 1"], "upper wall", [[4], [6]], where="Vertex")
    assert as_rows(read_cgns(path))[1]["upper wall"] == [(3, [6, 5]), (3, [5, 4])]


def test_a_flat_mesh_in_space_is_2d(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    found = read_cgns(save_unstructured(tmp_path / "a.cgns", mesh, physical=3))
    assert found.dim == 2
    assert as_rows(found) == as_rows(mesh)


def test_sections_name_boundaries_without_conditions(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    path = save_unstructured(tmp_path / "a.cgns", mesh)
    with h5py.File(path, "a") as file:
        del file["Base/zone 1/ZoneBC"]
    assert read_cgns(path).marker_names == ("s4", "s5", "s6")
    with h5py.File(path, "a") as file:
        for name in ("s4", "s5", "s6"):
            del file[f"Base/zone 1/{name}"]
    names = read_cgns(path).marker_names  # of the outer surface
    assert names[0] == "boundary_1"
    assert len(names) == 4


# Structured in 2D, and how zones meet ------------------------------------------------------


def flat_grid(nx, ny, x=(0.0, 1.0), y=(0.0, 1.0)):
    return np.stack(
        np.meshgrid(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1), indexing="ij"), axis=-1
    )


def ring_grid(around=8, out=2):
    """Return the vertices of an O-grid, whose first and last line in i are one."""
    angle = np.linspace(0, 2 * np.pi, around + 1)
    radius = np.linspace(1, 2, out + 1)
    x = np.cos(angle)[:, None] * radius
    y = np.sin(angle)[:, None] * radius
    x[-1], y[-1] = x[0], y[0]
    return np.stack((x, y), axis=-1)


def test_an_o_grid_meets_itself(tmp_path):
    with cgns_root(tmp_path / "a.cgns") as file:
        one = block(base(file, 2), "o", ring_grid())
        condition(one, "wall", [[1, 1], [9, 1]])
        condition(one, "far", [[1, 3], [9, 3]], "/Base/FAR")
        condition(one, "faces", [[1, 2], [8, 2]], where="JFaceCenter")
        interface(one, "cut", "o", [[1, 1], [1, 3]], [[9, 1], [9, 3]], [1, 2])
    mesh = read_cgns(tmp_path / "a.cgns")
    assert len(mesh.points) == 8 * 3
    assert {m.name: len(m.cells) for m in mesh.markers} == {"wall": 8, "FAR": 8, "faces": 8}
    radius = np.hypot(*mesh.points[mesh.marker("faces").nodes].T)
    assert np.allclose(radius, 1.5)


def two_squares(path, gap=0.0, joined=None, families=("", "")):
    """Write two squares side by side, and between them what ``joined`` adds."""
    with cgns_root(path) as file:
        top = base(file, 2)
        left = block(top, "left", flat_grid(2, 2))
        right = block(top, "right", flat_grid(2, 2, (1.0 + gap, 2.0)))
        condition(left, "in", [[1, 1], [1, 3]], families[0])
        condition(right, "out", [[3, 1], [3, 3]], families[1])
        if joined:
            joined(left, right)
    return path


EDGE, OTHER = [[3, 1], [3, 2], [3, 3]], [[1, 1], [1, 2], [1, 3]]


def test_lists_of_vertices_join_zones(tmp_path):
    path = two_squares(
        tmp_path / "a.cgns", joined=lambda a, b: lists(a, "ab", "right", EDGE, OTHER)
    )
    mesh = read_cgns(path)
    assert len(mesh.points) == 15
    assert mesh.marker_names == ("in", "out")
    assert mesh.remarks == ()


def test_conditions_of_one_family_are_one_boundary(tmp_path):
    path = two_squares(
        tmp_path / "a.cgns",
        joined=lambda a, b: lists(a, "ab", "right", EDGE, OTHER),
        families=("OPEN", "OPEN"),
    )
    mesh = read_cgns(path)
    assert mesh.marker_names == ("OPEN",)
    assert len(mesh.marker("OPEN").cells) == 4


def test_zones_that_are_not_joined_are_told(tmp_path):
    mesh = read_cgns(two_squares(tmp_path / "a.cgns"))
    assert len(mesh.points) == 18
    (told,) = mesh.remarks
    assert told.startswith("The zones are not all joined: left; right. Where they touch, nothing")


@pytest.mark.parametrize("kind", ["Abutting", "Overset"])
def test_what_is_not_one_to_one_is_a_boundary(tmp_path, kind):
    path = two_squares(
        tmp_path / "a.cgns", joined=lambda a, b: lists(a, "mix", "right", EDGE, OTHER, kind)
    )
    mesh = read_cgns(path)
    assert mesh.marker_names == ("in", "out", "mix")
    assert set(mesh.points[mesh.marker("mix").nodes, 0]) == {1.0}
    assert mesh.remarks[0] == (
        f"/Base/left/ZoneGridConnectivity/mix is not joined: it is {kind}, not one to one. Its "
        "faces are a boundary 'mix'."
    )


def test_nodes_that_lie_apart_are_not_joined(tmp_path):
    path = two_squares(tmp_path / "a.cgns", 1e-3, lambda a, b: lists(a, "ab", "right", EDGE, OTHER))
    mesh = read_cgns(path)
    assert len(mesh.points) == 18
    assert mesh.remarks[0].startswith(
        "/Base/left/ZoneGridConnectivity/ab is not joined: its nodes lie up to 0.001 from the "
        "nodes of right, more than 2e-06 (1e-06 of the extent). Its faces are a boundary 'ab'."
    )
    near = two_squares(tmp_path / "b.cgns", 1e-7, lambda a, b: lists(a, "ab", "right", EDGE, OTHER))
    assert len(read_cgns(near).points) == 15


def test_faces_of_unstructured_zones_are_joined(tmp_path):
    with cgns_root(tmp_path / "a.cgns") as file:
        top = base(file, 2)
        for name, x in (("left", 0.0), ("right", 1.0)):
            grid = flat_grid(1, 2, (x, x + 1.0))
            columns = [np.ascontiguousarray(grid[..., k].T).ravel() for k in range(2)]
            one = zone(top, name, ([6], [2]), columns, "Unstructured")
            section(one, "quads", 7, 1, 2, [1, 2, 4, 3, 3, 4, 6, 5])
            edge = [2, 4, 4, 6] if name == "left" else [5, 3, 3, 1]
            section(one, "edges", 3, 3, 2, edge)
            other, here = ("right", [[3], [4]]) if name == "left" else ("left", [[4], [3]])
            lists(one, "ab", other, here, here, where="EdgeCenter")
    mesh = read_cgns(tmp_path / "a.cgns")
    assert len(mesh.points) == 9
    assert mesh.remarks == ()


def test_periods_are_boundaries_by_their_first_names(tmp_path):
    wedge = 2 * np.pi / 8
    with cgns_root(tmp_path / "a.cgns") as file:
        one = block(base(file, 2), "o", ring_grid(8)[:3])
        condition(one, "wall", [[1, 1], [3, 1]])
        low, high = [[1, 1], [1, 3]], [[3, 1], [3, 3]]
        for name, here, there, sign in (("p", low, high, 1), ("q", high, low, -1)):
            interface(
                one, name, "o", here, there, [1, 2], ([0] * 3, [0, 0, sign * 2 * wedge], [0] * 3)
            )
        # Of an interface whose faces have a condition nothing is left.
        interface(
            one, "r", "o", [[1, 1], [3, 1]], [[1, 3], [3, 3]], [1, 2], ([0] * 3, [0] * 3, [1, 0, 0])
        )
        nothing = lists(one, "none", "o", [[1, 1]], [[1, 1]])
        add_period(nothing, [0] * 3, [0] * 3, [0] * 3)
    mesh = read_cgns(tmp_path / "a.cgns")
    assert {m.name: len(m.cells) for m in mesh.markers} == {"wall": 2, "p": 2, "q": 2}
    assert "90" in match(mesh, "p", "q").describe()


def test_links_inside_a_file_are_followed(passage, tmp_path):
    path = save_passage(tmp_path / "a.cgns", passage_grid())
    with h5py.File(path, "a") as file:
        file.move("Base/blk-1/GridCoordinates", "Grid1")
        link = node(file["Base/blk-1"], "GridCoordinates", "")
        link.attrs.create("type", np.bytes_("LK"), dtype="S3")
        link[" link"] = h5py.SoftLink("/Grid1")
    assert as_sets(read_cgns(path)) == as_sets(read_cgns(passage))
    with h5py.File(path, "a") as file:
        del file["Grid1"]
    with pytest.raises(MeshError, match="/Base/blk-1/GridCoordinates: is a link to a node that is"):
        read_cgns(path)
    with h5py.File(path, "a") as file:
        link = file["Base/blk-1/GridCoordinates"]
        del link[" link"]
        link[" link"] = h5py.ExternalLink("other.cgns", "/Grid1")
    with pytest.raises(MeshError, match=r"an external link to 'other.cgns', which is not read"):
        read_cgns(path)


def test_the_passage_repeats_as_it_should():
    low, high = wavy(np.array([[0.3, 0.0, 0.5]])), wavy(np.array([[0.3, 1.0, 0.5]]))
    assert np.allclose(high - low, [[0, PITCH, 0]])


# What is wrong -----------------------------------------------------------------------------


def delete(name):
    def change(file):
        del file[name]

    return change


def put(name, *values, kind=None):
    """Return what gives a node another value."""

    def change(file):
        old = file[f"{name}/ data"]
        new = np.ravel(values)
        if isinstance(values[0], str):
            new = np.frombuffer(values[0].encode(), "i1")
        shape = old.shape if new.size == old.size else new.shape
        del file[f"{name}/ data"]
        file[name][" data"] = new.reshape(shape).astype(kind or old.dtype)

    return change


def rind(name, *values):
    return lambda file: node(file[name], "Rind", "Rind_t", np.array(values, "i4"))


def second_base(file):
    file.copy("Base", "Other")
    file["Other"].attrs["name"] = np.bytes_("Other")


def two_sections(file):
    section(file["Base/zone 1"], "twice", 7, 2, 1, [1, 2, 3, 4])


def cylindrical(file):
    file.move("Base/blk-1/GridCoordinates/CoordinateX", "Base/blk-1/GridCoordinates/CoordinateR")


Z1, BC, GC = "Base/zone 1", "Base/blk-1/ZoneBC", "Base/blk-1/ZoneGridConnectivity"
GRID = "Base/blk-1/GridCoordinates"

MISTAKES = [
    (second_base, "has 2 bases (Base, Other), each a mesh of its own; export one base to a file"),
    (delete("Base"), "has no zones (CGNSBase_t, Zone_t in it), so there is no mesh"),
    (put("Base", 1, 3), "/Base: has cells of dimension 1 and 3 coordinates; expected 2 or 3"),
    (put("Base", 2, 3), "/Base/blk-1: it is structured with 4 x 5 x 4 vertices, but has cells of"),
    (put("Base", 7), "/Base: has 1 numbers of shape (1,); expected 2: export the mesh again"),
    (put("Base/blk-1", 9, 5, 4, 8, 4, 3, 0, 0, 0), "CoordinateX: has 4 x 5 x 4 values, but the z"),
    (put("Base/blk-1", 0.5, kind="f8"), "/Base/blk-1: has a value of type float64; expected I4"),
    (delete("Base/blk-1/ data"), "/Base/blk-1: has no value; export the mesh again, or check it"),
    (put("Base/blk-1/ZoneType", "Sound"), "/Base/blk-1: its ZoneType is 'Sound'; it must be Str"),
    (
        put("Base/blk-1/ZoneType", 0.5, kind="f8"),
        "ZoneType: has a value of type float64; a text is",
    ),
    (delete(GRID), "/Base/blk-1: has no GridCoordinates (GridCoordinates_t); export the mesh"),
    (
        cylindrical,
        "/GridCoordinates: has no CoordinateX, but CoordinateY, CoordinateZ, CoordinateR",
    ),
    (rind(GRID, 1, 1, 0, 0, 0, 0), "GridCoordinates/Rind: the coordinates have rind planes"),
    (put(f"{GRID}/CoordinateY", np.full(80, np.nan)), "CoordinateY: is nan at vertex 1, which is"),
    (put(f"{GRID}/CoordinateY", np.ones(80), kind="i4"), "is of type int32; expected R4 or R8"),
    (put(f"{BC}/in/PointRange", 1, 1, 1, 9, 5, 4), "goes from (1, 1, 1) to (9, 5, 4), which is no"),
    (
        put(f"{BC}/in/PointRange", 9, 1, 1, 9, 5, 4),
        "names the vertex (9, 1, 1), but the vertices of blk",
    ),
    (put(f"{BC}/tip/PointRange", 1, 1, 4, 4, 2, 4), "ends at (4, 2, 4), but the zone has 3 x 4 x"),
    (put(f"{BC}/in/PointRange", 1, 1), "has 2 numbers of shape (2,); expected n x 3: expo"),
    (delete(f"{BC}/in/PointRange"), "/ZoneBC/in: has no PointRange, PointList, ElementRange or"),
    (put(f"{BC}/tip/GridLocation", "CellCenter"), "tip: its GridLocation is CellCenter; boundari"),
    (put(f"{GC}/mid", "blk-9"), "mid: is an interface with the zone 'blk-9', which the base does"),
    (put(f"{GC}/mid/Transform", 1, 1, 2), "its Transform is [1, 1, 2], but must have 1 to 3 once"),
    (put(f"{GC}/mid/Transform", 2, 3, 1), "its PointRangeDonor ends at (1, 1, 5), but by its Tra"),
]

SECTIONS = [
    (put(f"{Z1}/s1", 22, 0), "/Base/zone 1/s1: has polygons and polyhedra (NGON_n), but slideviz"),
    (put(f"{Z1}/s1", 18, 0), "s1: has elements of high order (HEXA_20), but slideviz needs linear"),
    (put(f"{Z1}/s1", 99, 0), "/Base/zone 1/s1: has elements of high order (99), but slideviz nee"),
    (
        put(f"{Z1}/s1", 20, 0),
        "s1: its element 1 is of type UserDefined, but its ElementRange has 1, and th",
    ),
    (put(f"{Z1}/s1/ElementRange", 1, 2), "s1: its ElementConnectivity has 4 nodes, but the 2 ele"),
    (put(f"{Z1}/s1/ElementRange", 3, 1), "s1: its ElementRange is 3 to 1; it must rise from 1"),
    (put(f"{Z1}/s1/ElementConnectivity", 1, 2, 5, 9), "s1: has node 9, but the 6 vertices of the"),
    (
        two_sections,
        "twice: its ElementRange begins with 2, but another section has the elements to",
    ),
    (rind(f"{Z1}/s1", 0, 1), "s1/Rind: the section has rind elements, which are not read"),
    (put(f"{Z1}/ZoneBC/lower/PointList", 1, 2), "PointList: names element 1, but the sections of"),
    (delete(f"{Z1}/s1/ElementConnectivity"), "/Base/zone 1/s1: has no ElementConnectivity (Data"),
    (put("Base", 3, 3), "/Base/zone 1/GridCoordinates: has no CoordinateZ, but CoordinateX, Coor"),
]


@pytest.mark.parametrize(
    ("change", "told"),
    [*MISTAKES, *SECTIONS],
    ids=lambda one: one[:30] if isinstance(one, str) else "file",
)
def test_mistakes_have_node_rule_and_remedy(tmp_path, change, told):
    path = tmp_path / "a.cgns"
    if (change, told) in SECTIONS:
        save_unstructured(path, read(save(tmp_path, SQUARE)))
    else:
        save_passage(path, passage_grid())
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(MeshError) as caught:
        read_cgns(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert told in message
    assert "; " in message or ": export" in message
    assert "\n" not in message


def change_mixed(path, at, value):
    with h5py.File(path, "a") as file:
        file["Base/zone 1/all/ElementConnectivity/ data"][at] = value


def test_mistakes_in_mixed_sections(tmp_path):
    path = save_unstructured(tmp_path / "a.cgns", read(save(tmp_path, SOLID)), "plain")
    change_mixed(path, 9, 19)
    told = "all: its element 2 is of type HEXA_27, but its ElementRange has 7, and those in MIXED"
    with pytest.raises(MeshError, match=told):
        read_cgns(path)
    change_mixed(path, 9, 14)
    with pytest.raises(MeshError, match=r"all: its element \d is of type"):
        read_cgns(path)


def list_faces(one, name, where, points):
    condition(one, name, points, where=where, label="IndexArray_t", child="PointList")


def test_listed_faces_of_blocks_need_a_direction(tmp_path):
    for where in ("IFaceCenter", "FaceCenter"):
        with cgns_root(tmp_path / "a.cgns") as file:
            one = block(base(file, 3), "b", passage_grid((2, 2, 2)))
            list_faces(one, "some", where, [[1, 1, 1], [1, 2, 2]])
        if where == "FaceCenter":
            with pytest.raises(MeshError, match="some/PointList: lists faces of a structured zone"):
                read_cgns(tmp_path / "a.cgns")
        else:
            mesh = read_cgns(tmp_path / "a.cgns")
            assert len(mesh.marker("some").cells) == 2
            assert set(mesh.points[mesh.marker("some").nodes, 0]) == {0.0}


def test_elements_of_blocks_do_not_exist(tmp_path):
    with cgns_root(tmp_path / "a.cgns") as file:
        one = block(base(file, 2), "b", flat_grid(2, 2))
        condition(one, "some", [1], label="IndexArray_t", child="ElementList")
    with pytest.raises(MeshError, match="ElementList: names elements, which a structured zone doe"):
        read_cgns(tmp_path / "a.cgns")


def test_lists_of_different_lengths(tmp_path):
    path = two_squares(
        tmp_path / "a.cgns", joined=lambda a, b: lists(a, "ab", "right", EDGE, OTHER[:2])
    )
    with pytest.raises(MeshError, match="PointListDonor: has 2 vertices for 3 of left; an interf"):
        read_cgns(path)
    path = two_squares(
        tmp_path / "a.cgns", joined=lambda a, b: lists(a, "ab", "right", EDGE, [[9, 9]] * 3)
    )
    with pytest.raises(MeshError, match=r"names the vertex \(9, 9\), but the vertices of right"):
        read_cgns(path)


def test_a_surface_in_space_is_refused(tmp_path):
    grid = np.pad(flat_grid(2, 2), ((0, 0), (0, 0), (0, 1)))
    grid[0, 0, 2] = 1.0
    with cgns_root(tmp_path / "a.cgns") as file:
        block(base(file, 2, 3), "b", grid)
    with pytest.raises(MeshError, match="this is a surface in space, but a mesh of triangles and"):
        read_cgns(tmp_path / "a.cgns")


def test_what_covers_nothing_is_told(tmp_path):
    with cgns_root(tmp_path / "a.cgns") as file:
        one = block(base(file, 2), "b", flat_grid(2, 2))
        condition(one, "corner", [[1, 1], [1, 1]])
        condition(one, "wall", [[1, 1], [1, 3]])
    mesh = read_cgns(tmp_path / "a.cgns")
    assert mesh.marker_names == ("wall",)
    assert mesh.remarks == ("/Base/b/ZoneBC/corner covers no face of its zone and is left out.",)


def test_files_of_the_old_kind(tmp_path):
    path = save(tmp_path, b"@(#)ADF Database Version A02011>" + bytes(200), "old.cgns")
    with pytest.raises(
        MeshError, match=r"old.cgns: is a CGNS file of the old kind \(ADF\), .* cgnsc"
    ):
        read(path)


@pytest.mark.parametrize(
    "part",
    [pytest.param(0.2, marks=pytest.mark.slow), 0.5, pytest.param(0.9, marks=pytest.mark.slow)],
)
def test_files_that_end_too_soon(passage, tmp_path, part):
    data = passage.read_bytes()
    path = save(tmp_path, data[: int(part * len(data))], "a.cgns")
    with pytest.raises(MeshError, match=r"a.cgns: cannot be read as CGNS: .*; the file is damaged"):
        read(path)


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))]
)
def test_changed_bytes_are_read_or_refused(passage, tmp_path, seed):
    rng = np.random.default_rng(seed)
    data = np.frombuffer(passage.read_bytes(), "u1").copy()
    data[rng.integers(len(data), size=20)] = rng.integers(256, size=20)
    path = save(tmp_path, data.tobytes(), "a.cgns")
    try:
        said, cells = "a.cgns: ", len(read(path).cells)
    except MeshError as problem:
        said, cells = str(problem), 72
    assert said.startswith((f"{path}: ", "a.cgns: "))
    assert "\n" not in said
    assert cells == 72
