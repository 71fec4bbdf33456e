"""Meshes through each exact writer and back: nodes to the bit; other readers are the judges."""

import re
from dataclasses import replace

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.formats.files import read, write
from slideviz.formats.nastran.write import PLACES, real_text
from slideviz.formats.table import format_for
from slideviz.mesh.model import Cells, Marker
from slideviz.mesh.quality import quality
from tests.builders import cube, grid, square
from tests.formats.su2_samples import bits
from tests.formats.test_cgns_read import cells_of, judged, points_of

EXACT = (".msh", ".cgns", ".b8.ugrid", ".lb8.ugrid")
MESHIO_NAMES = {10: "tetra", 12: "hexahedron", 13: "wedge", 14: "pyramid"}


def shaken(mesh):
    """Return a mesh whose coordinates need all their digits."""
    random = np.random.default_rng(7)
    return mesh.with_points(mesh.points + 1e-3 * random.random(mesh.points.shape) / 3.0)


def meshes():
    yield shaken(grid((3, 3, 3), kind="mixed"))
    yield shaken(cube(4, "simplex"))
    yield shaken(square(4, "mixed"))


def rows(cells):
    """Return the elements of each type, in their order."""
    return {vtk: nodes.tolist() for vtk, (_, nodes) in cells.by_type.items()}


def assert_same(mesh, again, path):
    assert bits(again.points) == bits(mesh.points)
    assert rows(again.cells) == rows(mesh.cells)
    names = mesh.marker_names
    if format_for(path).boundaries == "numbers":
        names = tuple(f"ref_{k}" for k in range(1, len(names) + 1))
    found = {marker.name: rows(marker.cells) for marker in again.markers}
    expected = zip(names, mesh.markers, strict=True)
    assert found == {name: rows(marker.cells) for name, marker in expected}


@pytest.mark.parametrize("ending", EXACT)
@pytest.mark.parametrize("mesh", meshes(), ids=["mixed", "tetrahedra", "flat"])
def test_a_round_trip_keeps_every_bit_and_boundary(ending, mesh, tmp_path):
    path = tmp_path / f"out{ending}"
    if mesh.dim not in format_for(path).dims:
        with pytest.raises(MeshError, match="UGRID holds 3D meshes"):
            write(path, mesh)
        return
    write(path, mesh)
    again = read(path)
    assert_same(mesh, again, path)
    assert quality(again).inverted == 0
    write(tmp_path / f"again{ending}", again)
    assert bits(read(tmp_path / f"again{ending}").points) == bits(mesh.points)


@pytest.mark.parametrize("ending", [".b8.ugrid", ".lb8.ugrid", ".msh", ".bdf"])
def test_meshio_reads_the_same(ending, tmp_path):
    mesh = next(meshes())
    write(tmp_path / f"out{ending}", mesh)
    data = meshio.read(tmp_path / f"out{ending}")
    exact = ending != ".bdf"
    assert np.abs(data.points - mesh.points).max() <= (0.0 if exact else 1e-14)
    for vtk, nodes in rows(mesh.cells).items():
        blocks = [block.data for block in data.cells if block.type == MESHIO_NAMES[vtk]]
        assert np.concatenate(blocks).tolist() == nodes


def test_the_bytes_of_ugrid_have_the_order_that_the_name_says(tmp_path):
    mesh = cube(2, block=False)
    for ending, order in ((".b8.ugrid", ">"), (".lb8.ugrid", "<"), (".LB8.UGRID", "<")):
        write(tmp_path / f"out{ending}", mesh)
        data = (tmp_path / f"out{ending}").read_bytes()
        assert np.frombuffer(data[:28], f"{order}i4").tolist() == [27, 0, 24, 0, 0, 0, 8]
        assert np.frombuffer(data[28 : 28 + 24], f"{order}f8").tolist() == [0.0, 0.0, 0.0]
        assert len(data) == 28 + 27 * 24 + 24 * 20 + 8 * 32


@pytest.mark.parametrize(
    ("ending", "words"),
    [
        (".b8.ugrid", "UGRID holds 3D meshes of up to 2^31 points"),
        (".bdf", "Nastran's bulk data hold 3D meshes whose numbers of nodes and elements have 8"),
    ],
)
def test_a_flat_mesh_is_refused_before_the_work(tmp_path, capsys, monkeypatch, ending, words):
    monkeypatch.chdir(tmp_path)
    write("flat.su2", square(4))
    text = (
        "MESH_FILENAME= flat.su2\nMARKER_MOVING= ( BLOCK )\nMOTION= (BLOCK, rotate, 3, centroid)\n"
    )
    (tmp_path / "flat.cfg").write_text(text)
    monkeypatch.setattr("slideviz.cli.run_command.deform", None)  # no work is begun
    assert run(["run", "flat.cfg", "-o", f"out{ending}"]) == 1
    assert words in capsys.readouterr().err
    with pytest.raises(MeshError, match=re.escape(words)):
        write(f"out{ending}", square(4))


def test_gmsh_reads_nodes_cells_and_names(tmp_path):
    gmsh = pytest.importorskip("gmsh")
    for mesh in meshes():
        write(tmp_path / "out.msh", mesh)
        gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.open(str(tmp_path / "out.msh"))
            tags, points, _ = gmsh.model.mesh.getNodes()
            points = points.reshape(-1, 3)[np.argsort(tags)][:, : mesh.dim]
            assert bits(points) == bits(mesh.points)
            _, elements, _ = gmsh.model.mesh.getElements(mesh.dim)
            assert sum(map(len, elements)) == len(mesh.cells)
            groups = gmsh.model.getPhysicalGroups(mesh.dim - 1)
            names = [gmsh.model.getPhysicalName(*group) for group in groups]
            assert names == list(mesh.marker_names)
            for group, marker in zip(groups, mesh.markers, strict=True):
                entities = gmsh.model.getEntitiesForPhysicalGroup(*group)
                parts = [gmsh.model.mesh.getElements(mesh.dim - 1, one)[1] for one in entities]
                assert sum(len(e) for part in parts for e in part) == len(marker.cells)
        finally:
            gmsh.finalize()


def test_values_of_cells_are_in_the_file_of_gmsh(tmp_path):
    mesh = next(meshes())
    values = np.random.default_rng(1).random(len(mesh.cells))
    write(tmp_path / "out.msh", mesh, cell_data={"value": values, "two": np.c_[values, -values]})
    data = meshio.read(tmp_path / "out.msh")
    ids = np.concatenate([ids for ids, _ in mesh.cells.by_type.values()])
    found = np.concatenate([np.ravel(part) for part in data.cell_data["value"]])
    assert found[: len(ids)].tolist() == values[ids].tolist()
    assert np.isnan(found[len(ids) :]).all()
    both = np.concatenate(data.cell_data["two"])
    assert both[: len(ids)].tolist() == np.c_[values, -values][ids].tolist()
    with pytest.raises(MeshError, match=r"a \.bdf file has no place for cell data"):
        write(tmp_path / "out.bdf", mesh, cell_data={"value": values})


def test_a_new_cgns_file_is_read_by_vtk_and_copied_from_then_on(tmp_path):
    mesh = next(meshes())
    write(tmp_path / "new.cgns", mesh)
    [data] = judged(tmp_path / "new.cgns").values()
    assert bits(points_of(data)) == bits(mesh.points)
    blocks = mesh.cells.by_type.items()
    expected = [(vtk, nodes) for vtk, (_, table) in blocks for nodes in table.tolist()]
    assert cells_of(data) == expected
    patches = judged(tmp_path / "new.cgns", bnd=True)
    sizes = {names[-1]: patch.GetNumberOfCells() for names, patch in patches.items()}
    assert {one.name: len(one.cells) for one in mesh.markers}.items() <= sizes.items()
    again = read(tmp_path / "new.cgns")
    write(tmp_path / "moved.cgns", again.with_points(again.points * 1.5))
    assert bits(read(tmp_path / "moved.cgns").points) == bits(mesh.points * 1.5)


def test_names_of_boundaries_that_a_file_cannot_have(tmp_path):
    mesh = cube(2, block=False)
    names = ["a" * 40, "a" * 40 + "b", "Zone", 'in "side"', "up/down", "GridCoordinates"]
    renamed = zip(names, mesh.markers, strict=True)
    mesh = replace(mesh, markers=tuple(Marker(name, one.cells) for name, one in renamed))
    write(tmp_path / "out.cgns", mesh)
    found = read(tmp_path / "out.cgns").marker_names
    assert found[2:] == ("Zone_2", 'in "side"', "up_down", "GridCoordinates_2")
    assert len(set(found)) == 6
    assert max(map(len, found)) <= 32
    write(tmp_path / "out.msh", mesh)
    assert read(tmp_path / "out.msh").marker_names[3] == "in 'side'"


@pytest.mark.parametrize("names", [("wall", "wall_2"), ("wall_2", "wall")])
def test_boundaries_of_several_types_keep_names_that_differ_by_a_number(names, tmp_path):
    mesh = grid((3, 3, 3), kind="mixed")
    renamed = zip((*"abcd", *names), mesh.markers, strict=True)
    mesh = replace(mesh, markers=tuple(Marker(name, one.cells) for name, one in renamed))
    assert len(mesh.markers[-1].cells.by_type) == 2
    write(tmp_path / "out.cgns", mesh)
    assert_same(mesh, read(tmp_path / "out.cgns"), tmp_path / "out.cgns")


def test_a_boundary_without_elements_is_left_out_of_a_cgns_file(tmp_path):
    mesh = cube(2, block=False)
    none = Marker("none", Cells.from_types([], []))
    write(tmp_path / "out.cgns", replace(mesh, markers=(*mesh.markers, none)))
    assert read(tmp_path / "out.cgns").marker_names == mesh.marker_names


def value_of(text):
    return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"e\1", text))


@settings(max_examples=500)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_of_nastran_has_16_places_and_the_digits_that_these_hold(value):
    text = real_text(value)
    assert len(text) <= PLACES
    assert "." in text
    if abs(value) < 1e300:
        assert value_of(text) == pytest.approx(value, rel=1e-8, abs=1e-300)
    if 1e-3 < abs(value) < 1e3:
        assert abs(value_of(text) - value) <= 1e-11 * abs(value)
    if len(repr(value)) <= PLACES and "e" not in repr(value):
        assert value_of(text) == value


def test_a_nastran_file_has_long_points_and_numbers_of_boundaries(tmp_path):
    mesh = grid((2, 2, 2), kind="mixed")
    write(tmp_path / "out.bdf", mesh)
    lines = (tmp_path / "out.bdf").read_text().splitlines()
    assert lines[0] == "BEGIN BULK"
    assert lines[1].startswith("GRID*   1 ")
    assert max(map(len, lines)) <= 72
    assert lines[-1] == "ENDDATA"
    again = read(tmp_path / "out.bdf")
    assert bits(again.points) == bits(mesh.points)
    assert rows(again.cells) == rows(mesh.cells)
    assert [len(one.cells) for one in again.markers] == [len(one.cells) for one in mesh.markers]
