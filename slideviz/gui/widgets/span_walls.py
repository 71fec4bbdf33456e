"""Hub and shroud of a machine, or root and tip of a wing, and the direction of its span."""

from __future__ import annotations

from contextlib import suppress

from qtpy.QtWidgets import QVBoxLayout

from slideviz.case.keys import KEYS
from slideviz.case.spans import span_ends
from slideviz.errors import CaseError
from slideviz.gui.widgets.build import Choice, in_row
from slideviz.gui.widgets.panel import Panel
from slideviz.mesh.zones import names_from
from slideviz.session import changes
from slideviz.session.state import Session

WALLS = {"Hub": "0, the hub or root", "Shroud": "1, the shroud or tip"}
"""Each with the span there, in words."""


class SpanWalls(Panel):
    """Drop-down lists for hub and shroud (SPAN), set once both are chosen, and for SPAN_AXIS."""

    def make(self) -> None:
        self.ends = tuple(
            Choice(
                {},
                f"The boundary where the span is {words}; at first the boundary with such a name.",
            )
            for words in WALLS.values()
        )
        for end, name in zip(self.ends, WALLS, strict=True):
            end.setAccessibleName(name)
            end.setPlaceholderText(f"{name}…")
            end.chosen.connect(self._chosen)
        self.along = Choice({}, KEYS["SPAN_AXIS"].meaning)
        self.along.setAccessibleName(KEYS["SPAN_AXIS"].label)
        self.along.chosen.connect(
            lambda text: self.change(changes.set_case, span_axis=KEYS["SPAN_AXIS"].kind.read(text))
        )
        row = in_row(*self.ends, wide=self.ends, spacing=4)
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.addLayout(row)
        rows.addWidget(self.along)
        self._by_name: tuple[str, str] | None = None
        self._blade: tuple[str, ...] = ()
        self.follow(lambda session: (session.mesh, session.case.around_span))

    def show_for(self, blade: tuple[str, ...]) -> None:
        """Offer the walls of the zone that has these boundaries; where none has them, of all."""
        if blade != self._blade:
            self._blade = blade
            self.sync(self.session)

    def sync(self, session: Session) -> None:
        mesh = session.mesh
        case = session.case
        self._by_name = None
        span = case.span
        names = dict[str, str]()  # of boundaries in the mesh, by those in the file
        if mesh is not None:
            zone = mesh
            names = {name: name for name in mesh.marker_names}
            for part in mesh.parts if self._blade else ():
                if {*self._blade} <= {*mesh.marker_names[part.markers]}:
                    zone = part.mesh
                    names = names_from(mesh, part)
            with suppress(CaseError):  # names that do not say which
                hub, shroud = span_ends(case.change(span=None), zone)
                self._by_name = names[hub], names[shroud]
        if span is not None:
            span = names.get(span[0], span[0]), names.get(span[1], span[1])
            span = span if {*span} <= {*names.values()} else None  # of another zone
        along = KEYS["SPAN_AXIS"].kind.write(case.span_axis)
        words = {text: f"span along {text}" for text in (*"xyz", along)}
        self.along.offer(words | {"AUTO": "direction automatic"})
        self.along.show_value(along)
        for k, end in enumerate(self.ends):
            end.offer({name: name for name in names.values()})
            end.setCurrentIndex(-1)
            end.show_value((span or self._by_name or ("", ""))[k])

    def _chosen(self, _: object) -> None:
        hub = self.ends[0].currentData()
        shroud = self.ends[1].currentData()
        if hub and shroud:
            span = None if (hub, shroud) == self._by_name else (hub, shroud)
            self.change(changes.set_case, span=span)
