"""``python -m tools.study.leading_edge FILE``: the layer at a vane's leading edge, by each method.

The vane of the sample ``turbine-row`` is turned; each panel is turned back with it. Cells of the
layer are colored by their height over that in the undeformed mesh.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import slideviz as sv
from slideviz.mesh.walls import find_columns
from slideviz.plots.figure_io import empty_figure
from tools.shots import shrink
from tools.study.contest import METHODS, TURNED_BY, turned_row

PANELS = {
    "undeformed": "Undeformed",
    "rbf": "Radial basis functions",
    "elastic": "Linear elasticity",
    "auto": "Relaxed, layers kept",
}
"""Methods of the contest, and the titles of their panels."""
INCHES, DPI = (10.0, 3.0), 160
LOW, HIGH = 0.8, 1.2
"""Ratios of heights at the ends of the color scale."""
LAYERS = 30
"""More layers than the mesh has."""


def draw(path: Path, size: int = 20_000) -> Path:
    """Write the picture, of a mesh of about ``size`` cells, to ``path``; return the path."""
    mesh, case = turned_row(size)
    columns = find_columns(mesh, LAYERS)
    figure = empty_figure(INCHES, DPI, "constrained")
    axes = figure.subplots(1, len(PANELS))
    blade = mesh.points[mesh.marker("BLADE").nodes]
    nose = blade[np.argmin(blade[:, 0])]
    reach = 0.07 * float(np.ptp(blade[:, 1]))
    centre, back = blade.mean(axis=0), np.radians(TURNED_BY) if TURNED_BY else 0.0
    turn = np.array([[np.cos(back), -np.sin(back)], [np.sin(back), np.cos(back)]])
    for panel, (method, title) in zip(axes, PANELS.items(), strict=True):
        moved, label = mesh, f"first heights 1\n{len(mesh.cells):,} cells"
        if method != "undeformed":
            deformed = METHODS[method](mesh, case)
            moved = deformed.with_points((deformed.points - centre) @ turn + centre)
            wall = sv.walls(deformed, mesh, ["BLADE"]).summary()["BLADE"]
            ratio, angle = wall["first_height"]["ratio"], wall["angle"]["change"]["max"]
            low, high = f"{ratio['min']:.2f}", f"{ratio['max']:.2f}"
            label = (
                f"first heights × {low}{f' to {high}' if low != high else ''}\n"
                f"first edges turned by up to {angle:.{0 if angle > 1 else 1}f}°"
            )
        image = panel_of(panel, moved, ratios_of(columns, mesh, moved))
        panel.set_title(title, fontsize=10, fontweight="bold")
        panel.set_xlabel(label, fontsize=9)
        panel.set_xlim(nose[0] - 0.4 * reach, nose[0] + 1.6 * reach)
        panel.set_ylim(nose[1] - 0.4 * reach, nose[1] + 1.6 * reach)
    return save_scaled(path, figure, image, "the layers' cells", "both")


def ratios_of(columns: Any, mesh: sv.Mesh, moved: sv.Mesh) -> dict[tuple[int, ...], float]:
    """Return the heights, after over before, of the quadrilaterals of a layer, by their nodes."""
    out = {}
    for facet in np.flatnonzero(columns.depth):
        sides = columns.nodes[columns.corner[facet]]
        for layer in range(columns.depth[facet]):
            nodes = sides[:, layer : layer + 2]
            after, before = (
                np.linalg.norm(x[nodes[:, 1]] - x[nodes[:, 0]], axis=1).mean()
                for x in (moved.points, mesh.points)
            )
            out[tuple(sorted(nodes.ravel().tolist()))] = after / before
    return out


def panel_of(
    axes: Any,
    mesh: sv.Mesh,
    ratios: dict[tuple[int, ...], float],
    limits: tuple[float, float] = (LOW, HIGH),
) -> Any:
    """Draw the cells of a mesh into axes; return what has the color scale."""
    from matplotlib.collections import PolyCollection

    scale = {"cmap": "RdBu_r", "clim": limits, "edgecolors": "#444444", "linewidths": 0.35}
    for _, nodes in mesh.cells.by_type.values():
        shape = PolyCollection(mesh.points[nodes], **scale)
        found = [ratios.get(tuple(sorted(row)), np.nan) for row in nodes.tolist()]
        shape.set_array(np.ma.masked_invalid(found))
        shape.get_cmap().set_bad("#ffffff")
        axes.add_collection(shape)
        if not np.isnan(found).all():
            image = shape
    axes.set_aspect("equal")
    axes.set_facecolor("#999999")
    axes.set_xticks([])
    axes.set_yticks([])
    return image


def save_scaled(path: Path, figure: Any, image: Any, cells: str, extend: str) -> Path:
    """Write a figure with a scale of the heights of ``cells``; return the path."""
    bar = figure.colorbar(image, ax=figure.axes, aspect=25, pad=0.01, extend=extend)
    bar.set_label(f"height of {cells}, after / before", fontsize=9)
    bar.ax.tick_params(labelsize=9)
    figure.savefig(path)
    shrink(path)
    return path


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
