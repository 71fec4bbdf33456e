"""Sections in the scene: the cells that planes and cylinders cut, in the colours of the view."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.view.copies import keeps
from slideviz.view.cuts import Cuts, can_cut
from slideviz.view.layer_copies import Period, matrices
from slideviz.view.layer_mesh import recoloured
from slideviz.view.polygon_actor import PolygonActor, plain_colour
from slideviz.view.polygons import Polygons
from slideviz.view.section import Section
from slideviz.view.stage import Stage
from slideviz.view.state import Session
from slideviz.view.surfaces import Surface
from slideviz.view.twins import Twins

NAME = "section:"


@dataclass(eq=False)
class SectionDrawn:
    """A section in the scene: what shows its polygons, and of what they were made."""

    shown: PolygonActor
    made_of: tuple[object, ...] = ()

    @property
    def polygons(self) -> Polygons:
        """Return the polygons."""
        return self.shown.polygons

    @property
    def actor(self) -> Any:
        """Return their actor."""
        return self.shown.actor


class SectionLayer:
    """What the sections of the view show of the mesh, and of its neighbouring passages.

    Attributes
    ----------
    cuts : Cuts
        What was cut, for others that show the same.
    drawn : dict of str to SectionDrawn
        By the name of the actor: ``section:0`` is the first section of the mesh itself.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.cuts = Cuts()
        self.clear()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh; its sections come with its state."""

    def clear(self) -> None:
        """Forget the mesh."""
        self.drawn: dict[str, SectionDrawn] = {}
        self._period = Period()
        self._twins: dict[str, Twins] = {}

    def shapes(self) -> list[Any]:
        """Return nothing: the boundaries are around it anyway."""
        return []

    def pickable(self) -> list[tuple[Any, IntArray]]:
        """Return the actors of the mesh itself, each with the cells of its polygons."""
        return [
            (one.actor, one.polygons.cells)
            for name, one in self.drawn.items()
            if name.count(":") == 1 and len(one.polygons)
        ]

    def update(self, old: Session | None, new: Session) -> None:
        """Show another state; only what differs is cut or coloured again."""
        if new.frame is None or not (new.view.sections or self.drawn):
            return
        wanted = self._wanted(new)
        for name in [name for name in self.drawn if name not in wanted]:
            if name in self._twins:
                self._twins.pop(name).show({})
            self.stage.remove(name)
            del self.drawn[name]
        again = recoloured(old, new)
        for name, (section, number, matrix) in wanted.items():
            self._draw(name, (section, number, matrix), new, again)
        neighbours = self._neighbours(new)
        for name, (section, number, _) in wanted.items():
            if number == 0 and (neighbours or name in self._twins):
                base = self.drawn[name].shown
                twins = self._twins.setdefault(name, Twins(self.stage, base))
                # The period takes these onto themselves: nothing has to be cut again.
                twins.show({at: m for at, m in neighbours.items() if keeps(section, m)})

    def _neighbours(self, session: Session) -> dict[int, FloatArray]:
        return matrices(session, self._period.of(session) if session.view.copies else None)

    def _wanted(self, session: Session) -> dict[str, tuple[Section, int, FloatArray | None]]:
        """Return what is cut: section and passage, with the matrix of a neighbour, by name."""
        found: dict[str, tuple[Section, int, FloatArray | None]] = {}
        neighbours = self._neighbours(session)
        for index, section in shown_sections(session):
            found[f"{NAME}{index}"] = replace(section, name=""), 0, None
            for number, matrix in neighbours.items():
                if not keeps(section, matrix):
                    found[f"{NAME}{index}:{number}"] = replace(section, name=""), number, matrix
        return found

    def _draw(
        self,
        name: str,
        wanted: tuple[Section, int, FloatArray | None],
        session: Session,
        again: bool,
    ) -> None:
        section, number, matrix = wanted
        frame, by_value = session.frame, session.view.colour_by != "role"
        assert frame is not None
        # The view's way to find the period may change with the case, and so the matrix.
        key = (frame.mesh, section, number, None if matrix is None else matrix.tobytes())
        one = self.drawn.get(name)
        if one is None:
            one = self.drawn[name] = SectionDrawn(PolygonActor(self.stage, name))
        if one.made_of != key:
            polygons = self.cuts.of(frame.mesh, section, matrix)
            one.shown.show(polygons, 0.7 * self.stage.lift(frame.mesh))
            one.made_of, again = key, True
        if not by_value:
            one.shown.colour(None)
        elif again:
            one.shown.colour(self.stage.values(session))
        self._style(one.shown, section, session)

    def _style(self, shown: PolygonActor, section: Section, session: Session) -> None:
        prop, look = shown.actor.prop, self.stage.look
        assert session.mesh is not None
        if session.mesh.dim == 3:
            prop.color = plain_colour(look)
            # A cut has the very colours of the bar; whole cells need shades to be told apart.
            prop.lighting = section.whole
            prop.ambient, prop.diffuse = (0.6, 0.4) if section.whole else (1.0, 0.0)
            self.stage.edges(prop, session.view.edges)
        elif section.whole:
            prop.color = look.cell
            prop.show_edges, prop.edge_color, prop.edge_opacity = True, look.text, 1.0
            prop.line_width = 2.5
        else:
            # A line in the colours of the cells it lies on would not be seen.
            shown.mapper.scalar_visibility = False
            prop.color, prop.line_width = look.text, 3.0


def shown_sections(session: Session) -> Iterator[tuple[int, Section]]:
    """Yield the sections that are drawn, with their places in the list."""
    for index, section in enumerate(session.view.sections):
        if section.shown and can_cut(session.mesh, section):
            yield index, section
