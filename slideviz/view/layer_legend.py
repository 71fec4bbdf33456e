"""The legend of the scene: the roles in use, or the colour bar; and the axes in a corner."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pyvista as pv

from slideviz.case.model import ROLES
from slideviz.view.legend import (
    add_colour_bar,
    add_point_legend,
    add_role_legend,
    clear_legend,
)
from slideviz.view.stage import Stage
from slideviz.view.state import COLOUR_BY, Session
from slideviz.view.surfaces import Surface


class LegendLayer:
    """What the colours mean, in a strip at the right."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        # Of its own: that of an actor may be gone before the bar is.
        self._mapper = pv.DataSetMapper()
        self._mapper.lookup_table = stage.table
        self._drawn: tuple[object, ...] = ()

    def open(self, session: Session, surfaces: Sequence[Surface]) -> None:
        """Draw another mesh."""

    def clear(self) -> None:
        """Forget the mesh."""
        clear_legend(self.stage.plotter)
        self._drawn = ()

    def shapes(self) -> list[Any]:
        """Return nothing: the legend has a place of its own."""
        return []

    def update(self, _old: Session | None, new: Session) -> None:
        """Show another state; made anew only where it differs, which takes longer than the rest."""
        stage, mesh, what = self.stage, new.mesh, new.view.colour_by
        key = self._key(new)
        if key == self._drawn:
            return
        self._drawn = key
        clear_legend(stage.plotter)
        style = (stage.look, stage.font_scale)
        if not (new.view.legend and stage.has_legend) or mesh is None:
            return
        if what == "role":
            used = {new.role(name) for name in mesh.marker_names}
            roles = [role for role in ROLES if role in used]
            add_role_legend(stage.plotter, roles, stage.look, stage.font_scale)
            add_point_legend(stage.plotter, stage.point_words, 24.0 * len(roles) + 16, style)
        else:
            title, bad = COLOUR_BY[what], has_inverted(new)
            add_colour_bar(stage.plotter, self._mapper, title, bad, style)
            end = add_point_legend(stage.plotter, stage.point_words, 4.0, style)
            self._lower_bar(title, end)

    def _lower_bar(self, title: str, below: float) -> None:
        """Make the colour bar with its title end where the lines about points above it do."""
        plotter = self.stage.plotter
        below += 34 if self.stage.point_words else 0
        bar = plotter.scalar_bars[title]
        free = 1.0 - below * self.stage.font_scale / max(plotter.window_size[1], 1)
        bottom = bar.GetPosition()[1]
        bar.SetHeight(max(min(bar.GetHeight(), free - bottom), 0.2))

    def _key(self, session: Session) -> tuple[object, ...]:
        """Return all that the legend depends on."""
        mesh, view = session.mesh, session.view
        names = mesh.marker_names if mesh is not None and view.colour_by == "role" else ()
        said = frozenset(session.role(name) for name in names) or has_inverted(session)
        place = tuple(self.stage.plotter.window_size)
        colours = (view.colour_by, view.colour_map, session.colour_range)
        points, style = self.stage.point_words, (self.stage.look, self.stage.font_scale)
        shown = view.legend and self.stage.has_legend
        return (id(mesh), shown, colours, said, points, style, place)


def has_inverted(session: Session) -> bool:
    """Tell whether the frame that is shown has inverted cells."""
    return session.frame is not None and session.frame.quality.inverted > 0
