"""``python -m tools.study.closing_gap FILE``: layers at a blade's tip and its casing, by the gap.

A rounded tip with ten layers is moved towards a casing with as many: to half of the gap, to where
layers begin to give way, and beyond. Cells of layers are colored by their height over that in the
undeformed mesh.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import slideviz as sv
from slideviz.mesh.walls import find_columns
from slideviz.plots.figure_io import empty_figure
from tools.study.flows import grid_mesh
from tools.study.leading_edge import LAYERS, panel_of, ratios_of, save_scaled

GAPS = (0.1, 0.05, 0.03)  # what is left of `OPEN`
OPEN = 0.2
COLUMNS, CORE = 60, 16
INCHES, DPI = (10.0, 2.8), 160


def tip_gap() -> sv.Mesh:
    """Return a section of the gap between a rounded tip, ``TIP``, and a ``CASING``."""
    layer = np.concatenate([[0.0], np.cumsum(2e-3 * 1.2 ** np.arange(10))])
    middle = np.linspace(layer[-1], OPEN - layer[-1], CORE + 1)[1:-1]
    up = np.concatenate([layer, middle, OPEN - layer[::-1]]) / OPEN
    x = np.linspace(-0.5, 0.5, COLUMNS + 1)
    below = -0.8 * x**2
    y = below + (OPEN - below) * up[:, None]
    node = np.arange(y.size).reshape(y.shape)
    sides = {"TIP": node[0], "CASING": node[-1], "IN": node[:, 0], "OUT": node[:, -1]}
    return grid_mesh(x + 1j * y, node.T, sides)


def draw(path: Path) -> Path:
    """Write the picture to ``path``; return the path."""
    mesh = tip_gap()
    columns = find_columns(mesh, LAYERS, ("TIP", "CASING"))
    roles = {"TIP": "moving", "IN": "sliding", "OUT": "sliding"}
    figure = empty_figure(INCHES, DPI, "constrained")
    axes = figure.subplots(1, len(GAPS))
    for panel, gap in zip(axes, GAPS, strict=True):
        motion = sv.Translate("TIP", (0.0, OPEN - gap))
        case = sv.Case(
            roles=roles, motions=(motion,), sliding="ps", relax="yes", layers="auto", rims="slide"
        )
        *_, last = sv.deform(case, mesh)
        walls = sv.walls(last.mesh, mesh, ["TIP", "CASING"]).summary()
        heights = [walls[name]["first_height"]["ratio"]["min"] for name in walls]
        image = panel_of(panel, last.mesh, ratios_of(columns, mesh, last.mesh), (0.0, 2.0))
        panel.set_title(f"gap {gap:g} of {OPEN:g}", fontsize=10, fontweight="bold")
        words = "first heights × " + (f"{min(heights):.2f} to 1" if min(heights) < 0.995 else "1")
        least = sv.quality(last.mesh, mesh).min
        panel.set_xlabel(f"{words}\nlowest quality {least:.2f}", fontsize=9)
        panel.set_xlim(-0.1, 0.1)
        panel.set_ylim(OPEN - 1.2 * GAPS[0], OPEN + 0.01)
    return save_scaled(path, figure, image, "cells", "max")


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
