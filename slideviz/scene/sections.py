"""Sections in the scene: the polygons of their cuts, in the colors of the view."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyvista as pv

from slideviz.color_scheme import ColorScheme
from slideviz.mesh.model import FloatArray, IntArray, Mesh, offsets_of
from slideviz.mesh.quality import INVERTED
from slideviz.scene.actors import VALUES, polygon_shape
from slideviz.scene.mesh import recolored
from slideviz.scene.stage import Layer, Stage
from slideviz.sections.cut import transformed
from slideviz.sections.model import Section
from slideviz.sections.plane import Box, box_around, union
from slideviz.sections.polygons import Polygons
from slideviz.session.passages import keeps, matrices, period_of
from slideviz.session.section_cuts import NO_POLYGONS, Cuts, can_cut, cut_frame, is_awaited
from slideviz.session.state import Session, StepFrame

NAME = "section:"
BAND = "band:"
RIM = "rim:"
"""Prefixes of actors' names: the section's cells; in 2D also the line below them and its rim."""
WIDTHS = {BAND: 8.0, RIM: 10.0}
"""Widths in pixels, for a 2D mesh, of the line in the colors of the cut cells, and of its rim.

They make a section visible whose cells are smaller than pixels."""
LIFTS = {NAME: 0.7, BAND: 0.6, RIM: 0.5}
"""Heights of the parts above the cells of a 2D mesh, relative to `Stage.lift`."""


@dataclass(eq=False)
class SectionDrawn:
    """A section in the scene: the actor of its polygons, and what they were made of."""

    shown: PolygonActor
    made_of: object = ()  # everything that the polygons depend on, to be compared
    frame: StepFrame | None = None
    of: Mesh | None = None
    """`frame`, `of`: the frame with the cut cells (of a mesh in its file: those read); the shown
    frame's mesh."""

    @property
    def polygons(self) -> Polygons:
        """Return the polygons of the section."""
        return self.shown.polygons

    @property
    def actor(self) -> Any:
        """Return the actor of the polygons."""
        return self.shown.actor


class SectionLayer(Layer):
    """The cuts of the view's sections through the mesh and its neighbouring passages."""

    def __init__(self, stage: Stage) -> None:
        self.cuts = Cuts()  # the cached cuts, shared with flat views
        self._lines = CutLines(stage)
        super().__init__(stage)

    def clear(self) -> None:
        self.drawn: dict[str, SectionDrawn] = {}
        """The sections by name of their actor: ``section:0`` is the first section through the mesh
        itself, ``section:0:1`` that through its next passage."""
        self._instances: dict[str, Instances] = {}
        self._lines.clear()
        self._lines_of: object = ()
        self._box: tuple[object, Box] | None = None

    def pickable(self) -> list[tuple[Any, IntArray]]:
        """Return the actors of sections through the mesh itself, with the cell of each polygon."""
        return [
            (one.actor, one.polygons.cells)
            for name, one in self.drawn.items()
            if name.startswith(NAME) and name.count(":") == 1 and len(one.polygons)
        ]

    @property
    def from_file(self) -> bool:
        """Return whether the sections' cells were read from the mesh's file for them."""
        return any(
            one.frame is not None and one.frame.base is not None for one in self.drawn.values()
        )

    def actors(self) -> list[Any]:
        """Return the actors of all sections, including those of neighbouring passages."""
        instances = (
            instance for one in self._instances.values() for instance in one.drawn.values()
        )
        return [*(one.actor for one in self.drawn.values() if len(one.polygons)), *instances]

    def update(self, old: Session | None, new: Session) -> None:
        if new.frame is None or not (new.view.sections or self.drawn):
            return
        wanted = self._wanted(new)
        for name in [name for name in self.drawn if name not in wanted]:
            if name in self._instances:
                self._instances.pop(name).show({})
            self.stage.remove(name)
            del self.drawn[name]
        again = recolored(old, new)
        for name, (section, number, matrix) in wanted.items():
            self._draw(name, (section, number, matrix), new, again)
        neighbours = self._neighbours(new)
        for name, (section, number, _) in wanted.items():
            if number == 0 and (neighbours or name in self._instances):
                base = self.drawn[name].shown
                instances = self._instances.setdefault(name, Instances(self.stage, base))
                # The period maps the section onto itself: instances of the cut are enough.
                instances.show({at: m for at, m in neighbours.items() if keeps(section, m)})
        if new.frame.mesh.dim == 2:
            self._draw_lines(new, neighbours)

    def _draw_lines(self, session: Session, neighbours: dict[int, FloatArray]) -> None:
        mesh = session.shown_frame.mesh
        sections = dict(shown_sections(session))
        key = (mesh, sections, tuple(neighbours), self.stage.scheme)
        if key == self._lines_of:
            return
        self._lines_of = key
        if self._box is None or self._box[0] != (mesh, tuple(neighbours)):
            # Cached, as a line is dragged.
            self._box = (mesh, tuple(neighbours)), self._find_box(mesh, neighbours)
        self._lines.show(sections, self._box[1], self.stage.lift(mesh))

    def _find_box(self, mesh: Mesh, neighbours: dict[int, FloatArray]) -> Box:
        """Return the corners of the box around a 2D mesh and its neighbouring passages."""
        nodes = mesh.points[self.cuts.cutter(mesh).used]
        every = [nodes, *(transformed(nodes, matrix) for matrix in neighbours.values())]
        return union([box_around(points) for points in every])

    def _neighbours(self, session: Session) -> dict[int, FloatArray]:
        return matrices(session, period_of(session) if session.view.passages else None)

    def _wanted(self, session: Session) -> dict[str, tuple[Section, int, FloatArray | None]]:
        """Return section, number of the passage and its matrix for each cut, by actor name.

        The mesh itself has number 0 and no matrix.
        """
        by_name: dict[str, tuple[Section, int, FloatArray | None]] = {}
        neighbours = self._neighbours(session)
        for index, section in shown_sections(session):
            for kind, wanted in _kinds(section, session).items():
                by_name[f"{kind}{index}"] = wanted, 0, None
                for number, matrix in neighbours.items():
                    if not keeps(section, matrix) and not session.lacks_cells:
                        by_name[f"{kind}{index}:{number}"] = wanted, number, matrix
        return by_name

    def _draw(
        self,
        name: str,
        wanted: tuple[Section, int, FloatArray | None],
        session: Session,
        again: bool,
    ) -> None:
        section, number, matrix = wanted
        kind = name[: name.index(":") + 1]
        frame = session.shown_frame
        by_value = session.view.color_by != "role" and kind != RIM
        # The matrix is part of the key, as another case may have another period.
        only = self.stage.in_threshold(session)
        cut = cut_frame(frame, section)
        key = (cut, section, number, None if matrix is None else matrix.tobytes(), only)
        one = self.drawn.get(name)
        if one is not None and one.of is frame.mesh and is_awaited(frame.mesh, section):
            return  # until its cells are read, the old polygons stay
        if one is None:
            one = self.drawn[name] = SectionDrawn(PolygonActor(self.stage, name))
        if one.made_of != key:
            polygons = self.cuts.of(frame.mesh, section, matrix, only)
            if frame.mesh.dim == 2 or not section.whole_cells:
                # Folded cells overlap in one plane: draw the inverted ones last.
                polygons = polygons.with_last(cut.quality.status[polygons.cells] == INVERTED)
            one.shown.show(polygons, LIFTS[kind] * self.stage.lift(frame.mesh))
            one.made_of = key
            one.frame = cut
            one.of = frame.mesh
            again = True
        if not by_value:
            one.shown.color(None)
        elif again:
            one.shown.color(self.stage.values_of(session, one.polygons.cells, cut))
        self._style(kind, one.shown, section, session)

    def _style(self, kind: str, shown: PolygonActor, section: Section, session: Session) -> None:
        prop = shown.actor.prop
        solid = session.mesh is not None and session.mesh.dim == 3 and section.whole_cells
        shown.style(self.stage, session, solid)
        if kind == RIM:
            prop.color = self.stage.scheme.text
        if session.mesh is not None and session.mesh.dim == 2:
            prop.line_width = 1.0 if section.whole_cells else WIDTHS.get(kind, WIDTHS[BAND])


def _kinds(section: Section, session: Session) -> dict[str, Section]:
    """Return the sections to draw for one, by the prefix of their actors' names.

    In 2D, whole cells are drawn above a line in their colors, and a line above its wider rim.
    """
    section = replace(section, name="")
    kinds = {NAME: section}
    if session.mesh is not None and session.mesh.dim == 2:
        line = replace(section, whole_cells=False)
        kinds |= {BAND: line, RIM: line} if section.whole_cells else {RIM: line}
    return kinds


def shown_sections(session: Session) -> Iterator[tuple[int, Section]]:
    """Yield the index and the section of each one that is shown and can cut the mesh."""
    for index, section in enumerate(session.view.sections):
        if section.shown and can_cut(session.mesh, section):
            yield index, section


LINE = "line:"  # prefix of the actors' names of thin lines
WIDTH = 1.2  # width of the thin line of a 2D section, in pixels
ABOVE = 0.9
BELOW = 0.4
"""Heights of the thin line above the mesh's cells, relative to `Stage.lift`: above whole cells, and
below a band in the cells' colors."""


class CutLines:
    """The thin lines of a 2D mesh's sections, which continue in holes and beside the mesh."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.clear()

    def clear(self) -> None:
        """Forget the mesh; the scene removes its actors."""
        self._names: list[str] = []

    def show(self, sections: Mapping[int, Section], box: Box, lift: float) -> None:
        """Draw the lines of sections, by their index, within a box; ``lift`` is `Stage.lift`."""
        for name in self._names:
            self.stage.remove(name)
        self._names = []
        for index, section in sections.items():
            parts = section.in_plane.trace(box)
            if parts:
                name = f"{LINE}{index}"
                shape = polylines(parts, lift * (ABOVE if section.whole_cells else BELOW))
                self.stage.mark(shape, name, self.stage.scheme.text, WIDTH)
                self._names.append(name)


def polylines(parts: list[FloatArray], lift: float = 0.0) -> Any:
    """Return polylines through points (k, 2) as one PolyData at z = ``lift``."""
    points = np.concatenate(parts)
    offsets = offsets_of([len(part) for part in parts])
    shape = pv.PolyData()
    shape.points = np.column_stack([points, np.full(len(points), lift)])
    shape.SetLines(pv.CellArray.from_arrays(offsets, np.arange(len(points))))  # type: ignore[arg-type]
    return shape


class PolygonActor:
    """An actor that draws polygons, or lines, in the colors of the cells they belong to.

    ``name``: the name of the actor. ``pickable``: whether the mouse can pick it.
    """

    def __init__(self, stage: Stage, name: str, pickable: bool = True) -> None:
        # The plotter refuses an empty data set, which a section may have.
        self.shape = pv.PolyData(np.zeros((3, 3)), faces=[3, 0, 1, 2])  # the data set that is drawn
        self.shape.cell_data[VALUES] = np.zeros(1)
        self.actor = stage.add(self.shape, name, lighting=False, pickable=pickable)
        self.mapper = self.actor.mapper
        """The actor's mapper, referenced here as VTK alone may lose its Python attributes."""
        self.polygons = NO_POLYGONS
        """The polygons that are drawn."""
        self.actor.visibility = False

    def show(self, polygons: Polygons, lift: float = 0.0) -> None:
        """Draw other polygons, raised by ``lift`` in z, all with the value 0."""
        self.polygons = polygons
        self.shape = polygon_shape(polygons, lift)
        self.mapper.dataset = self.shape
        self.actor.visibility = len(polygons) > 0

    def style(self, stage: Stage, session: Session, shaded: bool) -> None:
        """Set the look of the polygons without values; whole cells are ``shaded``."""
        prop = self.actor.prop
        prop.color = plain_color(stage.scheme)
        # A cut has exactly the colors of the bar; whole cells need shading.
        prop.lighting = shaded
        prop.ambient, prop.diffuse = (0.6, 0.4) if shaded else (1.0, 0.0)
        view = session.view
        stage.edges(prop, "edges" in view.drawn, view.color_by == "role")

    def color(self, values: FloatArray | None) -> None:
        """Color the polygons by values (q,), one per polygon; None: by the actor's own color."""
        if values is not None:
            self.shape.cell_data[VALUES] = values
        self.mapper.scalar_visibility = values is not None


def plain_color(scheme: ColorScheme) -> tuple[float, float, float]:
    """Return the color of polygons without values, visible on any background."""
    cell = np.array(pv.Color(scheme.cell).float_rgb)
    ghost = np.array(pv.Color(scheme.ghost).float_rgb)
    red, green, blue = (0.7 * cell + 0.3 * ghost).tolist()
    return red, green, blue


class Instances:
    """Instances of one actor at other places, which share its data set, mapper and property.

    ``base``: the actor that is repeated; its name and a number are the name of an instance.
    """

    def __init__(self, stage: Stage, base: PolygonActor) -> None:
        self.stage = stage
        self.base = base
        self.drawn: dict[int, Any] = {}  # the instances by number

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
