"""Actors that show polygons of cells, and the same actors at other places (instances)."""

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
    """Draws polygons, or lines, in the colours of the cells they belong to.

    Parameters
    ----------
    stage : Stage
    name : str
        Of the actor.
    pickable : bool
        Whether the mouse finds it.

    Attributes
    ----------
    actor : pyvista.Actor
    mapper : pyvista.DataSetMapper
        Its mapper, kept here: what Python knows of one that only VTK holds may be out of date.
    shape : pyvista.PolyData
    polygons : Polygons
    """

    def __init__(self, stage: Stage, name: str, pickable: bool = True) -> None:
        # The plotter takes nothing that is empty, and a section may be.
        self.shape = pv.PolyData(np.zeros((3, 3)), faces=[3, 0, 1, 2])
        self.shape.cell_data[VALUES] = np.zeros(1)
        self.actor = stage.add(self.shape, name, lighting=False, pickable=pickable)
        self.mapper = self.actor.mapper
        self.polygons = Polygons(np.empty((0, 3)), *(np.zeros(n, np.int64) for n in (1, 0, 0)))
        self.actor.visibility = False

    def show(self, polygons: Polygons, lift: float = 0.0) -> None:
        """Draw polygons, raised by ``lift`` in z, with 0 for their values."""
        self.polygons = polygons
        self.shape = polygon_shape(polygons, lift)
        self.mapper.dataset = self.shape
        self.actor.visibility = len(polygons) > 0

    def colour(self, values: FloatArray | None) -> None:
        """Give the polygons the values of their cells, (q,); None: none."""
        if values is not None:
            self.shape.cell_data[VALUES] = values
        self.mapper.scalar_visibility = values is not None


def plain_colour(scheme: ColorScheme) -> tuple[float, float, float]:
    """Return the colour of polygons without values, seen on any background."""
    cell, ghost = (np.array(pv.Color(name).float_rgb) for name in (scheme.cell, scheme.ghost))
    red, green, blue = (0.7 * cell + 0.3 * ghost).tolist()
    return red, green, blue


def polygon_shape(polygons: Polygons, lift: float = 0.0) -> Any:
    """Return polygons, or lines, as PolyData with room for the values of their cells."""
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
    """Instances of one actor under matrices, with its data, mapper and property.

    Parameters
    ----------
    stage : Stage
    base : PolygonActor
        What is repeated; the instances are named like it, with their numbers.
    """

    def __init__(self, stage: Stage, base: PolygonActor) -> None:
        self.stage = stage
        self.base = base
        self.drawn: dict[int, Any] = {}

    def show(self, matrices: Mapping[int, FloatArray]) -> None:
        """Draw an instance for each matrix (4, 4), by its number; those of other numbers go."""
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
                # One mapper has one shader: that of the actor that is drawn first.
                instance.SetShaderProperty(base.GetShaderProperty())
                self.drawn[number] = instance
            self.drawn[number].user_matrix = matrix
            self.drawn[number].visibility = base.visibility
