"""The boxes for free-form deformation in the scene: their control points, joined by lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from slideviz.case.boxes import boxes_for
from slideviz.case.model import Case, Ffd
from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.surfaces import facet_connectivity, lifted
from slideviz.scene.stage import Layer, Stage
from slideviz.session.state import Session
from slideviz.terms import ROLES

NAMES = ("boxes:undeformed", "boxes:moved")


class BoxLayer(Layer):
    """The control points of all boxes, and of those that motions move where they come to be."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self._key: tuple[object, ...] = ()

    def clear(self) -> None:
        """Forget the mesh."""
        self._key = ()

    def update(self, _old: Session | None, new: Session) -> None:
        """Draw another state of the session."""
        if new.mesh is None:
            return
        shown = "ffd" in new.view.drawn
        case = new.case
        definition = case.ffd_boxes, case.ffd_degrees, case.ffd_blending, case.ffd_orders
        key = (new.mesh, _ffd_motions(case), definition, self.stage.scheme) if shown else ()
        if key == self._key:
            return
        self._key = key
        colours = self.stage.scheme.text, ROLES["moving"].colour
        drawn = lattices(case, new.mesh) if shown else ([], [])
        for name, colour, found in zip(NAMES, colours, drawn, strict=True):
            self.stage.remove(name)
            if found:
                shape = lattice_shape(found, new.mesh.dim, 4.0 * self.stage.lift(new.mesh))
                actor = self.stage.add(shape, name, lighting=False, pickable=False)
                actor.prop.color, actor.prop.line_width = colour, 1.5
                actor.prop.point_size = 7.0 * self.stage.font_scale
                actor.prop.render_points_as_spheres = True


def _ffd_motions(case: Case) -> tuple[Ffd, ...]:
    return tuple(motion for motion in case.motions if isinstance(motion, Ffd))


def lattices(case: Case, mesh: Mesh) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return the control points (I, J, K, 3) of the boxes, and of those that motions move.

    Of a box with a mistake, which the panel of motions tells, there are none.
    """
    try:
        boxes = boxes_for(case, mesh)
    except SlidevizError:
        return [], []
    moved = dict(boxes)
    for motion in _ffd_motions(case):
        box = moved.get(motion.box)
        if box is not None and any(motion.vector) and not box.problem(motion.index):
            moved[motion.box] = box.moved(box.change(motion.index, motion.vector))
    others = [box.points for name, box in moved.items() if box is not boxes[name]]
    return [box.points for box in boxes.values()], others


def lattice_shape(boxes: list[FloatArray], dim: int, lift: float) -> Any:
    """Return control points (I, J, K, 3) of boxes and the lines between neighbours as PolyData.

    In 2D, where a box is one cell thick, they are in the plane, raised by ``lift``.
    """
    points, lines, start = [], [], 0
    for box in boxes:
        flat = box[:, :, :1] if dim == 2 else box
        ids = start + np.arange(flat[..., 0].size).reshape(flat.shape[:3])
        for axis in range(3):
            along = np.moveaxis(ids, axis, 0)
            lines.append(np.stack([along[:-1].ravel(), along[1:].ravel()], axis=1))
        points.append(flat.reshape(-1, 3))
        start += ids.size
    at = lifted(np.concatenate(points)[:, :dim], lift)
    return pv.PolyData(
        at,
        lines=facet_connectivity(np.concatenate(lines)),
        verts=np.column_stack([np.ones(start, np.int64), np.arange(start)]).ravel(),
    )
