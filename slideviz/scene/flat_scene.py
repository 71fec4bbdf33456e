"""A section laid flat in a plotter: unrolled, or a plane seen along its normal."""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.color_scheme import LIGHT, SELECTED_COLOR, ColorScheme
from slideviz.mesh.model import FloatArray
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import INVERTED
from slideviz.plots.section_paint import shown_paint
from slideviz.scene import pick
from slideviz.scene.actors import draw_in_front
from slideviz.scene.camera import Camera
from slideviz.scene.sections import Instances, PolygonActor
from slideviz.scene.stage import Stage
from slideviz.sections.cut import transformed
from slideviz.sections.model import Section
from slideviz.sections.plane import Box, union
from slideviz.sections.polygons import CellsInRange, Polygons
from slideviz.sections.shape import Label
from slideviz.session.colors import with_drawable_colors
from slideviz.session.passages import keeps, matrices, period_of
from slideviz.session.section_cuts import NO_POLYGONS, Cuts, cut_frame, is_awaited
from slideviz.session.state import Session

FILL = 0.94  # part of the view's height or width that a fitted section takes
READING = "its cells are being read from the file of the mesh"  # summary while cells are being read


class FlatScene:
    """One section of a session laid flat in a plotter, with those of neighbouring passages.

    Both axes have the same scale. ``plotter``: where to draw. ``cuts``: the cuts of the 3D scene,
    shared with it.
    """

    def __init__(self, plotter: Any, cuts: Cuts, scheme: ColorScheme = LIGHT) -> None:
        self.stage = Stage(plotter, scheme)
        self.stage.has_legend = False
        self.camera = Camera(self.stage, list)
        self.cuts = cuts
        self.beside: FlatScene | None = None
        """Another scene whose camera is linked: `fit` shows both sections whole."""
        self.section: Section | None = None  # the section that is shown
        self.polygons: Polygons | None = None  # the polygons that are drawn, laid flat
        self._all: Polygons | None = None
        self._shown = PolygonActor(self.stage, "flat")
        self._instances = Instances(self.stage, self._shown)
        self._mark = PolygonActor(self.stage, "marked", pickable=False)
        self._undeformed = PolygonActor(self.stage, "undeformed", pickable=False)
        self._outlines = Instances(self.stage, self._undeformed)
        self._undeformed_of: object = ()
        prop = self._mark.actor.prop
        prop.style = "wireframe"
        prop.color = SELECTED_COLOR
        prop.line_width = 4.0
        self._undeformed.actor.prop.line_width = 2.0
        self._shown.actor.prop.line_width = 1.0
        for one in (self._mark, self._undeformed):
            draw_in_front(one.mapper)
        self._made_of: object = ()
        self._level: tuple[object, float | None] = (), None
        self.session = Session()  # the state that is shown
        self.set_scheme(scheme)

    @property
    def labels(self) -> tuple[Label, Label]:
        """Return the names of both axes."""
        assert self.section is not None
        return self.section.flat_labels()

    def update(self, session: Session, section: Section) -> None:
        """Draw another state of the session, or another section."""
        session = with_drawable_colors(session)
        self.session = session
        self.section = section
        self.stage.set_colors(session)
        by_value = session.view.color_by != "role"
        cut = self.cuts.of(session.shown_frame.mesh, section)
        only = self.stage.in_threshold(session)
        frame = cut_frame(session.shown_frame, section)
        key = (cut, only, section, frame if by_value else None)
        if key != self._made_of:
            self._made_of = key
            self._place(cut, only, section, session)
        cells = self._shown.polygons.cells
        self._shown.color(self.stage.values_of(session, cells, frame) if by_value else None)
        self._shown.style(self.stage, session, section.whole_cells)
        self._draw_undeformed(section)
        self._draw_neighbours(section)
        marked = None if session.lacks_cells else session.view.marked_cell
        polygons = self._shown.polygons
        self._mark.show(polygons.take(np.flatnonzero(polygons.cells == marked)))

    def _place(
        self, cut: Polygons, only: CellsInRange | None, section: Section, session: Session
    ) -> None:
        """Lay the polygons flat and draw those within the threshold."""
        ahead = self._ahead(section, session)
        flat = section.flatten(cut, ahead, ahead) if len(cut) else cut
        # Where the section lies stays, whatever cells of it are shown.
        self._all = flat
        if only is not None and section.whole_cells and len(cut):
            part = self.cuts.of(session.shown_frame.mesh, section, only=only)
            near = section.middle_angle(cut, ahead)
            flat = section.flatten(part, near, ahead) if len(part) else part
        elif only is not None:
            flat = only.among(flat)
        if not section.whole_cells and len(flat):
            # All is in one plane, where folded cells overlap others: they are drawn last.
            status = cut_frame(session.shown_frame, section).quality.status
            flat = flat.with_last(status[flat.cells] == INVERTED)
            flat = flat.with_points(flat.points * (1.0, 1.0, 0.0))
        self.polygons = flat
        self._shown.show(flat)

    def _ahead(self, section: Section, session: Session) -> float | None:
        """Return the angle in radians at the middle of the unrolled section; None for a plane.

        It is that of the undeformed mesh, so that all views agree. It is cached.
        """
        key = (session.mesh, section.kind, section.origin, section.direction)
        if key != self._level[0]:
            points = session.opened_mesh.points[self.cuts.cutter(session.opened_mesh).used]
            self._level = key, section.ahead(points)
        return self._level[1]

    def _draw_neighbours(self, section: Section) -> None:
        by_passage: dict[int, FloatArray] = {}
        if self.session.view.passages:
            pair = period_of(self.session)
            for number, matrix in matrices(self.session, pair).items():
                if pair is not None and keeps(section, matrix):
                    by_passage[number] = flat_matrix(section, pair, number, matrix)
        self._instances.show(by_passage)
        self._outlines.show(by_passage if self._undeformed_of else {})

    def _draw_undeformed(self, section: Section) -> None:
        """Draw the outline of the section of the undeformed mesh, if it is shown."""
        session = self.session
        mesh = self.session.mesh
        shown = "undeformed" in session.view.drawn and session.view.frame > 0
        key = (mesh, section) if shown and not session.lacks_cells else ()
        if key != self._undeformed_of:
            self._undeformed_of = key
            lines = NO_POLYGONS
            if key and mesh is not None:
                ahead = self._ahead(section, session)
                # Not `Cuts.of`, which caches those of the shown step.
                cut = self.cuts.cutter(mesh).cut(mesh.points, section)
                lines = section.flatten(cut, ahead, ahead).outline()
            self._undeformed.show(lines)
        self._undeformed.actor.prop.color = self.stage.scheme.text

    # Facts --------------------------------------------------------------------------------
    @property
    def summary(self) -> str:
        """Return a sentence with the number of cells cut, their min, mean and inverted ones.

        With a threshold, it is about the cells within it; the outline of the undeformed section is
        explained.
        """
        if self.polygons is None or self._all is None or not len(self._all):
            awaited = (
                self.session.frame is not None
                and self.section is not None
                and is_awaited(self.session.frame.mesh, self.section)
            )
            return READING if awaited else "it cuts no cell"
        only = self.stage.in_threshold(self.session)
        cells = self.polygons.cell_ids
        every = len(self._all.cell_ids)
        if only is not None and not len(cells):
            return f"none of {every:,} cells cut is shown: {only.words}"
        assert self.section is not None
        paint = shown_paint(self.session, cut_frame(self.session.shown_frame, self.section))
        more = "; line: undeformed" if self._undeformed_of else ""
        return paint.sentence(cells, *(() if only is None else (every, only.words))) + more

    def pick_cell(self, x: float, y: float) -> int | None:
        """Return the cell at a pixel counted from the lower left, or None."""
        if self.polygons is None or not len(self.polygons) or self.session.lacks_cells:
            return None
        shown = [self._shown.actor, *self._instances.drawn.values()]
        cells = self.polygons.cells
        found = pick.front_cell(self.stage.plotter, x, y, [(one, cells) for one in shown])
        return None if found is None else found[0]

    # Camera ----------------------------------------------------------------------------
    def set_scheme(self, scheme: ColorScheme) -> None:
        """Take the colors of another color scheme for background and edges."""
        self.stage.scheme = scheme
        self.stage.set_background()
        if self.section is not None and self.session.frame is not None:
            self.update(self.session, self.section)

    def bounds(self) -> Box | None:
        """Return the lower and upper corner (2,) of the section and its instances; None if empty.

        Cells outside the threshold count too.
        """
        if self._all is None or not len(self._all):
            return None
        points = self._all.points
        parts = [
            transformed(points, np.array(instance.user_matrix))
            for instance in self._instances.drawn.values()
        ]
        parts.append(points)
        return union([(part.min(axis=0)[:2], part.max(axis=0)[:2]) for part in parts])

    def fit(self) -> None:
        """Make the section (and that of ``beside``) fill the view."""
        scenes = [self] if self.beside is None else [self, self.beside]
        boxes = [box for box in (scene.bounds() for scene in scenes) if box is not None]
        if not boxes:
            return
        low, high = union(boxes)
        width, height = self.stage.plotter.window_size
        extent = np.maximum(high - low, 1e-300)
        half = max(extent[1], extent[0] * height / max(width, 1)) / 2.0 / FILL
        x, y = (low + high) / 2.0
        away = 10.0 * float(extent.max())
        self.stage.plotter.camera.parallel_projection = True
        self.camera.move_to((x, y, away, x, y, 0.0, 0.0, 1.0, 0.0, half))

    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ranges of both axes that the view shows: left to right, bottom to top."""
        camera = self.stage.plotter.camera
        width, height = self.stage.plotter.window_size
        x, y, _ = camera.focal_point
        up = camera.parallel_scale
        side = up * width / max(height, 1)
        return (x - side, x + side), (y - up, y + up)


def flat_matrix(section: Section, pair: Pair, number: int, matrix: FloatArray) -> FloatArray:
    """Return the matrix (4, 4) that moves a flat section to that of a neighbouring passage.

    ``matrix`` (4, 4), the transformation to the passage in space, maps the section onto itself;
    ``number`` is that of the passage: the power of the period.
    """
    turn = np.sign(section.basis[2] @ np.asarray(pair.axis)) if pair.kind == "rotational" else 0.0
    angle = turn * np.copysign(pair.period, pair.angle) * number
    return section.flat_matrix(matrix, angle)
