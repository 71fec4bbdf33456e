"""Surface files of SU2: a node and its new position in each line, for DV_KIND= SURFACE_FILE."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.case.displacement import Columns, parse_rows
from slideviz.case.lines import read_text
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh

POSITION = Columns("position", ("x", "y", "z"), flat=True)


def read_positions(
    path: Path, nodes: IntArray, mesh: Mesh, of: str
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the new positions of nodes, (m, d), and warnings; nodes that are not listed stay.

    Lines are ``index x y [z]`` in any order, with blanks, tabs or commas between; a plane mesh may
    have a z of 0. As in SU2, nodes that are on none of the moving boundaries are ignored, but with
    a warning.

    Parameters
    ----------
    path : Path
        The file.
    nodes : (m,) int64
        Of the moving boundaries, ascending.
    mesh : Mesh
    of : str
        Key and moving boundaries for messages: ``DV_MARKER= (low)``.

    Raises
    ------
    CaseError
        The file cannot be read, has mistakes (a line ``file:line: sentence`` for each), or none of
        these nodes.
    """
    text, warnings = read_text(path, "surface file")
    every = np.arange(len(mesh.points))
    table = parse_rows(text, path, every, mesh.points.shape, "the mesh", POSITION)
    listed = table[:, 0].astype(np.int64)
    moving = np.isin(listed, nodes)
    others = int(np.count_nonzero(~moving))
    if others == len(listed):
        raise CaseError(
            f"{path}: none of its {others} nodes is on {of}, so that nothing would move; correct "
            "the file or the boundaries"
        )
    positions = mesh.points[nodes]
    positions[np.searchsorted(nodes, listed[moving])] = table[moving, 1:]
    if others:
        said = f"{path}: {others} of {len(listed)} nodes are not on {of}; they are passed over"
        warnings = (*warnings, said)
    return positions, warnings
