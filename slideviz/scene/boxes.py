"""The boxes for free-form deformation in the scene: their control points, joined by lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv

from slideviz.case.boxes import box_changes, box_definition, box_motions, boxes_for
from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from slideviz.ffd.box import Box
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.surfaces import facet_connectivity, lifted
from slideviz.scene.actors import draw_in_front
from slideviz.scene.color_legend import set_letters
from slideviz.scene.stage import KeyedLayer
from slideviz.session.state import Session
from slideviz.terms import ROLES

BASE, MOVED, BEHIND, LABELS = "boxes:undeformed", "boxes:moved", "boxes:behind", "boxes:-labels"
"""Names of actors: undeformed boxes, moved ones, parts behind the mesh, labels."""

ENDS = (0, 0, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)
"""Indices of a box's first control point, and of those at the ends of its edges in i, j and k."""

FAINT, CLEAR = 0.3, 0.75
"""Opacity of parts that the mesh hides: of undeformed boxes, and of their moved parts."""


class BoxLayer(KeyedLayer):
    """The lattices of control points of all boxes, undeformed and as moved by the motions.

    Parts that the mesh hides are drawn faintly, moved ones clearly. The name of a box is beside its
    first control point, and i, j and k are at the other ends of the edges from there.
    """

    names = (BASE, MOVED, BEHIND, f"{MOVED}:behind", LABELS)

    def key(self, session: Session) -> tuple[object, ...]:
        """Return the boxes, their motions and the style, if they are shown."""
        if session.mesh is None or "ffd" not in session.view.drawn:
            return ()
        case, style = session.case, (self.stage.scheme, self.stage.pixel_scale)
        return session.mesh, box_motions(case), box_definition(case), style

    def draw(self, session: Session) -> None:
        """Draw the lattices and their labels."""
        mesh = session.mesh
        if not self._key or mesh is None:
            return
        boxes, moved = lattices(session.case, mesh)
        lift = 4.0 * self.stage.lift(mesh)
        every = {
            name: (box.points, np.ones(box.points.shape[:3], bool)) for name, box in boxes.items()
        }
        changed = {
            name: (box.points, (box.points != boxes[name].points).any(axis=-1))
            for name, box in moved.items()
        }
        colors = self.stage.scheme.text, ROLES["moving"].color
        for name, color, lattice in zip((BASE, MOVED), colors, (every, changed), strict=True):
            if not lattice:
                continue
            shape = lattice_shape(list(lattice.values()), mesh.dim, lift)
            self._add(shape, name, color)
            if mesh.dim == 3:
                behind = self._add(shape, BEHIND if name == BASE else f"{MOVED}:behind", color)
                behind.prop.opacity = FAINT if name == BASE else CLEAR
                draw_in_front(behind.mapper)
        if boxes:
            self._label(boxes, mesh.dim, lift)

    def _add(self, shape: Any, name: str, color: str) -> Any:
        actor = self.stage.add(shape, name, lighting=False, pickable=False)
        scale = self.stage.pixel_scale
        actor.prop.color = color
        actor.prop.line_width, actor.prop.point_size = 2.0 * scale, 8.0 * scale
        actor.prop.render_points_as_spheres = True
        return actor

    def _label(self, boxes: dict[str, Box], dim: int, lift: float) -> None:
        at, words = [], []
        for name, box in boxes.items():
            first, i, j, k = (box.points[end] for end in ENDS)
            at += [first, i, j, k][: dim + 1]
            words += [f"\u2002{word}" for word in (name, *"ijk")[: dim + 1]]
        labels = self.stage.plotter.add_point_labels(
            lifted(np.array(at)[:, :dim], lift),
            words,
            name=LABELS.removesuffix("-labels"),  # PyVista adds it
            shape=None,
            show_points=False,
            always_visible=True,
            reset_camera=False,
            render=False,
            pickable=False,
        )
        # The text property belongs to the filter that precedes the mapper.
        letters = labels.mapper.GetInputConnection(0, 0).GetProducer().GetTextProperty()
        set_letters(letters, self.stage.scheme, 13 * self.stage.font_scale)


def lattices(case: Case, mesh: Mesh) -> tuple[dict[str, Box], dict[str, Box]]:
    """Return the undeformed boxes, and the deformed ones of those that motions move, by name.

    None of both if a box is not valid, which is reported elsewhere.
    """
    try:
        boxes = boxes_for(case, mesh)
    except SlidevizError:
        return {}, {}
    moved = {}
    for name, changes in box_changes(case, mesh, boxes).items():
        total = np.sum([change for _, _, change in changes], axis=0)
        if total.any():
            moved[name] = boxes[name].moved(total)
    return boxes, moved


def lattice_shape(boxes: list[tuple[FloatArray, np.ndarray]], dim: int, lift: float) -> Any:
    """Return control points and the lines between neighbouring ones as PolyData.

    Parameters
    ----------
    boxes : list of ((I, J, K, 3) float64, (I, J, K) bool)
        The control points of each box, and which of them are drawn; lines have one of these at
        least.
    dim : int
        In 2D only the layer k = 0 is drawn.
    lift : float
        Height above z = 0 in 2D.
    """
    points, lines, wanted, start = [], [], [], 0
    for box, drawn in boxes:
        flat, on = (box[:, :, :1], drawn[:, :, :1]) if dim == 2 else (box, drawn)
        ids = start + np.arange(on.size).reshape(on.shape)
        for axis in range(3):
            along, seen = np.moveaxis(ids, axis, 0), np.moveaxis(on, axis, 0)
            pairs = np.stack([along[:-1].ravel(), along[1:].ravel()], axis=1)
            lines.append(pairs[(seen[:-1] | seen[1:]).ravel()])
        points.append(flat.reshape(-1, 3))
        wanted.append(ids[on])
        start += ids.size
    dots = np.concatenate(wanted)
    return pv.PolyData(
        lifted(np.concatenate(points)[:, :dim], lift),
        lines=facet_connectivity(np.concatenate(lines)),
        verts=np.column_stack([np.ones(len(dots), np.int64), dots]).ravel(),
    )
