"""Displacements that are found before the motions are performed: by files, boxes and bumps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.case.boxes import ffd_displacements
from slideviz.case.bumps import bump_displacements
from slideviz.case.displacement import Displacements, read_displacements
from slideviz.case.model import BoxMotion, Case, FromFile, OnAirfoil, moves, named
from slideviz.errors import CaseError
from slideviz.mesh.model import IntArray, Mesh

Given = Mapping[object, Displacements]
"""Displacements by the key (`key_of`) of their motion."""


def key_of(motion: FromFile | BoxMotion | OnAirfoil) -> object:
    """Return the key of a motion in `Given`; motions with the same displacements share it."""
    return (motion.path, motion.marker) if isinstance(motion, FromFile) else motion


def placed_displacements(
    case: Case, mesh: Mesh, names: Iterable[str]
) -> dict[object, Displacements]:
    """Return the displacements by motions that depend on undeformed places, by their motion.

    ``names`` are the moving markers. Raises CaseError where such a motion moves no node.
    """
    return ffd_displacements(case, mesh, names) | bump_displacements(case, mesh, names)


def given_displacements(case: Case, mesh: Mesh) -> dict[object, Displacements]:
    """Return the displacements by files, FFD boxes and bumps of a case, by `key_of` their motion.

    Raises
    ------
    CaseError
        A file cannot be read or has mistakes, or a box has none of the nodes that it should move;
        the message has all of these.
    """
    on = {
        name: mesh.marker(name).nodes
        for name in case.markers_with("moving")
        if name in mesh.marker_names
    }
    files: dict[object, Displacements] = {}
    problems: list[str] = []
    try:
        files |= placed_displacements(case, mesh, on)
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
    """Return the displacements of ``nodes`` (k,) of a mesh, which may be a part of a larger one.

    In the file nodes have their numbers in the whole mesh.
    """
    if mesh.part is None:
        return read_displacements(path, nodes, mesh.points.shape, of)
    shape = mesh.part.n_points, mesh.dim
    return replace(read_displacements(path, mesh.part.points[nodes], shape, of), nodes=nodes)
