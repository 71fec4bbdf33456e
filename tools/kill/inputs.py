"""``python -m tools.kill.inputs FOLDER``: write what the commands read."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import slideviz as sv
from tests import builders
from tools.fuzz.kinds import BASE, PERIODIC

CONFIG = """MESH_FILENAME= mesh.su2
MESH_OUT_FILENAME= out.su2
DV_KIND= TRANSLATION
DV_MARKER= ( BLOCK )
DV_PARAM= ( 1.0, 0.0, 0.0 )
DV_VALUE= 0.01
"""


def write_inputs(folder: Path) -> None:
    """Write what commands read."""
    mesh = builders.square(24, "mixed")
    sv.write(folder / "mesh.su2", mesh)
    sv.write(folder / "mesh.su2b", mesh)
    points = np.array(mesh.points)
    inner = np.setdiff1d(np.arange(len(points)), np.concatenate([m.nodes for m in mesh.markers]))
    points[inner[:5]] += 0.06
    sv.write(folder / "folded.su2", mesh.with_points(points))
    sv.write(folder / "solid.su2", builders.passage((3, 4, 4)))
    (folder / "case.cfg").write_text(BASE)
    (folder / "repeats.cfg").write_text(PERIODIC)
    (folder / "config.cfg").write_text(CONFIG)
    (folder / "designs.csv").write_text("BLOCK.translate.x\n0.01\n0.02\n0.03\n")


if __name__ == "__main__":
    write_inputs(Path(sys.argv[1]))
