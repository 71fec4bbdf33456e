"""The sections panel: the list of sections, and the editor of one."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from qtpy.QtCore import QSignalBlocker, Qt, Signal
from qtpy.QtGui import QKeySequence, QShortcut
from qtpy.QtWidgets import (
    QFormLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QPushButton,
    QSlider,
    QWidget,
)

from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.errors import CaseError, SlidevizError
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    Choice,
    Part,
    as_widget,
    check_box,
    elide_items,
    grow_fields,
    hint_label,
    in_column,
    in_row,
    push_button,
    set_policy,
    tool_button,
    wrapped,
)
from slideviz.gui.widgets.fields import NumberField, VectorField
from slideviz.gui.widgets.panel import Panel, SpanWalls
from slideviz.gui.widgets.theme import set_icon
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.plots.section_picture import SectionStyle
from slideviz.sections.model import Section
from slideviz.session import changes, section_cuts
from slideviz.session.passages import period_of
from slideviz.session.run_messages import with_field_labels
from slideviz.session.saving import with_walls
from slideviz.session.section_cuts import can_cut, first_section
from slideviz.session.state import Session
from slideviz.terms import AXES

STEPS = 1000  # positions of the slider
FREE = "free"  # besides `AXES`, the direction that can be chosen


class SectionEditor(QWidget):
    """The editor of a section, which emits the section after each valid change.

    While the slider is dragged, at most one section is emitted per turn of the event loop, so that
    drawing never falls behind the mouse.
    """

    changed = Signal(object)  # Section
    """The section as edited."""
    dragging = Signal(bool)
    """The slider was pressed (True) or released (False)."""

    def __init__(self) -> None:
        super().__init__()
        self._section: Section | None = None
        self._points: FloatArray | None = None
        self._mesh: Mesh | None = None
        self._span = (0.0, 1.0)
        self._span_of: tuple[object, ...] = ()
        # Whether the fields of a free direction are shown; they stay while a direction is typed,
        # even along x, y or z.
        self._free = self._typing = False
        self._place: int | None = None
        self._make_fields()
        self._place_fields()
        self._soon = single_shot(self, self._slider_moved)

    def _make_fields(self) -> None:
        self.axis = Choice({**{word: word for word in AXES}, FREE: "free"})
        self.axis.chosen.connect(self._axis_chosen)
        self.direction = VectorField((0.0, 0.0, 1.0), tip="Any length but zero.")
        self.direction.changed.connect(self._direction_typed)
        self.centre = VectorField()
        self.centre.changed.connect(lambda at: self._emit_changed(origin=(*at, 0.0)[:3]))
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 20)
        self.slider.setMinimumWidth(80)
        self.slider.valueChanged.connect(lambda _: self._soon.start())
        self.slider.sliderPressed.connect(lambda: self.dragging.emit(True))
        self.slider.sliderReleased.connect(self._slider_released)
        self.number = NumberField(0.0, self._allowed)
        self.number.setFixedWidth(84)
        self.number.changed.connect(self._position_typed)
        tip = "Show the cells it cuts whole, instead of cut."
        self.whole = check_box("Whole cells", tip, lambda on: self._emit_changed(whole_cells=on))

    def _place_fields(self) -> None:
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        grow_fields(form)
        self.axis_name = QLabel("Normal")
        self.place_name = QLabel("Position")
        # One width for all words, so that the fields do not jump.
        self.axis_name.setMinimumWidth(self.fontMetrics().horizontalAdvance("Position"))
        axis = in_row(self.axis, self.whole, wide=[self.axis], spacing=6)
        place = in_row(self.slider, self.number, wide=[self.slider], spacing=6)
        form.addRow(self.axis_name, axis)
        form.addRow("", self.direction)
        self.centre_name = QLabel("Centre")
        form.addRow(self.centre_name, self.centre)
        form.addRow(self.place_name, place)
        self.form = form
        self.picks: dict[str, QWidget] = {}
        for kind, row in SECTION_SHAPES.items():
            if row.size is not None and row.size.picks:
                self.picks[kind] = as_widget(in_row(*map(self._pick, row.size.picks), spacing=5))
                form.addRow("", self.picks[kind])

    def _pick(self, value: float) -> QPushButton:
        words = f"{100.0 * value:g} %"
        return push_button(words, f"Go to {words}.", lambda: self._position_typed(value))

    # What is shown ---------------------------------------------------------------------
    def show_section(
        self, section: Section | None, mesh: Mesh | None, place: int | None = None
    ) -> None:
        """Show a section of a mesh; ``place`` is its row in the list. None hides the editor."""
        other = (place, _way(section)) != (self._place, _way(self._section))
        self._section = section
        self._place = place
        self.setVisible(section is not None and mesh is not None)
        if section is None or mesh is None:
            return
        if mesh is not self._mesh:
            self._mesh = mesh
            self._points = section_cuts.cell_points(mesh)
        terms = section.terms
        flat = mesh.dim == 2
        # A circle's axis is always z, and that of a span the machine's.
        fixed = (flat and bool(terms.point)) or section.walls is not None
        word = _axis_of(section)
        # A direction changed elsewhere (undo, handle) is shown as x, y or z again if it is.
        if other and not self._typing:
            self._free = False
        self._free = self._free or word == FREE
        self.axis.setVisible(not fixed)
        self.axis_name.setText("" if fixed else terms.direction.capitalize())
        self.centre_name.setText(terms.point)
        self.place_name.setText("Position" if terms.size is None else terms.size.label)
        self.axis.setToolTip(f"Direction of the {terms.direction}.")
        self.number.set_tip(terms.tip(mesh.dim))
        self.axis.show_value(FREE if self._free else word)
        self.direction.set_count(mesh.dim)
        self.centre.set_count(mesh.dim)
        self.centre.set_tip(f"{terms.point_tip(mesh.dim)}, in the mesh's length unit.")
        self.direction.show_value(section.direction)
        self.centre.show_value(section.origin)
        for widget, shown in (
            (self.direction, self._free and not fixed),
            (self.centre, bool(terms.point) and section.walls is None),
            *((widget, kind == section.kind) for kind, widget in self.picks.items()),
        ):
            self.form.setRowVisible(widget, shown)
        with QSignalBlocker(self.whole):
            self.whole.setChecked(section.whole_cells)
        self.axis.set_item_enabled("z", not flat)
        self._sync_place(section)

    def _sync_place(self, section: Section) -> None:
        """Show position or size; the slider's range is found again only if it may have changed."""
        centre = section.origin if section.terms.point else ()
        key = (self._mesh, section.kind, section.direction, centre)
        if key != self._span_of:
            assert self._points is not None
            self._span = section_cuts.position_range(section, self._points)
            self._span_of = key
        value = section.position
        low, high = self._span
        self.number.show_value(float(f"{value:.6g}"))
        if self.slider.isSliderDown() or self._soon.isActive():
            return  # the user is moving the slider
        share = (value - low) / (high - low) if high > low else 0.0
        with QSignalBlocker(self.slider):
            self.slider.setValue(round(float(np.clip(share, 0.0, 1.0)) * STEPS))

    # Widgets to state ------------------------------------------------------------------
    def _emit_changed(self, **values: object) -> None:
        if self._section is not None:
            self._emit(replace(self._section, **values))  # type: ignore[arg-type]

    def _emit(self, section: Section) -> None:
        if section != self._section:
            self.changed.emit(section)

    def _axis_chosen(self, word: str) -> None:
        self._free = word == FREE
        if self._section is None or self._points is None:
            return
        if word == FREE:
            self.show_section(self._section, self._mesh, self._place)
        else:
            self._emit(section_cuts.with_direction(self._section, AXES[word], self._points))

    def _direction_typed(self, values: tuple[float, ...]) -> None:
        x, y, z = (*values, 0.0, 0.0)[:3]
        direction = x, y, z
        if any(direction) and self._section is not None and self._points is not None:
            self._typing = True
            try:
                self._emit(section_cuts.with_direction(self._section, direction, self._points))
            finally:
                self._typing = False
        elif not any(direction):
            self.direction.fields[0].setToolTip("A direction is needed: not all may be 0.")

    def _position_typed(self, value: float) -> None:
        if self._section is not None:
            self._emit(self._section.at_position(value))

    def _allowed(self, value: float) -> str:
        if self._section is None:
            return ""
        try:
            self._section.at_position(value)
        except CaseError as problem:
            return str(problem)
        return ""

    def _slider_released(self) -> None:
        if self._soon.isActive():
            self._soon.stop()
            self._slider_moved()
        self.dragging.emit(False)

    def _slider_moved(self) -> None:
        if self._section is None:
            return
        low, high = self._span
        # A radius of 0 is not allowed, and a plane through the outermost nodes cuts nothing.
        share = np.clip(self.slider.value() / STEPS, 1e-4, 1.0 - 1e-4)
        value = low + float(share) * (high - low)
        self._emit(self._section.at_position(value))


def _way(section: Section | None) -> tuple[object, ...]:
    return () if section is None else (section.kind, section.direction)


def _axis_of(section: Section) -> str:
    """Return ``x``, ``y`` or ``z`` if the section's direction is along that axis, else `FREE`."""
    unit = np.asarray(section.direction) / np.linalg.norm(section.direction)
    for word, axis in AXES.items():
        along = float(unit @ np.asarray(axis))
        if (along if section.terms.one_way else abs(along)) > 1.0 - 1e-12:
            return word
    return FREE


HINTS = {
    3: f"Cut the mesh with a {names()} to see its cells inside.",
    2: f"Lay a {names(2)} through the mesh to see the cells on it, and their quality along it.",
}
"""Hint shown while there are no sections, by the mesh's dimension."""

BUTTONS_IN_ROW = 3  # most buttons that add a section in one row
UNSEEN = "Tick the section in the list to show it."
"""Tip of the tools of a section that is not shown."""

SIZES = {
    "8.5 cm wide, a column…": SectionStyle.of_cm(8.5, 6.4),
    "17 cm wide, a page…": SectionStyle.of_cm(17.0, 10.6),
    "25 cm wide, a slide…": SectionStyle.of_cm(25.0, 14.0),
    "1600 pixels wide, for the screen…": SectionStyle((1600, 1000)),
}
"""Sizes of pictures by their words in the menu; the heights are limits."""


class SectionsPanel(Panel):
    """The panel of the sections: their list, and the editor of the selected one."""

    def make(self) -> None:
        self.setObjectName("sections")
        self._size = 8.5, 12.0  # cm
        self._make_list()
        self._make_tools()
        self._place()
        self.follow(_shown)

    # Parts -----------------------------------------------------------------------------
    def _make_list(self) -> None:
        self.add = {
            kind: push_button(row.words[3].name, "", partial(self._add, kind))
            for kind, row in SECTION_SHAPES.items()
        }
        for button in self.add.values():
            set_icon(button, "add")
        self.remove = tool_button("Remove the section (Delete)", self._remove, image="remove")
        self.list = QListWidget()
        self.list.setObjectName("section_list")
        self.list.setMinimumHeight(48)
        elide_items(self.list)
        self.list.itemChanged.connect(self._checked)
        self.list.currentRowChanged.connect(self._row_chosen)
        # For the list alone: elsewhere Delete does something else.
        delete = QShortcut(
            QKeySequence(QKeySequence.StandardKey.Delete),
            self.list,
            context=Qt.ShortcutContext.WidgetShortcut,
        )
        delete.activated.connect(self._remove)
        self.hint = hint_label(HINTS[3], Qt.AlignmentFlag.AlignTop)
        self.editor = SectionEditor()
        self.editor.changed.connect(self._replace)
        self.editor.dragging.connect(self.store.set_dragging)
        self.walls = SpanWalls(self.services)

    def _make_tools(self) -> None:
        self.handle = check_box("Handle", "")
        self.flat = check_box("Flat view", "")
        self.handle.clicked.connect(
            lambda on: self.change(changes.show_handle, "section" if on else "")
        )
        views = self.services.section_views
        self.flat.clicked.connect(views.want_flat)
        self.look = tool_button("", views.look_along, image="along")
        self.sizes = QMenu()
        self.picture = tool_button(
            "Save a picture of this section (PNG, SVG, PDF)…", image="picture", menu=self.sizes
        )
        self._picture_tip = self.picture.toolTip()
        for words, paper in SIZES.items():
            choice = self.sizes.addAction(words)
            choice.triggered.connect(lambda _=False, paper=paper: self._want_picture(paper))
        self.sizes.addAction("Other size…").triggered.connect(self._want_other_size)
        self.sizes.addSeparator()
        self.titled = self.sizes.addAction("With title")
        self.with_axes = self.sizes.addAction("With axes")
        for part in (self.titled, self.with_axes):
            part.setCheckable(True)
            part.setChecked(True)

    def _place(self) -> None:
        buttons = list(self.add.values())
        rows = [buttons[i : i + BUTTONS_IN_ROW] for i in range(0, len(buttons), BUTTONS_IN_ROW)]
        add: list[Part] = [in_row(*rows[0], None, self.remove, spacing=5)]
        add += [in_row(*row, None, spacing=5) for row in rows[1:]]
        tools = (self.handle, self.flat, None, self.look, self.picture)
        self.tools = as_widget(in_row(*tools, spacing=5))
        self.rest = QWidget()
        set_policy(self.rest, "Preferred", "Expanding")
        parts = (*add, self.hint, self.list, self.editor, self.walls, self.tools, self.rest)
        in_column(*parts, wide=[self.list], spacing=5, on=self, margins=6)

    # What is shown ---------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        mesh = session.mesh
        sections = session.view.sections
        dim = mesh.dim if mesh is not None else 3
        self.hint.setText(HINTS[dim])
        for kind, button in self.add.items():
            words = SECTION_SHAPES[kind].words.get(dim)
            button.setVisible(words is not None)
            button.setEnabled(mesh is not None)
            if words is not None:
                button.setText(words.name)
                button.setToolTip(words.add)
        self._sync_list(session)
        selected = session.view.section
        for widget in (self.list, self.tools):
            widget.setVisible(bool(sections))
        for widget in (self.hint, self.rest):
            widget.setVisible(not sections)
        self.remove.setEnabled(selected is not None)
        fits = selected is not None and can_cut(mesh, selected)
        self.editor.show_section(selected if fits else None, mesh, session.view.section_index)
        self.walls.setVisible(selected is not None and selected.kind == "span" and dim == 3)
        self._sync_tools(session, dim)

    def _sync_list(self, session: Session) -> None:
        sections = session.view.sections
        with QSignalBlocker(self.list):
            while self.list.count() > len(sections):
                self.list.takeItem(self.list.count() - 1)
            while self.list.count() < len(sections):
                self.list.addItem(QListWidgetItem())
            for row, section in enumerate(sections):
                item = self.list.item(row)
                dim = session.mesh.dim if session.mesh is not None else 3
                why = "" if can_cut(session.mesh, section) else f" ({section.needs(dim)})"
                text = (section.name or section.brief(dim)) + why
                tip = wrapped((section.name or section.describe(dim)) + why)
                state = Qt.CheckState.Checked if section.shown else Qt.CheckState.Unchecked
                if (item.text(), item.toolTip()) != (text, tip):
                    item.setText(text)
                    item.setToolTip(tip)
                # A new item has no check state, which `checkState` returns as unchecked.
                if item.data(Qt.ItemDataRole.CheckStateRole) is None or item.checkState() != state:
                    item.setCheckState(state)
            index = session.view.section_index
            self.list.setCurrentRow(-1 if index is None else index)

    def _sync_tools(self, session: Session, dim: int) -> None:
        selected = session.view.section
        row = next(iter(SECTION_SHAPES.values())) if selected is None else selected.terms
        words = row.words.get(dim, row.words[3])
        shown = selected is not None and selected.shown
        for box, name, tip in (
            (self.handle, "Handle", words.handle),
            (self.flat, words.flat_name, words.flat),
        ):
            box.setText(name)
            box.setEnabled(shown)
            box.setToolTip(tip if shown else UNSEEN)
        self.handle.setChecked(session.view.handle == "section")
        self.flat.setChecked(selected is not None and selected.flat)
        self.look.setToolTip(words.look)
        self.look.setVisible(bool(words.look))
        self.picture.setEnabled(not session.lacks_cells)
        self.picture.setToolTip(wrapped(session.lacks_cells) or self._picture_tip)

    # What is wanted --------------------------------------------------------------------
    def _add(self, kind: str, _checked: bool = False) -> None:
        session = self.session
        section = first_section(kind, session, period_of(session))
        self.change(changes.add_section, section)
        try:
            with_walls(section, session.opened_mesh, session.case, session.pairs)
        except SlidevizError as error:  # no hub and shroud: they can be chosen below the list now
            self.services.banner.show_message(with_field_labels(str(error)))

    def _want_picture(self, paper: SectionStyle) -> None:
        title = self.titled.isChecked()
        axes = self.with_axes.isChecked()
        self.services.exports.section(replace(paper, title=title, axes=axes))

    def _want_other_size(self) -> None:
        size = questions.ask_paper(self, *self._size)
        if size is not None:
            self._size = size
            self._want_picture(SectionStyle.of_cm(*size))

    def _remove(self) -> None:
        view = self.session.view
        if view.section is not None:
            self.change(changes.remove_section, view.section_index)

    def _replace(self, section: Section) -> None:
        view = self.session.view
        if view.section is not None:
            self.change(changes.replace_section, view.section_index, section)

    def _checked(self, item: QListWidgetItem) -> None:
        row = self.list.row(item)
        section = self.session.view.sections[row]
        shown = item.checkState() == Qt.CheckState.Checked
        if shown != section.shown:
            self.change(changes.replace_section, row, replace(section, shown=shown))

    def _row_chosen(self, row: int) -> None:
        if row >= 0:
            self.change(changes.choose_section, row)


def _shown(session: Session) -> object:
    view = session.view
    return session.mesh, view.sections, view.section_index, view.handle
