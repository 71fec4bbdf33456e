"""Previews of a run: ghosts of boundaries, circles of the support radius, free-form boxes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.case.model import Case
from slideviz.case.motions.box import box_definition, box_motions
from slideviz.color_scheme import INTERSECTION_COLOR, SELECTED_COLOR
from slideviz.ffd.box import Box, points_at
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.surfaces import Surface, facet_connectivity, lifted
from slideviz.scene import actors
from slideviz.scene.actors import Band, draw_in_front
from slideviz.scene.legend import set_letters
from slideviz.scene.stage import KeyedLayer, Layer
from slideviz.session.motions import (
    chosen_control,
    lattices,
    support_case,
    support_key,
    support_of,
)
from slideviz.session.state import Session
from slideviz.terms import ROLES

BASE = "boxes:undeformed"
MOVED = "boxes:moved"
BEHIND = "boxes:behind"
LABELS = "boxes:-labels"
CHOSEN = "boxes:chosen"
"""Names of actors: undeformed boxes, moved ones, parts behind the mesh, labels, and the control
points that the chosen motion moves."""

ENDS = (0, 0, 0), (-1, 0, 0), (0, -1, 0), (0, 0, -1)
"""Indices of a box's first control point, and of those at the ends of its edges in i, j and k."""

FAINT = 0.3
CLEAR = 0.75
"""Opacity of parts that the mesh hides: of undeformed boxes, and of their moved parts."""


class BoxLayer(KeyedLayer):
    """The lattices of control points of all boxes, undeformed and as moved by the motions.

    Parts that the mesh hides are drawn faintly, moved ones clearly. The name of a box is beside its
    first control point, and i, j and k are at the other ends of the edges from there.
    """

    names = (BASE, MOVED, BEHIND, f"{MOVED}:behind", LABELS, CHOSEN)

    def key(self, session: Session) -> object:
        if session.mesh is None or "ffd" not in session.view.drawn:
            return ()
        case = session.case
        style = (self.stage.scheme, self.stage.pixel_scale)
        chosen = chosen_control(session)
        return session.mesh, box_motions(case), box_definition(case), chosen, style

    def draw(self, session: Session) -> None:
        mesh = session.opened_mesh
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
            sizes = 2.0 * self.stage.pixel_scale, 8.0 * self.stage.pixel_scale
            self.stage.mark(shape, name, color, *sizes)
            if mesh.dim == 3:
                hidden = BEHIND if name == BASE else f"{MOVED}:behind"
                behind = self.stage.mark(shape, hidden, color, *sizes)
                behind.prop.opacity = FAINT if name == BASE else CLEAR
                draw_in_front(behind.mapper)
        if boxes:
            self._label(boxes, mesh.dim, lift)
        name, index = chosen_control(session) or ("", (0, 0, 0))
        if name in boxes and not boxes[name].problem(index):
            points = moved.get(name, boxes[name]).points[points_at(index)].reshape(-1, 3)
            size = 14.0 * self.stage.pixel_scale
            shape = pv.PolyData(lifted(points[:, : mesh.dim], lift))
            chosen = self.stage.mark(shape, CHOSEN, SELECTED_COLOR, size=size)
            chosen.prop.opacity = 0.99  # drawn after the moved ones, which are transparent
            draw_in_front(chosen.mapper)

    def _label(self, boxes: dict[str, Box], dim: int, lift: float) -> None:
        at = []
        words = []
        for name, box in boxes.items():
            at += [box.points[end] for end in ENDS[: dim + 1]]
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


def lattice_shape(boxes: list[tuple[FloatArray, np.ndarray]], dim: int, lift: float) -> Any:
    """Return control points and the lines between neighbouring ones as PolyData.

    ``boxes``: the control points of each box, and which of them are drawn; lines have one of these
    at least. ``dim``: in 2D only the layer k = 0 is drawn. ``lift``: height above z = 0 in 2D.
    """
    points = []
    lines = []
    wanted = []
    start = 0
    for box, drawn in boxes:
        flat, on = (box[:, :, :1], drawn[:, :, :1]) if dim == 2 else (box, drawn)
        ids = start + np.arange(on.size).reshape(on.shape)
        for axis in range(3):
            along = np.moveaxis(ids, axis, 0)
            seen = np.moveaxis(on, axis, 0)
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


RIM = "\nrim"
WIRE = "\nwire"
"""Suffixes of the names of actors that draw the rim of a ghost, and the edges of its faces; no
boundary's name has them."""
STILL = 1e-9  # displacement of a boundary, relative to its extent, that counts as a rounding error
DEEPER = 330.0
"""Depth offset of ghosts: their faces are drawn this much behind their place, rims before it.

In units of 1/65536 of the depth range. Without it, a boundary that slides within its surface would
show through its ghost in patches."""
ON_TOP = 70000.0
"""Depth offset, in the same units, that draws the lines of a motion's ghost before everything.

A ghost that enters the solid, behind opaque boundaries, would be invisible otherwise."""

MOST_WIRE = 50_000  # most faces of a ghost whose edges are drawn: more would be one area, and slow
ARRIVED = 0.01
"""Distance of a boundary from its ghost, relative to its displacement, that counts as none."""


class GhostLayer(Layer):
    """The ghosts: boundaries as they were undeformed, and as the motions will move them."""

    def clear(self) -> None:
        self.moved: dict[str, FloatArray] = {}
        """The points (u, d) of the nodes of each boundary that will move."""
        self._surfaces: dict[str, Surface] = {}
        # Shapes, too: a data set that only VTK holds may come back from a mapper without points.
        self._bands: dict[str, Band] = {}
        self._session = Session()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        self._session = session
        self._surfaces = {surface.name: surface for surface in surfaces}

    def set_moved(self, moved: Mapping[str, FloatArray]) -> None:
        """Set and draw the moved boundaries: for each name, points (u, d) of its nodes."""
        for name in set(self.moved) - set(moved):
            for part in ("", RIM, WIRE):
                key = f"motion:{name}{part}"
                self._bands.pop(key, None)
                self.stage.remove(key)
        self.moved = dict(moved)
        self._draw_moved(self._session)

    def update(self, _old: Session | None, new: Session) -> None:
        self._session = new
        self._draw_undeformed(new)
        self._draw_moved(new)

    def _draw_moved(self, session: Session) -> None:
        if session.mesh is None:
            return
        view = session.view
        shown = "motion_ghost" in view.drawn and is_planned(session)
        for name, points in self.moved.items():
            surface = self._surfaces.get(name)
            if surface is None:
                continue
            key = f"motion:{name}"
            # A ghost in the boundary's own place is not drawn.
            if not shown or name in view.hidden or not is_apart(points, surface, session):
                for part in ("", RIM, WIRE):
                    if f"{key}{part}" in self._bands:
                        self._bands[f"{key}{part}"].actor.visibility = False
                continue
            hits = bool(session.intersection or session.folding)
            color = INTERSECTION_COLOR if hits else ROLES["moving"].color
            for band in self._parts(key, surface, 0.55, ON_TOP):
                actors.place(band.shape, points, 3 * self.stage.lift(session.mesh))
                actor = band.actor
                actor.prop.color = self._rim_color(color) if actor.name.endswith(RIM) else color
                actor.prop.line_width = 4.5 if hits else 2.5
                actor.visibility = True
            if not surface.flat:
                self._draw_wire(key, color, not rim_moves(points, surface, session.mesh))

    def _draw_wire(self, key: str, color: str, wanted: bool) -> None:
        shape = self._bands[key].shape
        wanted = wanted and shape.n_cells <= MOST_WIRE
        if wanted or f"{key}{WIRE}" in self._bands:
            wire = self._part(f"{key}{WIRE}", lambda *_: shape).actor
            wire.prop.style = "wireframe"
            wire.prop.color = color
            wire.prop.opacity = 0.5
            wire.prop.line_width = 1.0
            wire.visibility = wanted
            _shift_depth(wire, -ON_TOP)

    def _rim_color(self, color: str) -> tuple[float, float, float]:
        """Return a color that contrasts with the ghost: its color mixed with that of the text."""
        base = np.array(pv.Color(color).float_rgb)
        text = np.array(pv.Color(self.stage.scheme.text).float_rgb)
        red, green, blue = (0.5 * (base + text)).tolist()
        return red, green, blue

    def _draw_undeformed(self, session: Session) -> None:
        view = session.view
        # The undeformed mesh itself needs no ghost.
        shown = "undeformed" in view.drawn and session.mesh is not None and view.frame > 0
        for name, surface in self._surfaces.items():
            key = f"undeformed:{name}"
            if not shown and key not in self._bands:
                continue
            moves = session.role(name) != "fixed"
            for band in self._parts(key, surface, 0.45):
                band.actor.prop.color = self.stage.scheme.ghost
                band.actor.visibility = shown and moves and name not in view.hidden

    def _parts(
        self, key: str, surface: Surface, opacity: float, nearer: float = DEEPER
    ) -> list[Band]:
        """Return actor and data set of each part of a ghost: lines in 2D; faces and rim in 3D.

        ``nearer`` is how much the rim is drawn before its place (see `DEEPER`).
        """
        faces = self._part(key, lambda at, lift: actors.surface_shape(surface, at, lift))
        if surface.flat:
            faces.actor.prop.opacity = opacity + 0.25
            return [faces]
        faces.actor.prop.opacity = opacity - 0.1
        _shift_depth(faces.actor, DEEPER)
        if not len(surface.rim):
            return [faces]
        rim = self._part(f"{key}{RIM}", lambda at, lift: actors.rim_shape(surface, at, lift))
        rim.actor.prop.opacity = min(opacity + 0.35, 1.0)
        _shift_depth(rim.actor, -nearer)
        return [faces, rim]

    def _part(self, key: str, make: Callable[[FloatArray, float], Any]) -> Band:
        """Return the actor and the data set of a name, made by ``make`` at the first call."""
        if key not in self._bands:
            mesh = self._session.opened_mesh
            shape = make(mesh.points, 3 * self.stage.lift(mesh))
            lit = mesh.dim == 3 and not key.endswith((RIM, WIRE))
            actor = self.stage.add(shape, key, lighting=lit, pickable=False)
            actor.prop.line_width = 2.5
            self._bands[key] = Band(shape, actor)
        return self._bands[key]


def _shift_depth(actor: Any, units: float) -> None:
    """Set an actor's depth offset in units of 1/65536 of the depth range; positive is further."""
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, units)
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, units)


def is_apart(points: FloatArray, surface: Surface, session: Session) -> bool:
    """Return whether a ghost at points (u, d) is visibly apart from the boundary as shown.

    After a run the boundary is where its ghost is, except for the tolerance of the data reduction;
    both would flicker there.
    """
    mesh = session.opened_mesh
    at = mesh.points[surface.nodes]
    displacement = float(np.abs(points - at).max())
    still = STILL * float(np.ptp(at, axis=0).max())
    if session.view.frame == 0 or session.frame is None:
        return displacement > still
    left = float(np.abs(points - session.frame.mesh.points[surface.nodes]).max())
    return left > max(still, ARRIVED * displacement)


def rim_moves(points: FloatArray, surface: Surface, mesh: Mesh) -> bool:
    """Return whether the rim of a ghost at points (u, d) moves about as far as its faces.

    The rim of a wall that a free-form box dents stays in place; a closed surface has no rim.
    """
    length = np.abs(points - mesh.points[surface.nodes]).max(axis=1)
    return bool(length[surface.rim].max(initial=0.0) > 0.5 * length.max())


def is_planned(session: Session) -> bool:
    """Return whether a view shows the ghosts of the motions.

    It does for the undeformed mesh; for a run if its settings have changed since; for a design if
    the motions in the panels have changed since. Two views that are compared agree, as a ghost
    would look like a difference of the runs: they show ghosts of motions that no run has had.
    """
    if session.view.beside is not None:
        now = _motion(session.case)
        return all(_motion(run.case) != now for run in session.runs)
    run = session.run_shown
    if session.preview is not None:
        return False  # the boundaries are where the motions take them
    if run is not None and run.panels is not None:
        return _motion(run.panels) != _motion(session.case)
    return session.view.frame == 0 or session.outdated


def _motion(case: Case) -> tuple[object, ...]:
    """Return the moving boundaries and the motions of a case, to be compared."""
    return frozenset(case.markers_with("moving")), tuple(case.motions)


NAME = "support:circles"
HALO = "support:halo"
PIECES = 180  # straight pieces of a circle


class SupportLayer(KeyedLayer):
    """A circle around the middle of each moving body, or in 3D a sphere as three circles."""

    names = (HALO, NAME)

    def key(self, session: Session) -> object:
        if session.mesh is None or "support" not in session.view.drawn:
            return ()
        style = self.stage.pixel_scale, self.stage.scheme
        return (*support_key(support_case(session), session.mesh), *style)

    def draw(self, session: Session) -> None:
        radius, boxes = support_of(support_case(session), session.opened_mesh)
        if not radius:
            return
        points = circles(np.mean(boxes, axis=1), radius)
        lines = np.arange(len(points)).reshape(-1, PIECES + 1)
        shape = pv.PolyData(
            lifted(points, 4.0 * self.stage.lift(session.opened_mesh)),
            lines=np.insert(lines, 0, PIECES + 1, axis=1).ravel(),
        )
        # The seam in the background's color keeps the circle apart from the cells.
        for name, color, width in (
            (HALO, self.stage.scheme.background, 7.0),
            (NAME, ROLES["moving"].color, 3.5),
        ):
            self.stage.mark(shape, name, color, width * self.stage.pixel_scale)


def circles(middles: FloatArray, radius: float) -> FloatArray:
    """Return the points (m, d) of circles about ``middles`` (b, d), each closed and together.

    In 3D there are three about each, in the planes of the axes.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, PIECES + 1)
    dim = middles.shape[1]
    rings = []
    for one in range(dim):
        for other in range(one + 1, dim):
            round_ = np.zeros((PIECES + 1, dim))
            round_[:, one] = radius * np.cos(angle)
            round_[:, other] = radius * np.sin(angle)
            rings.append(round_)
    return (middles[:, None, None] + np.array(rings)).reshape(-1, dim)
