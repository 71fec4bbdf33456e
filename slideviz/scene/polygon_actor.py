"""Actors of polygons in the colors of their cells, and instances of them at other places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import ColorScheme
from slideviz.mesh.model import FloatArray
from slideviz.scene.actors import VALUES
from slideviz.scene.stage import Stage
from slideviz.sections.polygons import Polygons


class PolygonActor:
    """An actor that draws polygons, or lines, in the colors of the cells they belong to.

    Parameters
    ----------
    stage : Stage
    name : str
        The name of the actor.
    pickable : bool
        Whether the mouse can pick it.
    """

    def __init__(self, stage: Stage, name: str, pickable: bool = True) -> None:
        # The plotter refuses an empty data set, which a section may have.
        self.shape = pv.PolyData(np.zeros((3, 3)), faces=[3, 0, 1, 2])
        """The data set that is drawn."""
        self.shape.cell_data[VALUES] = np.zeros(1)
        self.actor = stage.add(self.shape, name, lighting=False, pickable=pickable)
        self.mapper = self.actor.mapper
        """The actor's mapper, referenced here as VTK alone may lose its Python attributes."""
        self.polygons = Polygons(np.empty((0, 3)), *(np.zeros(n, np.int64) for n in (1, 0, 0)))
        """The polygons that are drawn."""
        self.actor.visibility = False

    def show(self, polygons: Polygons, lift: float = 0.0) -> None:
        """Draw other polygons, raised by ``lift`` in z, all with the value 0."""
        self.polygons = polygons
        self.shape = polygon_shape(polygons, lift)
        self.mapper.dataset = self.shape
        self.actor.visibility = len(polygons) > 0

    def color(self, values: FloatArray | None) -> None:
        """Color the polygons by values (q,), one per polygon; None: by the actor's own color."""
        if values is not None:
            self.shape.cell_data[VALUES] = values
        self.mapper.scalar_visibility = values is not None


def plain_color(scheme: ColorScheme) -> tuple[float, float, float]:
    """Return the color of polygons without values, visible on any background."""
    cell, ghost = (np.array(pv.Color(name).float_rgb) for name in (scheme.cell, scheme.ghost))
    red, green, blue = (0.7 * cell + 0.3 * ghost).tolist()
    return red, green, blue


def polygon_shape(polygons: Polygons, lift: float = 0.0) -> Any:
    """Return polygons, or lines, as PolyData, raised by ``lift`` in z, with values of 0."""
    shape = pv.PolyData()
    shape.points = polygons.points + np.array([0.0, 0.0, lift])
    table = pv.CellArray.from_arrays(polygons.offsets, polygons.connectivity)  # type: ignore[arg-type]
    if len(polygons) and polygons.sizes.max() == 2:
        shape.SetLines(table)
    else:
        shape.SetPolys(table)
    shape.cell_data[VALUES] = np.zeros(len(polygons))
    return shape


class Instances:
    """Instances of one actor at other places, which share its data set, mapper and property.

    Parameters
    ----------
    stage : Stage
    base : PolygonActor
        The actor that is repeated; its name and a number are the name of an instance.
    """

    def __init__(self, stage: Stage, base: PolygonActor) -> None:
        self.stage = stage
        self.base = base
        self.drawn: dict[int, Any] = {}
        """The instances by number."""

    def show(self, matrices: Mapping[int, FloatArray]) -> None:
        """Draw an instance for each matrix (4, 4), by number; remove those of other numbers."""
        for number in [number for number in self.drawn if number not in matrices]:
            self.stage.remove(self.drawn.pop(number).name)
        base = self.base.actor
        for number, matrix in matrices.items():
            if number not in self.drawn:
                name = f"{base.name}:{number}"
                instance = pv.Actor(mapper=self.base.mapper, prop=base.prop, name=name)
                self.stage.plotter.add_actor(
                    instance, name=instance.name, reset_camera=False, render=False, pickable=True
                )
                # A shared mapper uses the shader of the actor that is drawn first: share it.
                instance.SetShaderProperty(base.GetShaderProperty())
                self.drawn[number] = instance
            self.drawn[number].user_matrix = matrix
            self.drawn[number].visibility = base.visibility
