"""Writing VTKHDF files: the format of VTK and ParaView on HDF5, version 2.1.

A mesh is a collection of blocks: ``volume`` with the cells, and under ``boundaries`` one for each
marker, with its name, so that ParaView shows, hides and extracts boundaries by name. (A VTU file
has no blocks: all its cells are in one grid, with numbers for the boundaries.) A series of steps
has its topology once, and the points and values of all steps in one array, one step after the
other; the group ``Steps`` has the row where each begins.

The cells of a large mesh are in partitions, one after the other, so that each process of a
parallel ParaView reads some of them. Each has its own points: those between two partitions are in
both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import record
from slideviz.formats.hdf5 import Hdf5Draft, free_name, hdf5_write
from slideviz.formats.table import WriteOptions
from slideviz.mesh.model import Cells, FloatArray, IntArray, Mesh
from slideviz.system.threads import cuts

_VERSION = (2, 1)  # version of the format
_VOLUME = "volume"  # name of the block with the cells
_CHUNK_ROWS = 1 << 16  # most rows in a chunk of an HDF5 dataset that grows
PARTITION = 1 << 20  # most cells of a partition
Values = Mapping[str, NDArray]  # arrays by name, a row for each cell or point


@record
class _Block:
    group: h5py.Group  # its group in the file
    nodes: IntArray  # (n,): the mesh nodes of its points, one partition after the other
    partitions: int
    count: int  # `partitions`, `count`: numbers of its partitions and of its cells


class StepSeries:
    """A VTKHDF file in the making: `add` each step (a single mesh if not ``is_series``), `end`."""

    def __init__(self, draft: Hdf5Draft, blocks: Sequence[_Block], is_series: bool) -> None:
        self._draft = draft
        self._blocks = blocks
        self._is_series = is_series
        self._times: list[float] = []

    def add(self, points: FloatArray, cell_data: Values, point_data: Values) -> None:
        """Write the next step, whose time is its number (0 for the first).

        Raises MeshError if the file cannot be written. ``points`` (n, d): points of the mesh.
        ``cell_data``: values on its cells; the same names in every step. ``point_data``: values on
        its points; vectors get a third component.
        """
        for block in self._blocks:
            self._append(block.group, "Points", _in_space(points[block.nodes]))
            for name, values in point_data.items():
                rows = values[block.nodes]
                rows = _in_space(rows) if rows.ndim == 2 else rows
                self._append(block.group, f"PointData/{_clean(name)}", rows)
        for name, values in cell_data.items():
            self._append(self._blocks[0].group, f"CellData/{_clean(name)}", values)
        self._draft.require()
        self._times.append(float(len(self._times)))

    def _append(self, group: h5py.Group, name: str, rows: NDArray) -> None:
        """Append rows to a dataset, behind those of earlier steps; make it if there is none."""
        if not self._is_series:
            group.create_dataset(name, data=rows)
            return
        if name not in group:
            chunk = max(min(len(rows), _CHUNK_ROWS), 1)
            shape = rows.shape[1:]
            dtype = rows.dtype
            group.create_dataset(
                name, (0, *shape), dtype, maxshape=(None, *shape), chunks=(chunk, *shape)
            )
        data = group[name]
        data.resize(len(data) + len(rows), axis=0)
        data[len(data) - len(rows) :] = rows

    def end(self) -> None:
        """Write where each step begins, which completes the file."""
        if not self._is_series:
            return
        count = len(self._times)
        numbers = np.arange(count)
        for block in self._blocks:
            steps = block.group.create_group("Steps")
            steps.attrs["NSteps"] = count
            steps["Values"] = np.array(self._times)
            steps["PartOffsets"] = np.zeros(count, np.int64)
            steps["NumberOfParts"] = np.full(count, block.partitions)
            steps["PointOffsets"] = numbers * len(block.nodes)
            # All steps have the topology of the first.
            steps["CellOffsets"] = np.zeros((count, 1), np.int64)
            steps["ConnectivityIdOffsets"] = np.zeros((count, 1), np.int64)
            for kind, length in (("PointData", len(block.nodes)), ("CellData", block.count)):
                for name in block.group.get(kind, ()):
                    steps[f"{kind}Offsets/{name}"] = numbers * length


def write_vtkhdf(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh to a VTKHDF file, with values on its cells and points; or raise MeshError."""
    with vtkhdf_series(path, mesh, options.replaces, is_series=False) as series:
        series.add(mesh.points, options.cell_data, options.point_data)


@contextmanager
def vtkhdf_series(
    path: Path, mesh: Mesh, replaces: Path | None = None, is_series: bool = True
) -> Iterator[StepSeries]:
    """Context with a file to add steps to, which replaces ``path`` at the end; or MeshError.

    It has blocks and topology of a mesh, but no points yet.
    """
    with hdf5_write(path, replaces) as draft:
        # ParaView shows the assembly in the order in which it was made.
        root = draft.tree.create_group("VTKHDF", track_order=True)
        _typed(root, "PartitionedDataSetCollection")
        tree = root.create_group("Assembly", track_order=True)
        blocks = [_add_block(root, tree, _VOLUME, mesh.cells, np.arange(len(mesh.points)))]
        taken = {_VOLUME, "Assembly"}
        if mesh.markers:
            tree = tree.create_group("boundaries", track_order=True)
            taken.add("boundaries")
        for marker in mesh.markers:
            name = free_name(_clean(marker.name), taken)
            taken.add(name)
            blocks.append(_add_block(root, tree, name, marker.cells, marker.nodes))
        series = StepSeries(draft, blocks, is_series)
        yield series
        series.end()


def _add_block(
    root: h5py.Group, tree: h5py.Group, name: str, cells: Cells, nodes: IntArray
) -> _Block:
    """Add a block with its topology to the collection ``root`` and to the assembly ``tree``.

    ``nodes`` (n,) are the mesh nodes of the block, ascending; each partition has only its own.
    """
    group = root.create_group(name)
    _typed(group, "UnstructuredGrid")
    group.attrs["Index"] = len(root) - 2  # the assembly is not a block
    tree[name] = h5py.SoftLink(f"/VTKHDF/{name}")
    partitions = _partitions(cells) if len(cells) > PARTITION else [(nodes, cells)]
    group["NumberOfPoints"] = np.array([len(own) for own, _ in partitions], np.int64)
    group["NumberOfCells"] = np.array([len(part) for _, part in partitions], np.int64)
    sizes = [len(part.connectivity) for _, part in partitions]
    group["NumberOfConnectivityIds"] = np.array(sizes, np.int64)
    # Prisms are numbered as in SU2, which is VTK's order since 9.7 (vtk!12988): their volumes are
    # positive and their normals outward. VTU files have the order from before.
    group["Types"] = cells.types
    group["Offsets"] = np.concatenate([part.offsets for _, part in partitions])
    group["Connectivity"] = np.concatenate(
        [np.searchsorted(own, part.connectivity) for own, part in partitions]
    )
    every = np.concatenate([own for own, _ in partitions])
    return _Block(group, every, len(partitions), len(cells))


def _partitions(cells: Cells) -> list[tuple[IntArray, Cells]]:
    """Return for each partition its nodes (k,), ascending, and its cells (with mesh nodes)."""
    parts = [
        Cells.from_types(cells.types[a:b], cells.connectivity[cells.offsets[a] : cells.offsets[b]])
        for a, b in cuts(0, len(cells), PARTITION)
    ]
    return [(part.nodes, part) for part in parts]


def _typed(group: h5py.Group, kind: str) -> None:
    """Set the attributes ``Version`` and ``Type`` of a group, as a text of fixed length for VTK."""
    group.attrs["Version"] = np.array(_VERSION, np.int64)
    group.attrs.create("Type", np.bytes_(kind), dtype=f"S{len(kind)}")


def _in_space(rows: NDArray) -> NDArray:
    return np.pad(rows, ((0, 0), (0, 3 - rows.shape[1]))) if rows.shape[1] < 3 else rows


def _clean(name: str) -> str:
    """Return a name that HDF5 allows: without ``/``, which is its separator, and not only dots."""
    clean = name.replace("/", "_").replace("\0", "_")
    return clean if clean.strip(".") else f"_{clean}"
