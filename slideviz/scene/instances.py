"""Actors drawn again at other places: what repeats takes the memory of one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pyvista as pv

from slideviz.mesh.model import FloatArray
from slideviz.scene.polygon_actor import PolygonActor
from slideviz.scene.stage import Stage


class Twins:
    """Images of one actor under matrices, with its data, mapper and property.

    Parameters
    ----------
    stage : Stage
    base : PolygonActor
        What is repeated; the twins are named like it, with their numbers.
    """

    def __init__(self, stage: Stage, base: PolygonActor) -> None:
        self.stage = stage
        self.base = base
        self.drawn: dict[int, Any] = {}

    def show(self, matrices: Mapping[int, FloatArray]) -> None:
        """Draw one under each matrix (4, 4), by its number; those of other numbers go."""
        for number in [number for number in self.drawn if number not in matrices]:
            self.stage.remove(self.drawn.pop(number).name)
        base = self.base.actor
        for number, matrix in matrices.items():
            if number not in self.drawn:
                name = f"{base.name}:{number}"
                twin = pv.Actor(mapper=self.base.mapper, prop=base.prop, name=name)
                self.stage.plotter.add_actor(
                    twin, name=twin.name, reset_camera=False, render=False, pickable=True
                )
                # One mapper has one shader: that of the actor that is drawn first.
                twin.SetShaderProperty(base.GetShaderProperty())
                self.drawn[number] = twin
            self.drawn[number].user_matrix = matrix
            self.drawn[number].visibility = base.visibility
