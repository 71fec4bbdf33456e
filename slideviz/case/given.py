"""Displacements that are found before motions are performed: those of files and of boxes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.case.boxes import ffd_displacements
from slideviz.case.displacement import Displacements, read_displacements
from slideviz.case.model import Case, Ffd, FromFile, moves, named
from slideviz.errors import CaseError
from slideviz.mesh.model import IntArray, Mesh

Given = Mapping[object, Displacements]
"""Displacements by what `key_of` returns of their motions."""


def key_of(motion: FromFile | Ffd) -> object:
    """Return under what the displacements of a motion are kept: equal ones are the same."""
    return motion if isinstance(motion, Ffd) else (motion.path, motion.marker)


def read_files(case: Case, mesh: Mesh) -> dict[object, Displacements]:
    """Return what files and boxes displace, for `slideviz.case.motion.displacement_of`.

    Raises
    ------
    CaseError
        Some cannot be read or have mistakes: those of all files at once. A box has none of the
        nodes that it should move.
    """
    on = {
        name: mesh.marker(name).nodes
        for name in case.markers_with("moving")
        if name in mesh.marker_names
    }
    files: dict[object, Displacements] = {}
    problems: list[str] = []
    try:
        files |= ffd_displacements(case, mesh, on)
    except CaseError as problem:
        problems.append(str(problem))
    for motion in case.motions:
        mine = [nodes for name, nodes in on.items() if moves(motion, name)]
        if isinstance(motion, FromFile) and (mine or not motion.marker):
            nodes = np.unique(np.concatenate([*mine, np.empty(0, np.int64)]))
            names = " or ".join(repr(name) for name in named(motion.marker))
            of = f"marker {names}" if names else "a moving marker"
            try:
                read = _read_file(motion.path, mesh, nodes, of)
            except CaseError as problem:
                problems.append(str(problem))
            else:
                files[key_of(motion)] = read
    if problems:
        raise CaseError("\n".join(dict.fromkeys(problems)))
    return files


def _read_file(path: Path, mesh: Mesh, nodes: IntArray, of: str) -> Displacements:
    """Return the displacements of nodes, which a file calls by their numbers in the whole mesh."""
    if mesh.part is None:
        return read_displacements(path, nodes, mesh.points.shape, of)
    whole = mesh.part.n_points, mesh.dim
    return replace(read_displacements(path, mesh.part.points[nodes], whole, of), nodes=nodes)
