"""Other formats than SU2: what is a boundary, what it is called, and what is refused."""

import errno
import re
import sys
from dataclasses import replace

import meshio
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import slideviz
from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.formats.files import read, read_surface, write
from slideviz.formats.meshio import bridge
from slideviz.formats.meshio.bridge import read_with_meshio
from slideviz.formats.table import FORMATS, MESHIO
from slideviz.mesh.cached_boundary import outer_facets
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, Marker, Mesh, Origin
from tests.builders import square
from tests.formats.su2_samples import SOLID, SQUARE, assert_same, bits, meshes, save

GMSH_22 = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "in flow"
1 2 "wall"
2 9 "fluid"
$EndPhysicalNames
$Nodes
6
1 0.1 0.3 0
2 1.1 0.3 0
3 2.1 0.3 0
4 0.1 1.7 0
5 1.1 1.7 0
6 2.1 1.7 0
$EndNodes
$Elements
9
1 15 2 0 1 1
2 1 2 1 4 4 1
3 1 2 2 1 1 2
4 1 2 2 1 2 3
5 1 2 7 2 4 5
6 1 2 0 3 2 5
7 3 2 9 1 1 2 5 4
8 2 2 9 1 2 3 6
9 2 2 9 1 2 6 5
$EndElements
"""

GMSH_41 = """\
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "inlet"
2 9 "fluid"
$EndPhysicalNames
$Entities
0 1 1 0
4 0.1 0.3 0 0.1 1.7 0 1 1 0
1 0.1 0.3 0 2.1 1.7 0 1 9 1 4
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0.1 0.3 0
1.1 0.3 0
1.1 1.7 0
0.1 1.7 0
$EndNodes
$Elements
2 2 1 2
1 4 1 1
1 4 1
2 1 3 1
2 1 2 3 4
$EndElements
"""

ABAQUS = """\
*HEADING
*NODE
1, 0.1, 0.3, 0.0
2, 1.1, 0.3, 0.0
3, 1.1, 1.7, 0.0
4, 0.1, 1.7, 0.0
*ELEMENT, TYPE=CPS4
1, 1, 2, 3, 4
*NSET, NSET=ALL
1, 2, 3, 4
*NSET, NSET=FLOOR
1, 2
*NSET, NSET=SPOT
3
"""


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch):
    """Read in this process, where it is quick and can be patched."""
    monkeypatch.setattr(
        "slideviz.formats.files.read_in_subprocess",
        lambda path, _, function="": (bridge.read_surface if function else read_with_meshio)(path),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("files")


def box(*counts: int) -> Mesh:
    """Return a grid of lines, squares or cubes without markers."""
    shape = [n + 1 for n in counts]
    grids = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    number = np.arange(np.prod(shape)).reshape(shape)
    low, high = slice(None, -1), slice(1, None)
    corner = [(low, low), (high, low), (high, high), (low, high)]
    if len(counts) == 2:
        nodes = [number[part] for part in corner]
    else:
        nodes = [number[(*part, last)] for last in (low, high) for part in corner]
    table = np.stack([n.ravel() for n in nodes], axis=1)
    points = np.stack([g.ravel() for g in grids], axis=1)
    return Mesh(points, Cells.from_blocks([({4: 9, 8: 12}[table.shape[1]], table)]))


def sizes(mesh: Mesh) -> dict[str, int]:
    return {marker.name: len(marker.cells) for marker in mesh.markers}


def sets_of_nodes(cells: Cells) -> set[frozenset[int]]:
    return {frozenset(row) for _, nodes in cells.by_type.values() for row in nodes.tolist()}


def by_type(mesh: Mesh) -> Mesh:
    """Return the mesh with its cells in the order of their types, as meshio groups them."""

    def sort(cells: Cells) -> Cells:
        return Cells.from_blocks((vtk, nodes) for vtk, (_, nodes) in cells.by_type.items())

    markers = tuple(Marker(m.name, sort(m.cells)) for m in mesh.markers)
    return replace(mesh, cells=sort(mesh.cells), markers=markers)


def test_front_door(tmp_path):
    slideviz.write(tmp_path / "out.su2", slideviz.read(save(tmp_path, SQUARE)))
    assert (tmp_path / "out.su2").read_text() == SQUARE


# Names of boundaries.


def test_gmsh_2_names_numbers_and_loose_lines(tmp_path):
    mesh = read(save(tmp_path, GMSH_22, "grid.msh"))
    assert mesh.dim == 2
    assert mesh.cells.types.tolist() == [9, 5, 5]
    # Group 7 has no name; the line between the cells is in no group.
    assert sizes(mesh) == {"in flow": 1, "wall": 2, "physical_7": 1}
    assert mesh.marker("wall").cells.connectivity.tolist() == [0, 1, 1, 2]
    assert mesh.points[2].tolist() == [2.1, 0.3]
    assert mesh.source == (tmp_path / "grid.msh").resolve()


def test_gmsh_4_names(tmp_path):
    mesh = read(save(tmp_path, GMSH_41, "grid.msh"))
    assert sizes(mesh) == {"inlet": 1}
    assert mesh.marker("inlet").nodes.tolist() == [0, 3]


def test_gmsh_without_groups_names_by_curve(tmp_path):
    text = re.sub(r"^(\d [123] 2) \d", r"\1 0", GMSH_22, flags=re.M)
    mesh = read(save(tmp_path, text, "grid.msh"))
    assert sizes(mesh) == {
        "geometrical_1": 2,
        "geometrical_2": 1,
        "geometrical_3": 1,
        "geometrical_4": 1,
    }


def test_abaqus_node_sets_name_the_outer_sides(tmp_path):
    mesh = read(save(tmp_path, ABAQUS, "grid.inp"))
    assert sizes(mesh) == {"ALL": 3, "FLOOR": 1}
    assert mesh.marker("FLOOR").nodes.tolist() == [0, 1]


@pytest.mark.parametrize("ending", [".vtu", ".med", ".inp", ".vol"])
@pytest.mark.parametrize("text", [SQUARE, SOLID.replace("14 4 5 6 7 8 1", "10 4 5 6 8 1")])
def test_formats_that_keep_the_names(tmp_path, text, ending):
    if ending == ".med":
        pytest.importorskip("h5py")
    if ending == ".inp":
        # Such a file names a set once for each type, and meshio reads only the last.
        text = text.replace("MARKER_ELEMS= 2\n9 0 3 2 1\n", "MARKER_ELEMS= 1\n")
    mesh = by_type(read(save(tmp_path, text)))
    path = tmp_path / f"out{ending}"
    write(path, mesh)
    again = read(path)
    assert_same(by_type(again), mesh)
    write(tmp_path / "back.su2", again)
    assert_same(by_type(read(tmp_path / "back.su2")), mesh)


def test_gmsh_file_is_written_with_names(tmp_path):
    mesh = by_type(read(save(tmp_path, SOLID)))
    write(tmp_path / "out.msh", mesh)
    assert_same(by_type(read(tmp_path / "out.msh")), mesh)


@pytest.mark.parametrize(
    ("ending", "prefix"), [(".vtk", "marker"), (".mesh", "ref"), (".xdmf", "marker")]
)
def test_formats_that_keep_numbers(tmp_path, ending, prefix):
    mesh = by_type(read(save(tmp_path, SOLID.replace("14 4 5 6 7 8 1", "10 4 5 6 8 1"))))
    write(tmp_path / f"out{ending}", mesh)
    again = by_type(read(tmp_path / f"out{ending}"))
    named = [Marker(f"{prefix}_{k}", m.cells) for k, m in enumerate(mesh.markers, 1)]
    assert_same(again, replace(mesh, markers=tuple(named)))


def foreign(path, cells, points=None, **kwargs):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]] if points is None else points
    meshio.write(path, meshio.Mesh(np.array(points, float), cells, **kwargs))
    return path


QUAD = ("quad", np.array([[0, 1, 2, 3]]))
LINES = ("line", np.array([[0, 1], [1, 2], [2, 3], [3, 0]]))


def test_numbers_under_any_name_are_groups(tmp_path):
    data = {"x": [[0.5], [1.0] * 4], "ids": [[7], [1, 2, 3, 4]], "Patch": [[0], [5, 5, 0, 5]]}
    mesh = read(foreign(tmp_path / "a.vtu", [QUAD, LINES], cell_data=data))
    assert sizes(mesh) == {"Patch_0": 1, "Patch_5": 3}


def test_lines_without_numbers_are_divided_at_corners(tmp_path):
    mesh = read(foreign(tmp_path / "a.vtu", [QUAD, LINES]))
    assert sizes(mesh) == {f"boundary_{k}": 1 for k in (1, 2, 3, 4)}


# Boundaries that the file does not have.


def test_square_and_cube_without_markers(tmp_path):
    write(tmp_path / "square.vtu", box(3, 2))
    assert sizes(read(tmp_path / "square.vtu")) == {
        "boundary_1": 3,
        "boundary_2": 3,
        "boundary_3": 2,
        "boundary_4": 2,
    }
    write(tmp_path / "cube.vtu", box(2, 2, 2))
    cube = read(tmp_path / "cube.vtu")
    assert sizes(cube) == {f"boundary_{k}": 4 for k in range(1, 7)}
    for marker in cube.markers:
        assert (np.ptp(cube.points[marker.nodes], axis=0) == 0).sum() == 1


def test_round_mesh_has_one_boundary(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.vstack([[0, 0], np.stack([np.cos(angle), np.sin(angle)], axis=1)])
    ring = np.arange(40)
    fan = np.stack([np.zeros(40, int), 1 + ring, 1 + (ring + 1) % 40], axis=1)
    write(tmp_path / "disc.vtu", Mesh(points, Cells.from_blocks([(5, fan)])))
    assert sizes(read(tmp_path / "disc.vtu")) == {"boundary": 40}


def with_teeth(mesh: Mesh) -> Mesh:
    """Return a unit square with every second node of its sides drawn out."""
    points = mesh.points.copy()
    for axis in (0, 1):
        for value, way in ((0, -0.3), (1, 0.3)):
            points[np.flatnonzero(mesh.points[:, axis] == value)[1::2], axis] += way
    return mesh.with_points(points)


def test_rough_surface_is_not_cut_to_pieces(tmp_path):
    write(tmp_path / "few.vtu", with_teeth(box(12, 12)))
    assert len(read(tmp_path / "few.vtu").markers) == 40
    write(tmp_path / "many.vtu", with_teeth(box(30, 30)))
    assert sizes(read(tmp_path / "many.vtu")) == {"boundary": 120}


def test_cells_that_lie_on_each_other_have_no_boundary(tmp_path):
    path = foreign(tmp_path / "a.vtu", [("quad", np.array([[0, 1, 2, 3], [0, 1, 2, 3]]))])
    assert read(path).markers == ()


@pytest.mark.parametrize("text", [SQUARE, SOLID])
def test_outer_facets_are_the_sides_of_one_cell(tmp_path, text):
    mesh = read(save(tmp_path, text))
    seen: dict[frozenset[int], int] = {}
    for k in range(len(mesh.cells)):
        nodes = mesh.cells.connectivity[mesh.cells.offsets[k] : mesh.cells.offsets[k + 1]]
        for local in ELEMENTS[int(mesh.cells.types[k])].facets:
            side = frozenset(nodes[list(local)].tolist())
            seen[side] = seen.get(side, 0) + 1
    assert sets_of_nodes(outer_facets(mesh)) == {side for side, n in seen.items() if n == 1}


# Two and three dimensions.


@pytest.mark.parametrize("z", [0.0, 0.25])
def test_flat_mesh_loses_its_third_column(tmp_path, z):
    points = [[0, 0, z], [1, 0, z], [1, 1, z], [0, 1, z], [9, 9, 9]]
    mesh = read(foreign(tmp_path / "a.vtk", [QUAD], points))
    assert mesh.dim == 2
    assert mesh.points[2].tolist() == [1, 1]


def test_surface_in_space_is_refused(tmp_path):
    path = foreign(tmp_path / "a.vtk", [QUAD], [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.1]])
    with pytest.raises(MeshError, match=r"a.vtk: this is a surface in space, .* export the volume"):
        read(path)


# Refused.


@pytest.mark.parametrize(
    ("kind", "count", "words"),
    [
        ("triangle6", 6, "'triangle6' is of high order, but slideviz needs linear elements"),
        ("hexahedron20", 20, "'hexahedron20' is of high order"),
        ("polygon", 5, "'polygon' has many sides"),
    ],
)
def test_elements_that_are_not_supported(tmp_path, kind, count, words):
    points = np.random.default_rng(0).random((count, 3))
    path = foreign(tmp_path / "a.vtu", [(kind, [list(range(count))])], points)
    with pytest.raises(MeshError, match=f"a.vtu: the element type {words}"):
        read(path)


def test_only_lines(tmp_path):
    path = foreign(tmp_path / "a.vtu", [LINES])
    with pytest.raises(MeshError, match=r"a.vtu: there are no cells, only points and lines; expor"):
        read(path)


def test_node_that_does_not_exist(tmp_path):
    text = GMSH_22.replace("7 3 2 9 1 1 2 5 4", "7 3 2 9 1 1 2 5 8")
    with pytest.raises(
        MeshError, match=r"grid.msh: cannot be read as gmsh: meshio says .*out of b"
    ):
        read(save(tmp_path, text, "grid.msh"))
    cells = [("quad", np.array([[0, 1, 2, 8]]))]
    path = foreign(tmp_path / "a.vtu", cells)
    with pytest.raises(MeshError, match=r"a.vtu: cell 0: node 8 does not exist: the 4 points are"):
        read(path)


def test_point_that_is_not_finite(tmp_path):
    path = foreign(tmp_path / "a.vtu", [QUAD], [[0, 0, 0], [1, 0, 0], [1, np.nan, 0], [0, 1, 0]])
    said = r"a.vtu: cell 0: point 2 is at \(1.0, nan, 0.0\), which is not finite"
    with pytest.raises(MeshError, match=said):
        read(path)


REFUSED = r"not finite|expected|nothing can be computed|cannot be read"
MESHIO_READS = [row.ending for row in FORMATS.values() if row.reader == MESHIO.reader]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("ending", [*MESHIO_READS, ".stl", ".ply", ".su2", ".su2b"])
def test_no_reader_takes_a_coordinate_that_cannot_be_computed_with(tmp_path, ending, value):
    """Of a mesh, and of the surface that a boundary is laid onto; CGNS has its own test."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]])
    cells = [("tetra", np.array([[0, 1, 2, 3], [4, 3, 2, 1]]))]
    if ending in (".stl", ".ply"):
        cells = [("triangle", np.array([[0, 2, 1], [1, 2, 3]]))]
    path, place = tmp_path / f"a{ending}", (3, 1)
    if ending in (".su2", ".su2b"):
        write(path, Mesh(points + 0.5625, Cells.from_types([10, 10], [0, 1, 2, 3, 4, 3, 2, 1])))
        old, new = (np.float64(0.5625), np.float64(value))
        data = path.read_bytes()
        if ending == ".su2":
            changed = data.replace(repr(float(old)).encode(), repr(float(new)).encode(), 1)
        else:
            changed = data.replace(old.tobytes(), new.tobytes(), 1)
        assert changed != data
        path.write_bytes(changed)
    else:
        points[place] = value
        with np.errstate(all="ignore"):
            foreign(path, cells, points)
    for reader in (read, read_surface):
        if ending in (".stl", ".ply") and reader is read:
            continue  # they are surfaces
        with pytest.raises(
            MeshError, match=r"not finite|expected|nothing can be computed|cannot be read"
        ):
            reader(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_surface_names_the_facet_of_a_coordinate_that_is_not_finite(tmp_path, value):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    points[3, 1] = value
    path = foreign(tmp_path / "a.ply", [("triangle", np.array([[0, 2, 1], [1, 2, 3]]))], points)
    with pytest.raises(MeshError, match=r"a.ply: facet 1: point 3 is at \(0.0, .*not finite; corr"):
        read_surface(path)


def test_side_with_a_node_twice(tmp_path):
    lines = ("line", np.array([[0, 1], [2, 2]]))
    data = {"marker": [[0], [1, 1]]}
    path = foreign(tmp_path / "a.vtu", [QUAD, lines], cell_data=data)
    with pytest.raises(
        MeshError, match=r"a.vtu: marker 'marker_1': element 1: node 2 occurs twice"
    ):
        read(path)


def test_meshio_arrays_that_make_no_sense(tmp_path, monkeypatch):
    class Cell:
        type = "quad"
        data = np.zeros((1, 3), int)

    class Data:
        cells = [Cell()]  # noqa: RUF012
        points = np.zeros(3)

    path = save(tmp_path, "x", "a.vtk")
    monkeypatch.setattr(meshio, "read", lambda *_, **__: Data())
    with pytest.raises(MeshError, match=r"the nodes of its quadrilateral cells cannot be underst"):
        read(path)
    Cell.data = np.array([[0, 1, 2, 3]])
    with pytest.raises(MeshError, match=r"the points have shape \(3,\), not \(n, 2\) or \(n, 3\)"):
        read(path)
    Data.points = "nonsense"
    with pytest.raises(MeshError, match=r"cannot be understood: meshio says .could not convert st"):
        read(path)


@pytest.mark.parametrize("name", ["a.xyz", "a.png", "b", "a.su2.bak"])
def test_unknown_endings(tmp_path, name):
    with pytest.raises(MeshError, match=r"no mesh format has the ending .*; known are .su2, .su2b"):
        read(save(tmp_path, "hello", name))
    mesh = read(save(tmp_path, SQUARE))
    with pytest.raises(MeshError, match="no mesh format has the ending"):
        write(tmp_path / f"c{name}", mesh)
    assert not (tmp_path / f"c{name}").exists()


def test_only_su2_has_zones(tmp_path):
    path = save(tmp_path, GMSH_22, "grid.msh")
    assert len(read(path, zone=1).cells) == 3
    with pytest.raises(
        MeshError,
        match="there is no zone 2; only SU2 files and OpenFOAM cases have zones, so leave",
    ):
        read(path, zone=2)


ENDINGS = [".vtu", ".vtk", ".msh", ".med", ".inp", ".cgns", ".mesh", ".xdmf", ".bdf", ".stl", ".e"]


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("raw", [b"", b"nonsense\n", bytes(range(256)) * 4], ids=len)
def test_broken_files_are_refused_without_a_word(tmp_path, capfd, ending, raw):
    with pytest.raises(MeshError, match=rf"^{tmp_path}/a\{ending}: .*; ") as caught:
        read(save(tmp_path, raw, f"a{ending}"))
    assert "\n" not in str(caught.value)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


@settings(
    max_examples=100, deadline=5000, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    name=st.sampled_from(["msh2", "msh4", "inp"]),
    where=st.floats(0, 1, exclude_max=True),
    remove=st.integers(0, 4),
    insert=st.one_of(st.binary(max_size=3), st.sampled_from([b"\n", b" 9 ", b"$", b"nan", b"-"])),
)
def test_changed_bytes_load_or_are_refused(folder, capfd, name, where, remove, insert):
    text = {"msh2": GMSH_22, "msh4": GMSH_41, "inp": ABAQUS}[name].encode()
    at = int(where * len(text))
    path = save(folder, text[:at] + insert + text[at + remove :], f"a.{name[:3]}")
    try:
        mesh = read(path)
    except MeshError as problem:
        message = str(problem)
    else:
        message = f"{path}: "
        write(folder / "fuzz.vtu", mesh)
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


def test_a_reader_that_ends_the_process_or_prints(tmp_path, monkeypatch, capfd):
    def ends(*_, **__):
        print("Something  is\nwrong")  # noqa: T201
        sys.exit(1)

    monkeypatch.setattr(meshio, "read", ends)
    message = r"a.vtk: cannot be read as vtk: meshio says 'Something is wrong'; use another format"
    with pytest.raises(MeshError, match=message):
        read(save(tmp_path, "x", "a.vtk"))
    assert capfd.readouterr() == ("", "")


def test_a_set_without_a_name_is_called_unnamed(tmp_path):
    mesh = read(save(tmp_path, ABAQUS.replace("NSET=FLOOR", "NSET"), "a.inp"))
    assert "unnamed" in mesh.marker_names
    assert "FLOOR" not in mesh.marker_names
    write(tmp_path / "b.vtu", mesh)


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (ModuleNotFoundError("no", name="h5py"), "this format needs the package h5py; install it"),
        (MemoryError(), "there is not enough memory to read it"),
        (OSError(errno.EIO, "Input/output error"), "Input/output error; check the file, its end"),
        (OSError("no signature"), "cannot be read as vtk: it is not a file of this format; check"),
        (AssertionError(), "meshio says 'AssertionError'; use another format"),
    ],
)
def test_what_a_reader_raises(tmp_path, monkeypatch, problem, message):
    def fails(*_, **__):
        raise problem

    monkeypatch.setattr(meshio, "read", fails)
    with pytest.raises(MeshError, match=f"a.vtk: .*{message}"):
        read(save(tmp_path, "x", "a.vtk"))


# Writing.


@settings(max_examples=60, deadline=None)
@given(mesh=meshes())
def test_vtu_keeps_every_bit_and_the_order(folder, mesh):
    # A nonsense grid may be flat only by chance; nothing else may change.
    mesh = replace(mesh, points=np.nan_to_num(mesh.points, posinf=0, neginf=0))
    write(folder / "law.vtu", mesh)
    data = meshio.read(folder / "law.vtu")
    assert bits(data.points[:, : mesh.dim]) == bits(mesh.points)
    flat = np.concatenate([block.data.ravel() for block in data.cells])
    assert flat[: len(mesh.cells.connectivity)].tolist() == mesh.cells.connectivity.tolist()
    numbers = np.concatenate(data.cell_data["marker"])
    assert numbers.tolist() == [0] * len(mesh.cells) + [
        k for k, m in enumerate(mesh.markers, 1) for _ in range(len(m.cells))
    ]
    assert {name: np.ravel(v).tolist() for name, v in data.field_data.items()} == {
        m.name: [k, mesh.dim - 1] for k, m in enumerate(mesh.markers, 1)
    }


def test_vtu_with_cell_data(tmp_path):
    mesh = read(save(tmp_path, SOLID))
    quality, flow = np.array([0.1, 0.2, 1 / 3, 1.0]), np.arange(12.0).reshape(4, 3)
    values = {"size-skew": quality, 'a <"flow">': flow, "count": [1, 2, 3, 4]}
    write(tmp_path / "out.vtu", mesh, cell_data=values)
    data = meshio.read(tmp_path / "out.vtu")
    found = {name: np.concatenate(parts) for name, parts in data.cell_data.items()}
    assert found["size-skew"][:4].tolist() == quality.tolist()
    assert found['a <"flow">'][:4].tolist() == flow.tolist()
    assert found["count"][:4].tolist() == [1, 2, 3, 4]
    assert np.isnan(found["size-skew"][4:]).all()
    assert len(found["size-skew"]) == 4 + 3


def test_vtu_is_what_vtk_reads(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    mesh = read(save(tmp_path, SOLID))
    write(tmp_path / "out.vtu", mesh, cell_data={"q": [1.0, 2.0, 3.0, 4.0]})
    grid = pyvista.read(tmp_path / "out.vtu")
    assert grid.celltypes.tolist() == [12, 14, 13, 10, 9, 5, 5]
    assert grid.cell_data["q"][:4].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert grid.field_data["tip"].ravel().tolist() == [2, 2]
    # In VTK the first triangle of a prism looks outward.
    assert grid.get_cell(2).point_ids == [1, 2, 9, 5, 6, 10]
    grid.save(tmp_path / "again.vtu")
    assert_same(read(tmp_path / "again.vtu"), replace(mesh, origin=Origin()))


def test_cell_data_through_meshio(tmp_path):
    mesh = by_type(read(save(tmp_path, SOLID)))
    write(tmp_path / "out.vtk", mesh, cell_data={"q": [1.0, 2.0, 3.0, 4.0]})
    data = meshio.read(tmp_path / "out.vtk")
    assert np.concatenate(data.cell_data["q"])[:4].tolist() == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    ("ending", "message"),
    [
        (".stl", r"the format stl does not hold the .*hexahedron cells.* of this mesh; use anoth"),
        (".inp", r"the format abaqus does not hold the pyramid cells of this mesh; use another"),
        (".h5m", r"the format h5m does not hold the .*pyramid cells.* of this mesh; use another"),
        (".ele", r"the format tetgen needs several files; use another, such as .vtu"),
        (".svg", r"the format svg does not hold the .*pyramid cells.* of this mesh; use another"),
    ],
)
def test_formats_that_cannot_hold_the_mesh(tmp_path, capfd, ending, message):
    mesh = read(save(tmp_path, SOLID))
    old = save(tmp_path, "old", f"out{ending}")
    with pytest.raises(MeshError, match=rf"out\{ending}: cannot be written.*{message[20:]}"):
        write(old, mesh)
    assert old.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grid.su2", f"out{ending}"]
    assert capfd.readouterr() == ("", "")


def test_what_meshio_cannot_write_of_a_mesh_is_named(tmp_path, monkeypatch):
    mesh, real = read(save(tmp_path, SQUARE)), meshio.write

    def fails_with_data(path, data, **options):
        if data.cell_data:
            raise AttributeError("'list' object has no attribute 'items'")
        real(path, data, **options)

    monkeypatch.setattr(meshio, "write", fails_with_data)
    with pytest.raises(MeshError, match=r"writer of vtk fails on this mesh \('list' object"):
        write(tmp_path / "out.vtk", mesh)

    def fails(path, data, **options):
        if len(data.cells) > 1:
            raise AssertionError
        real(path, data, **options)

    monkeypatch.setattr(meshio, "write", fails)
    with pytest.raises(
        MeshError,
        match=r"meshio's writer of vtk fails on this mesh \(AssertionError\), but the mesh",
    ):
        write(tmp_path / "out.vtk", mesh)


@pytest.mark.parametrize(
    ("problem", "said"),
    [
        (OSError(errno.ENOSPC, "No space left"), "No space left; check the file, its ending and"),
        (ModuleNotFoundError("no", name="netCDF4"), "needs the package netCDF4; install it"),
    ],
)
def test_what_hinders_meshio_is_not_told_as_what_a_format_lacks(
    tmp_path, monkeypatch, problem, said
):
    def fails(*_, **__):
        raise problem

    mesh = read(save(tmp_path, SQUARE))
    monkeypatch.setattr(meshio, "write", fails)
    with pytest.raises(MeshError, match=f"written as vtk: .*{said}"):
        write(tmp_path / "out.vtk", mesh)


def test_an_element_that_meshio_does_not_read_is_named(tmp_path):
    text = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n*ELEMENT, TYPE=C3D5\n1,1,2,3,4,5\n"
    with pytest.raises(MeshError, match="as abaqus: elements of type C3D5 are not read from files"):
        read(save(tmp_path, text, "a.inp"))


def test_coordinates_that_a_format_rounds(tmp_path, monkeypatch):
    mesh = box(2, 2, 2)
    real = meshio.read

    def rounds(path, file_format=None):
        data = real(path, file_format)
        data.points = data.points.round(3)
        return data

    monkeypatch.setattr(meshio, "read", rounds)
    write(tmp_path / "round.vtk", mesh.with_points(mesh.points * 2))
    with pytest.raises(MeshError, match=r"vtk does not hold the .*digits of the coordinates"):
        write(tmp_path / "out.vtk", mesh.with_points(mesh.points / 3))


def test_points_that_a_format_loses(tmp_path, monkeypatch):
    mesh = read(save(tmp_path, SQUARE))
    real = meshio.read

    def loses(path, file_format=None):
        data = real(path, file_format)
        data.points = data.points[:-1]
        return data

    monkeypatch.setattr(meshio, "read", loses)
    with pytest.raises(MeshError, match="the format vtk does not hold the points of this mesh"):
        write(tmp_path / "out.vtk", mesh)


def test_a_format_that_meshio_cannot_read_again(tmp_path, monkeypatch):
    mesh = read(save(tmp_path, SQUARE))

    def fails(*_, **__):
        raise ValueError

    monkeypatch.setattr(meshio, "read", fails)
    with pytest.raises(MeshError, match=r"out.vtk: .*cannot read again what it writes as vtk; use"):
        write(tmp_path / "out.vtk", mesh)
    assert not (tmp_path / "out.vtk").exists()


def test_disk_full_for_the_draft(tmp_path, monkeypatch):
    mesh = read(save(tmp_path, SQUARE))

    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("slideviz.formats.meshio.write.draft", full)
    with pytest.raises(
        MeshError, match=r"out.vtk: cannot be written: No space left on device; fre"
    ):
        write(tmp_path / "out.vtk", mesh)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grid.su2"]


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh"])
def test_unsound_mesh_is_not_written(tmp_path, ending):
    mesh = read(save(tmp_path, SQUARE))
    with pytest.raises(MeshError, match="which is not finite"):
        write(tmp_path / f"out{ending}", mesh.with_points(mesh.points * np.inf))
    assert not (tmp_path / f"out{ending}").exists()


def test_source_in_another_format_is_not_overwritten_unasked(tmp_path):
    path = save(tmp_path, GMSH_22, "grid.msh")
    mesh = read(path)
    with pytest.raises(MeshError, match=r"grid.msh: this is the file that the mesh was read from"):
        write(path, mesh.with_points(mesh.points + 1))
    assert path.read_text() == GMSH_22
    write(path, mesh.with_points(mesh.points + 1), overwrite=True)
    assert read(path).points[0].tolist() == [1.1, 1.3]


def test_foreign_mesh_becomes_an_su2_file(tmp_path):
    mesh = read(save(tmp_path, GMSH_22.replace("in flow", "inflow"), "grid.msh"))
    write(tmp_path / "out.su2", mesh)
    assert_same(read(tmp_path / "out.su2"), mesh)
    assert "MARKER_TAG= inflow\nMARKER_ELEMS= 1\n3 3 0\n" in (tmp_path / "out.su2").read_text()


@pytest.mark.parametrize("ending", ["su2", "su2b", "vtu"])
@pytest.mark.parametrize("command", ["info", "quality", "convert", "section"])
def test_too_large_coordinates_are_refused_by_all_commands(tmp_path, capsys, ending, command):
    path = tmp_path / f"a.{ending}"
    mesh = square(4)
    points = mesh.points.copy()
    points[3, 0] = -2.8e101
    write(path, mesh.with_points(points))
    more = {"convert": [str(tmp_path / "b.su2")], "section": ["--plane", "y=0.5", "-o", "a.png"]}
    assert run([command, str(path), *more.get(command, [])]) == 1
    said = f"a.{ending}: point 3 is at (-2.8e+101, 0.75); nothing can be computed with coordinates"
    assert said in capsys.readouterr().err
