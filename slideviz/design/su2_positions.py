"""Surface files of SU2: a node and its new position in each line, for DV_KIND= SURFACE_FILE."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.case.displacement import parse_displacements
from slideviz.case.lines import read_text
from slideviz.mesh.model import FloatArray, IntArray, Mesh


def read_positions(path: Path, nodes: IntArray, mesh: Mesh) -> FloatArray:
    """Return the new positions of nodes, (m, d); those the file does not list stay.

    Lines are ``index x y [z]`` in any order, with blanks, tabs or commas between. As in SU2,
    nodes that are on none of the moving boundaries are passed over.

    Raises
    ------
    CaseError
        The file cannot be read, or has mistakes: a line ``file:line: sentence`` for each.
    """
    text, _ = read_text(path, "displacement file")
    every = np.arange(len(mesh.points))
    read = parse_displacements(text, path, every, mesh.points.shape, "the mesh")
    listed = _listed(text)
    given = np.isin(nodes, listed)
    return np.where(given[:, None], read.at(nodes), mesh.points[nodes])


def _listed(text: str) -> IntArray:
    """Return the nodes that a file lists, whose lines are known to be right."""
    lines = (line.replace(",", " ").replace(";", " ").split() for line in text.splitlines())
    words = (row[0] for row in lines if row and row[0][0] not in "%#$")
    return np.array([int(float(word)) for word in words], np.int64)
