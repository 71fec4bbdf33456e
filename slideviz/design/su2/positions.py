"""Surface files of SU2: a node and its new position in each line, for DV_KIND= SURFACE_FILE."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from slideviz.case.displacement import Columns, parse_rows
from slideviz.case.lines import read_text
from slideviz.design.su2.config import Su2Config
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh

POSITION = Columns("position", ("x", "y", "z"), flat=True)


@dataclass(frozen=True, eq=False)
class ListedPositions:
    """New positions of nodes, as a file lists them (a `Displacer`)."""

    config: Su2Config
    mesh: Mesh
    nodes: IntArray

    @cached_property
    def _listed(self) -> tuple[FloatArray, tuple[str, ...]]:
        config = self.config
        of = f"{config.named[config.markers[0]]}= ({', '.join(config.markers)})"
        return read_positions(config.files["DV_FILENAME"], self.nodes, self.mesh, of)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what reading the file found."""
        return self._listed[1]

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return that no variable is without effect."""
        return (False,) * len(self.config.variables)

    @property
    def inside(self) -> dict[str, int]:
        """Return that no FFD box moves nodes."""
        return {}

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes."""
        return self._listed[0] - self.mesh.points[self.nodes]

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return zeros (m, d): the variable has no value to change."""
        del place, part, undeformed
        return np.zeros((len(self.nodes), self.mesh.dim))

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return the mesh: its FFD boxes stay."""
        return mesh


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
        sentence = f"{path}: {others} of {len(listed)} nodes are not on {of}; they are passed over"
        warnings = (*warnings, sentence)
    return positions, warnings
