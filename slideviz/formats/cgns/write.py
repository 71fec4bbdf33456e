"""Writing CGNS meshes: a copy of the file that the mesh was read from, with other coordinates.

All else in the file (solutions, units, families, connectivities) is copied.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from slideviz.errors import path_error, printable
from slideviz.formats.cgns.join import JOINED
from slideviz.formats.cgns.read import CgnsForm
from slideviz.formats.hdf5 import hdf5_write
from slideviz.formats.table import WriteOptions
from slideviz.mesh.check import check_mesh
from slideviz.mesh.model import FloatArray, Mesh


def write_cgns(path: Path, mesh: Mesh, options: WriteOptions) -> None:
    """Write a mesh that was read from a CGNS file as a copy of that file with its points.

    Coordinates that did not change keep the bits of the file; others are rounded to the file's
    type, R4 or R8. Raises MeshError if the mesh was not read from a CGNS file, that file was
    changed, or the new one cannot be written.
    """
    check_mesh(mesh)
    form, source = require_cgns(mesh, path)
    try:
        with hdf5_write(path, options.replaces, source) as draft:
            _replace(path, source, draft.tree, form, mesh.points)
    except OSError as problem:
        raise path_error(
            path,
            f"cannot be written: {printable(source)}, of which it is a copy, cannot be read: "
            f"{problem.strerror or problem}; put that file back, or write .su2",
        ) from problem


def require_cgns(mesh: Mesh, path: Path) -> tuple[CgnsForm, Path]:
    """Return where the coordinates of a mesh are in the CGNS file it was read from, and that file.

    ``path`` is the file to write, for messages. Raises MeshError if it was not read from a CGNS
    file, so it cannot be written as one.
    """
    form, source = mesh.origin, mesh.source
    if not (isinstance(form, CgnsForm) and source and len(mesh.points) == len(form.points)):
        raise path_error(
            path,
            "a CGNS file is written as a copy of the one that the mesh was read from, with other "
            f"coordinates, but {mesh.name} is from none; write .su2, or .vtu for ParaView",
        )
    return form, source


def _replace(path: Path, source: Path, tree: h5py.File, form: CgnsForm, points: FloatArray) -> None:
    """Write ``points`` (n, d) into the copy of the file, whose root is ``tree``.

    Raises MeshError if the coordinates there are not those that were read, or if the new ones are
    too large for their type. ``path`` is the new file, ``source`` the one it is a copy of.
    """
    tolerance = JOINED * float(np.ptp(form.points, axis=0).max())
    for names, numbers in zip(form.datasets, form.numbers, strict=True):
        for axis, name in enumerate(names):
            dataset = tree.get(name)
            before, after = form.points[numbers, axis], points[numbers, axis]
            if not isinstance(dataset, h5py.Dataset) or dataset.size != len(numbers):
                raise _changed(path, source, name)
            values = np.asarray(dataset[()])
            if not (np.abs(values.ravel() - before) <= tolerance).all():
                raise _changed(path, source, name)
            with np.errstate(over="ignore"):
                rounded = after.astype(values.dtype)
            if not np.isfinite(rounded).all():
                raise path_error(
                    path,
                    f"cannot be written: a coordinate is larger than {values.dtype} holds, the "
                    f"type of {printable(name)}; write .su2, or scale the mesh",
                )
            moved = before != after
            dataset[...] = np.where(moved, rounded, values.ravel()).reshape(values.shape)


def _changed(path: Path, source: Path, name: str) -> Exception:
    """Return the error for a file whose dataset ``name`` changed after the mesh was read."""
    return path_error(
        path,
        f"cannot be written: {printable(source)}, of which it is a copy, was changed after the "
        f"mesh was read ({printable(name)}); read that file again",
    )
