"""Which cell is under the mouse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray


def on_plane(plotter: Any, x: float, y: float) -> tuple[float, float]:
    """Return where the line of sight through a pixel meets the plane z = 0."""
    renderer = plotter.renderer
    ends = []
    for depth in (0.0, 1.0):
        renderer.SetDisplayPoint(x, y, depth)
        renderer.DisplayToWorld()
        point = np.array(renderer.GetWorldPoint())
        ends.append(point[:3] / point[3])
    near, far = ends
    along = near[2] / (near[2] - far[2])
    at = near + along * (far - near)
    return float(at[0]), float(at[1])


def front_cell(
    plotter: Any, x: float, y: float, shown: Sequence[tuple[Any, IntArray | FloatArray]]
) -> int | None:
    """Return the cell whose side is in front at a pixel.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
    x, y : float
        Pixels from the lower left.
    shown : sequence of (actor, (f,) int64)
        What may be met, each with the cells that its polygons are the sides of.
    """
    from vtkmodules.vtkRenderingCore import vtkCellPicker

    picker = vtkCellPicker()
    picker.SetTolerance(0.0)
    picker.PickFromListOn()
    owners = {}
    for actor, owner in shown:
        picker.AddPickList(actor)
        owners[actor] = owner
    picker.Pick(x, y, 0.0, plotter.renderer)
    found = owners.get(picker.GetActor())
    return int(found[picker.GetCellId()]) if found is not None else None
