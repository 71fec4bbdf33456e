"""The base class of the panels."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress

from qtpy.QtCore import QObject, QTimer
from qtpy.QtGui import QPaintEvent
from qtpy.QtWidgets import QFormLayout, QLabel, QWidget

from slideviz.case.keys import KEYS
from slideviz.case.spans import span_ends
from slideviz.color_scheme import ColorScheme
from slideviz.errors import CaseError
from slideviz.gui.responsiveness.timers import REST_MS, single_shot
from slideviz.gui.widgets.build import Choice, in_row, set_policy
from slideviz.gui.widgets.fields import CheckedField, NumberBox
from slideviz.gui.widgets.plot_canvas import PlotCanvas, ask_and_write, is_seen
from slideviz.gui.widgets.services import Services
from slideviz.mesh.zones import names_from
from slideviz.session import changes
from slideviz.session.run_messages import Requirement
from slideviz.session.state import PanelPlace, Session
from slideviz.session.store import Store
from slideviz.system.csv_table import write_csv
from slideviz.terms import Texts


class FieldWatch(QObject):
    """Watches the checked fields of a panel and writes the invalid ones to ``Session.invalid``."""

    def __init__(self, panel: QWidget, store: Store, place: PanelPlace) -> None:
        super().__init__(panel)
        self.panel = panel
        self.store = store
        self.place = place
        self._fields: list[CheckedField | NumberBox] = [
            *panel.findChildren(CheckedField),
            *panel.findChildren(NumberBox),
        ]
        for field in self._fields:
            field.marked.connect(self.report)
        # Another motion or method may hide or disable a field.
        store.listen(lambda *_: self.report())

    def report(self) -> None:
        """Write the faults of the visible, enabled fields to the session."""
        faults = tuple(
            f"{_title(field, self.panel)}: {field.fault}."
            for field in self._fields
            if field.fault and field.isEnabledTo(self.panel) and field.isVisibleTo(self.panel)
        )
        self.store.change(changes.set_invalid, self.place, tuple(dict.fromkeys(faults)))

    def restore(self) -> None:
        """Replace invalid texts by the values, as another mesh is shown."""
        for field in self._fields:
            field.restore()

    def focus(self) -> bool:
        """Put the cursor into the first invalid field; return whether there is one."""
        field = next((field for field in self._fields if field.fault), None)
        if field is not None:
            field.setFocus()
            field.selectAll()
        return field is not None


def _title(field: QWidget, panel: QWidget) -> str:
    """Return the name of a field: the label of its form's row, with its own name in the row.

    The own name is left out if the row's numbers are only invalid together.
    """
    name = field.accessibleName() if getattr(field, "problem", "") else ""
    part: QWidget | None = field
    while part is not None and part is not panel:
        for form in panel.findChildren(QFormLayout):
            label = form.labelForField(part)
            if isinstance(label, QLabel):
                return f"{label.text()} {name}".rstrip()
        part = part.parentWidget()
    return field.accessibleName() or field.objectName()


class Panel(QWidget):
    """The base of the widgets in the docks, which show the session and change it.

    Only functions given to `follow` fill its widgets.
    """

    def __init__(self, services: Services) -> None:
        super().__init__()
        self.services = services
        self.store = services.store
        self.change = self.store.change
        self._unseen: list[QTimer] = []
        self.make()

    def make(self) -> None:
        """Make the widgets, then call `follow`."""
        raise NotImplementedError

    @property
    def session(self) -> Session:
        """Return the session that is shown."""
        return self.store.session

    def follow(
        self,
        select: Callable[[Session], object] = lambda session: session,
        sync: Callable[[Session], object] | None = None,
        *,
        seen: bool = False,
        rests: bool = False,
    ) -> None:
        """Call ``sync`` now, and after each change of what ``select`` returns of the session.

        ``select``: returns the values that are shown, to be compared; default: the session, which
        differs after each change. ``sync``: fills widgets from the session; default: `sync` of the
        panel. ``seen``: whether it waits until anything of the panel is on screen. ``rests``:
        whether it is called at most every `REST_MS`.
        """
        fill = sync or self.sync
        shown = select(self.session)
        last_s = float("-inf")

        def catch_up(session: Session) -> None:
            nonlocal shown, last_s
            now = select(session)
            if now == shown:
                return
            if seen and not is_seen(self):
                shown = None  # it would keep another mesh alive
                return
            wait_ms = 1000.0 * (last_s - time.monotonic()) + REST_MS
            if rests and wait_ms > 0:
                if not later.isActive():
                    later.start(math.ceil(wait_ms))
                return
            last_s = time.monotonic()
            shown = now
            fill(session)

        later = single_shot(self, lambda: catch_up(self.session))
        self.store.listen(lambda _old, new: catch_up(new))
        if seen:
            self._unseen.append(later)
        fill(self.session)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        # What has changed while the panel was behind another tab.
        for later in self._unseen:
            if not later.isActive():
                later.start(0)

    def sync(self, session: Session) -> None:
        """Fill the widgets from the session."""
        raise NotImplementedError

    def heightForWidth(self, width: int) -> int:
        # A scroll area takes this as the least height: lists in the panel shrink before it scrolls.
        layout = self.layout()
        return -1 if layout is None else layout.totalMinimumHeightForWidth(width)

    def export_csv(self, title: str, name: str, rows: Iterable[Sequence[object]]) -> None:
        """Ask for a CSV file, and write rows to it."""
        filters = "Comma-separated values (*.csv)"
        ask_and_write(self, title, name, filters, lambda path: write_csv(path, rows))

    def take_theme(self, scheme: ColorScheme) -> None:
        """Draw plots again in another theme's colors; subclasses: all else without a palette."""
        for canvas in self.findChildren(PlotCanvas):
            canvas.set_scheme(scheme)

    def focus_requirement(self, missing: Requirement) -> None:
        """Put the cursor into the field by which a missing requirement of a run is met."""


WALLS = {"Hub": "0, the hub or root", "Shroud": "1, the shroud or tip"}
"""Each with the span there, in words."""
ARROW = 36  # width in pixels of a drop-down list beside its text
OF_MACHINE = "Hub, shroud"
OF_WING = "Root, tip"


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
        for end in self.ends:
            set_policy(end, "Ignored", "Fixed")
        self.along.setMinimumContentsLength(4)  # the names beside it need the room
        self._row = in_row(*self.ends, self.along, wide=self.ends, spacing=4)
        self._row.setContentsMargins(0, 0, 0, 0)
        self.setLayout(self._row)
        self.title = QLabel(OF_MACHINE)
        self._by_name: tuple[str, str] | None = None
        self._blade: Texts = ()
        self.follow(lambda session: (session.mesh, session.case.around_span))

    def show_for(self, blade: Texts) -> None:
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
        words = {text: text for text in (*"xyz", along)}
        self.along.offer(words | {"AUTO": "auto"})
        self.along.show_value(along)
        for k, end in enumerate(self.ends):
            end.offer({name: name for name in names.values()})
            end.setCurrentIndex(-1)
            end.show_value((span or self._by_name or ("", ""))[k])
            # A longer name has more of the room.
            text = end.currentText() or end.placeholderText()
            self._row.setStretch(k, end.fontMetrics().horizontalAdvance(text) + ARROW)
        tip = self.ends[1].currentData()
        is_wing = case.span_axis is not None or case.roles.get(tip) == "moving"
        self.title.setText(OF_WING if is_wing else OF_MACHINE)

    def _chosen(self, _: object) -> None:
        hub = self.ends[0].currentData()
        shroud = self.ends[1].currentData()
        if hub and shroud:
            span = None if (hub, shroud) == self._by_name else (hub, shroud)
            self.change(changes.set_case, span=span)
