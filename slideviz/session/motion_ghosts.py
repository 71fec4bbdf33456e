"""Where the motions will take the moving boundaries, before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from slideviz.case.displacement import Displacements, read_displacements
from slideviz.case.model import Case, FromFile, Target, moves
from slideviz.case.motion import moved_together
from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray, IntArray, Mesh


class Ghosts:
    """Moved boundaries of one mesh; displacement files are read once and again when changed."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._nodes = {marker.name: marker.nodes for marker in mesh.markers}
        self._files: dict[tuple[Path, tuple[str, ...], float], Displacements | None] = {}

    def moved(self, case: Case) -> dict[str, FloatArray]:
        """Return for each boundary that moves where its nodes, (u, d), go.

        A displacement file that cannot be read moves nothing here; the run will say why.
        """
        on = {
            name: self._nodes[name]
            for name in case.markers_with("moving")
            if name in self._nodes and any(moves(motion, name) for motion in case.motions)
        }
        files: dict[tuple[Path, Target], Displacements] = {}
        for motion in case.motions:
            if isinstance(motion, FromFile) and (read := self._read(motion, on)) is not None:
                files[motion.path, motion.marker] = read
        points = self.mesh.points
        moved = moved_together(case.motions, points, on, files)
        return {name: points[nodes] + moved[name] for name, nodes in on.items()}

    def _read(self, motion: FromFile, on: Mapping[str, IntArray]) -> Displacements | None:
        # A file of several boundaries lists nodes of each.
        names = tuple(name for name in on if moves(motion, name))
        if not names:
            return None
        try:
            key = (motion.path, names, motion.path.stat().st_mtime)
        except OSError:
            return None
        if key not in self._files:
            wanted = np.unique(np.concatenate([on[name] for name in names]))
            shape, of = self.mesh.points.shape, f"boundaries {', '.join(names)}"
            try:
                self._files[key] = read_displacements(motion.path, wanted, shape, of)
            except SlidevizError:
                self._files[key] = None
        return self._files[key]
