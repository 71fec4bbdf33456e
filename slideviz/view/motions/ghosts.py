"""Where the motions will take the moving boundaries, before anything is computed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.case.displacement import Displacements, read_displacements
from slideviz.case.model import Case, FromFile
from slideviz.case.motion import moved_points
from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray, Mesh


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
        found = {}
        for name in case.markers_with("moving"):
            nodes = self._nodes.get(name)
            motions = [motion for motion in case.motions if motion.marker in ("", name)]
            if nodes is None or not motions:
                continue
            files = {}
            for motion in motions:
                if isinstance(motion, FromFile):
                    read = self._read(motion, case)
                    if read is not None:
                        files[motion.path, motion.marker] = read
            found[name] = moved_points(motions, self.mesh.points[nodes], nodes, files)
        return found

    def _read(self, motion: FromFile, case: Case) -> Displacements | None:
        # A file of all moving boundaries lists nodes of each.
        names = (motion.marker,) if motion.marker else case.markers_with("moving")
        try:
            key = (motion.path, names, motion.path.stat().st_mtime)
        except OSError:
            return None
        if key not in self._files:
            every = [self._nodes[name] for name in names if name in self._nodes]
            wanted = np.unique(np.concatenate(every))
            shape, of = self.mesh.points.shape, f"boundaries {', '.join(names)}"
            try:
                self._files[key] = read_displacements(motion.path, wanted, shape, of)
            except SlidevizError:
                self._files[key] = None
        return self._files[key]
