"""VTKHDF files hold the mesh and its steps; VTK's own reader is the judge."""

import json
import resource
from dataclasses import replace
from itertools import pairwise

import h5py
import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkVersion
from vtkmodules.vtkIOHDF import vtkHDFReader

from slideviz import quality
from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.formats import vtkhdf
from slideviz.formats.files import read, write
from slideviz.formats.vtkhdf import vtkhdf_series
from slideviz.mesh.model import Marker
from slideviz.samples.table import write_sample
from tests.builders import cube, grid, square
from tests.formats.su2_samples import SOLID, SQUARE, bits, save

VTK_VERSION = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion())


class Found:
    """A block as VTK reads it."""

    def __init__(self, grid):
        self.points = vtk_to_numpy(grid.GetPoints().GetData()).copy()
        self.cells = [
            (grid.GetCellType(k), [grid.GetCell(k).GetPointId(n) for n in range(size(grid, k))])
            for k in range(grid.GetNumberOfCells())
        ]
        self.cell_data = arrays(grid.GetCellData())
        self.point_data = arrays(grid.GetPointData())


def size(grid, k):
    return grid.GetCell(k).GetNumberOfPoints()


def arrays(data):
    return {
        data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)).copy()
        for k in range(data.GetNumberOfArrays())
    }


def judged(path):
    """Return what VTK's own reader reads: for each step the blocks by name, and the times."""
    reader = vtkHDFReader()
    assert reader.CanReadFile(str(path))
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    info = reader.GetOutputInformation(0)
    key = reader.GetExecutive().TIME_STEPS()
    times = list(info.Get(key)) if info.Has(key) else []
    steps = []
    for step in range(max(len(times), 1)):
        reader.SetStep(step)
        reader.Update()
        out = reader.GetOutput()
        blocks = {}
        for k in range(out.GetNumberOfPartitionedDataSets()):
            assert out.GetNumberOfPartitions(k) == 1
            blocks[out.GetMetaData(k).Get(out.NAME())] = Found(out.GetPartition(k, 0))
        steps.append(blocks)
    return steps, times


def rows(cells):
    """Return (type, nodes) of each cell."""
    flat, ends = cells.connectivity.tolist(), cells.offsets.tolist()
    pairs = zip(cells.types.tolist(), pairwise(ends), strict=True)
    return [(vtk, flat[a:b]) for vtk, (a, b) in pairs]


def in_space(points):
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


@pytest.mark.parametrize("text", [SQUARE, SOLID], ids=["2D", "3D"])
def test_a_mesh_is_what_vtk_reads(tmp_path, text):
    mesh = read(save(tmp_path, text))
    values = quality(mesh).values
    pairs = np.arange(2.0 * len(mesh.cells)).reshape(-1, 2)
    moved = mesh.with_points(mesh.points + 0.1)
    path = tmp_path / "a.vtkhdf"
    write(path, moved, cell_data={"quality": values, "pairs": pairs}, base=mesh)
    (blocks,), times = judged(path)
    assert times in ([], [0.0])
    assert list(blocks) == ["volume", *mesh.marker_names]
    volume = blocks["volume"]
    assert bits(volume.points) == bits(in_space(moved.points))
    assert volume.cells == rows(mesh.cells)
    assert bits(volume.cell_data["quality"]) == bits(values)
    assert bits(volume.cell_data["pairs"]) == bits(pairs)
    shift = in_space(moved.points - mesh.points)
    assert bits(volume.point_data["displacement"]) == bits(shift)
    for marker in mesh.markers:
        block = blocks[marker.name]
        assert bits(block.points) == bits(in_space(moved.points[marker.nodes]))
        own = [(vtk, marker.nodes[nodes].tolist()) for vtk, nodes in block.cells]
        assert own == rows(marker.cells)
        assert bits(block.point_data["displacement"]) == bits(shift[marker.nodes])
        assert block.cell_data == {}


@pytest.mark.skipif(VTK_VERSION < (9, 7), reason="VTK numbered prisms the other way round before")
def test_volumes_are_positive_for_vtk(tmp_path):
    from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter

    mesh = read(save(tmp_path, SOLID))
    write(tmp_path / "a.vtkhdf", mesh)
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.Update()
    sizes = vtkCellSizeFilter()
    sizes.SetInputData(reader.GetOutput().GetPartition(0, 0))
    sizes.Update()
    volumes = vtk_to_numpy(sizes.GetOutput().GetCellData().GetArray("Volume"))
    assert np.allclose(volumes[[0, 2]], [1.0, 0.4])  # the hexahedron and the prism
    assert (volumes > 0).all()


def steps_of(mesh, count):
    for step in range(count):
        points = mesh.points * (1 + 0.1 * step)
        yield points, {"q": np.arange(float(len(mesh.cells))) + step}, {"d": points - mesh.points}


@pytest.mark.parametrize("mesh", [square(5), cube(3)], ids=["2D", "3D"])
def test_steps_have_their_points_and_one_topology(tmp_path, mesh):
    path = tmp_path / "a.vtkhdf"
    with vtkhdf_series(path, mesh) as series:
        for step in steps_of(mesh, 4):
            series.add(*step)
    steps, times = judged(path)
    assert times == [0.0, 1.0, 2.0, 3.0]
    for blocks, (points, cells, nodes) in zip(steps, steps_of(mesh, 4), strict=True):
        assert list(blocks) == ["volume", *mesh.marker_names]
        volume = blocks["volume"]
        assert bits(volume.points) == bits(in_space(points))
        assert bits(volume.cell_data["q"]) == bits(cells["q"])
        assert bits(volume.point_data["d"]) == bits(in_space(nodes["d"]))
        assert volume.cells == rows(mesh.cells)
        for marker in mesh.markers:
            assert bits(blocks[marker.name].points) == bits(in_space(points[marker.nodes]))
    with h5py.File(path) as file:
        volume = file["VTKHDF/volume"]
        assert volume["Connectivity"].size == len(mesh.cells.connectivity)
        assert volume["Types"].size == len(mesh.cells)
        assert len(volume["Points"]) == 4 * len(mesh.points)


def pieces(path, count, step=0):
    """Return the partitions of the first block that each of several processes reads, by number."""
    found = []
    for piece in range(count):
        reader = vtkHDFReader()
        reader.SetFileName(str(path))
        reader.UpdateInformation()
        reader.SetStep(step)
        reader.UpdatePiece(piece, count, 0)
        out = reader.GetOutput()
        grids = (out.GetPartition(0, k) for k in range(out.GetNumberOfPartitions(0)))
        found.append({k: Found(grid) for k, grid in enumerate(grids) if grid is not None})
    return found


@pytest.mark.skipif(VTK_VERSION < (9, 7), reason="VTK gives each process its partitions since 9.7")
@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_partitions_are_shared_by_processes(tmp_path, monkeypatch, count):
    mesh = grid((5, 4, 4), kind="mixed")
    monkeypatch.setattr(vtkhdf, "PARTITION", 50)
    assert len(mesh.cells) == 192
    with vtkhdf_series(tmp_path / "steps.vtkhdf", mesh) as series:
        for step in steps_of(mesh, 3):
            series.add(*step)
    *_, (points, cells, nodes) = steps_of(mesh, 3)
    write(tmp_path / "a.vtkhdf", mesh.with_points(points), cell_data=cells)
    for path, step in ((tmp_path / "steps.vtkhdf", 2), (tmp_path / "a.vtkhdf", 0)):
        found = pieces(path, count, step)
        assert [sorted(part) for part in found] == [list(range(k, 4, count)) for k in range(count)]
        every = dict(sorted((k, grid) for one in found for k, grid in one.items()))
        assert [len(part.cells) for part in every.values()] == [50, 50, 50, 42]
        told = [(vtk, bits(part.points[own])) for part in every.values() for vtk, own in part.cells]
        assert told == [(vtk, bits(points[own])) for vtk, own in rows(mesh.cells)]
        values = np.concatenate([part.cell_data["q"] for part in every.values()])
        assert bits(values) == bits(cells["q"])
        if step:
            shift = [part.point_data["d"][own] for part in every.values() for _, own in part.cells]
            assert bits(np.concatenate(shift)) == bits(nodes["d"][mesh.cells.connectivity])


def test_names_that_are_no_names_of_groups(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    names = ["in/flow", "volume", "Assembly", "boundaries", ".", "1 upper (wall)", "ü"]
    markers = tuple(Marker(name, mesh.markers[0].cells) for name in names)
    write(tmp_path / "a.vtkhdf", replace(mesh, markers=markers))
    (blocks,), _ = judged(tmp_path / "a.vtkhdf")
    assert list(blocks) == [
        *("volume", "in_flow", "volume_2", "Assembly_2", "boundaries_2"),
        *("_.", "1 upper (wall)", "ü"),
    ]


def test_the_assembly_puts_boundaries_together(tmp_path):
    write(tmp_path / "a.vtkhdf", read(save(tmp_path, SQUARE)))
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.Update()
    tree = reader.GetOutput().GetDataAssembly()
    assert list(tree.GetDataSetIndices(0, False)) == [0]
    assert [tree.GetNodeName(node) for node in tree.GetChildNodes(0)] == ["boundaries"]
    assert list(tree.GetDataSetIndices(tree.GetChild(0, 0))) == [1, 2]


def test_what_fails_leaves_the_old_file(tmp_path):
    mesh = cube(3)
    path = tmp_path / "a.vtkhdf"
    path.write_bytes(b"old")
    with pytest.raises(IndexError), vtkhdf_series(path, mesh) as series:
        series.add(mesh.points[:5], {}, {})
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(MeshError, match=r"a.vtkhdf: cannot be written: the file is larger tha"):
            write(path, cube(12))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert path.read_bytes() == b"old"
    assert [one.name for one in tmp_path.iterdir()] == ["a.vtkhdf"]
    with pytest.raises(MeshError, match="the folder does not exist; create it first"):
        write(tmp_path / "no" / "a.vtkhdf", mesh)


def test_it_is_not_read(tmp_path):
    write(tmp_path / "a.vtkhdf", cube(3))
    with pytest.raises(MeshError, match=r"a.vtkhdf: is written for ParaView, but not read; use th"):
        read(tmp_path / "a.vtkhdf")


def test_a_run_writes_mesh_and_all_steps(tmp_path, capsys):
    write_sample("square", tmp_path)
    out, series = tmp_path / "out.vtkhdf", tmp_path / "steps.vtkhdf"
    words = ["--set", "STEPS=3", "--set", "GENERATE_QUALITY=NO", "--json", str(tmp_path / "r.json")]
    files = ["-o", str(out), "--steps-file", str(series), "--steps-dir", str(tmp_path / "each")]
    assert run(["run", str(tmp_path / "square.cfg"), *words, *files]) == 0
    assert f"all steps: {series}" in capsys.readouterr().out
    report = json.loads((tmp_path / "r.json").read_text())
    mesh = read(tmp_path / "mesh.su2")
    meshes = [mesh, *(read(one) for one in sorted((tmp_path / "each").iterdir()))]
    steps, times = judged(series)
    assert times == [0.0, 1.0, 2.0, 3.0]
    for blocks, now in zip(steps, meshes, strict=True):
        volume = blocks["volume"]
        assert bits(volume.points) == bits(in_space(now.points))
        assert bits(volume.cell_data["size-skew"]) == bits(quality(now, reference=mesh).values)
        shift = in_space(now.points - mesh.points)
        assert bits(volume.point_data["displacement"]) == bits(shift)
    (blocks,), _ = judged(out)
    last = blocks["volume"]
    assert bits(last.points) == bits(steps[-1]["volume"].points)
    assert last.cell_data["size-skew"].min() == report["quality"]["min"]
    assert set(last.cell_data) == {"size-skew", "size", "skew"}
    target = tmp_path / "q.vtkhdf"
    assert run(["quality", str(tmp_path / "mesh.su2"), "-o", str(target)]) == 0
    assert judged(target)[0][0]["volume"].cell_data.keys() == last.cell_data.keys()
    assert run(["convert", str(tmp_path / "mesh.su2"), str(tmp_path / "c.vtkhdf")]) == 0
    assert bits(judged(tmp_path / "c.vtkhdf")[0][0]["volume"].points) == bits(
        steps[0]["volume"].points
    )


def test_all_steps_need_a_file_that_holds_them(tmp_path, capsys):
    write_sample("square", tmp_path)
    assert run(["run", str(tmp_path / "square.cfg"), "--steps-file", "a.vtu"]) == 1
    assert "a.vtu: only .vtkhdf files hold all steps; end the name of" in capsys.readouterr().err
