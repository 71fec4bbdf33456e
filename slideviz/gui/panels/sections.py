"""The sections panel: the list of sections, and the editor of one."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from qtpy.QtCore import QSignalBlocker, Qt, Signal
from qtpy.QtGui import QKeySequence, QShortcut
from qtpy.QtWidgets import QListWidget, QListWidgetItem, QMenu, QSizePolicy, QWidget

from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.export.section_job import PageFormat, save_section
from slideviz.gui.panels.section_editor import SectionEditor
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    Part,
    as_widget,
    check_box,
    hint_label,
    in_column,
    in_row,
    push_button,
    tool_button,
)
from slideviz.gui.widgets.icons import set_icon
from slideviz.gui.widgets.labels import elide_items, wrapped
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import PLOT_FILTERS
from slideviz.gui.widgets.services import Services
from slideviz.scene.passages import Period
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.section_cuts import can_cut, first_section
from slideviz.session.state import IN_FILE, Session

if TYPE_CHECKING:
    from slideviz.gui.viewport.section_views import SectionViews

HINTS = {
    3: f"Cut the mesh with a {names()} to see its cells inside.",
    2: f"Lay a {names(2)} through the mesh to see the cells on it, and their quality along it.",
}
"""Hint shown while there are no sections, by the mesh's dimension."""

BUTTONS_IN_ROW = 3
"""Most buttons that add a section in one row."""

UNSEEN = "Tick the section in the list to show it."
"""Tip of the tools of a section that is not shown."""

SIZES = {
    "8.5 cm wide, a column…": PageFormat.of_cm(8.5, 6.4),
    "17 cm wide, a page…": PageFormat.of_cm(17.0, 10.6),
    "25 cm wide, a slide…": PageFormat.of_cm(25.0, 14.0),
    "1600 pixels wide, for the screen…": PageFormat((1600, 1000)),
}
"""Sizes of pictures by their words in the menu; the heights are limits."""


class SectionsPanel(Panel):
    """The panel of the sections: their list, and the editor of the selected one.

    ``section_views``: the handles and the flat views of the selected section.
    """

    picture_wanted = Signal(object)  # PageFormat
    """The user wants a picture of the selected section, on this paper."""

    def __init__(self, section_views: SectionViews) -> None:
        super().__init__(section_views.store)
        self.setObjectName("sections")
        self.section_views = section_views
        self._period = Period()
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
        delete = QShortcut(QKeySequence(QKeySequence.StandardKey.Delete), self.list)
        delete.setContext(Qt.ShortcutContext.WidgetShortcut)
        delete.activated.connect(self._remove)
        self.hint = hint_label(HINTS[3], Qt.AlignmentFlag.AlignTop)
        self.editor = SectionEditor()
        self.editor.changed.connect(self._replace)
        self.editor.dragging.connect(self.store.set_dragging)

    def _make_tools(self) -> None:
        self.handle, self.flat = check_box("Handle", ""), check_box("Flat view", "")
        self.handle.clicked.connect(self._want_handle)
        self.flat.clicked.connect(self.section_views.want_flat)
        self.look = tool_button("", self.section_views.look_along, image="along")
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
        self.titled, self.with_axes = (
            self.sizes.addAction(words) for words in ("With title", "With axes")
        )
        for part in (self.titled, self.with_axes):
            part.setCheckable(True)
            part.setChecked(True)

    def _place(self) -> None:
        buttons = list(self.add.values())
        rows = [buttons[i : i + BUTTONS_IN_ROW] for i in range(0, len(buttons), BUTTONS_IN_ROW)]
        add: list[Part] = [in_row(*rows[0], None, self.remove, spacing=5)]
        add += [in_row(*row, None, spacing=5) for row in rows[1:]]
        tools = (self.handle, self.flat, None, self.look, self.picture)
        self.tools, self.rest = as_widget(in_row(*tools, spacing=5)), QWidget()
        self.rest.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Expanding)
        parts = (*add, self.hint, self.list, self.editor, self.tools, self.rest)
        in_column(*parts, wide=[self.list], spacing=5, on=self, margins=(6, 6, 6, 6))

    # What is shown ---------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Show the sections of a session."""
        mesh, sections = session.mesh, session.view.sections
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
                why = "" if can_cut(session.mesh, section) else " (needs a 3D mesh)"
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
        row = next(iter(SECTION_SHAPES.values())) if selected is None else selected.shape.terms
        words = row.words.get(dim, row.words[3])
        shown = selected is not None and selected.shown
        for box, name, tip in (
            (self.handle, "Handle", words.handle),
            (self.flat, words.flat_name, words.flat),
        ):
            box.setText(name)
            box.setEnabled(shown)
            box.setToolTip(tip if shown else UNSEEN)
        self.handle.setChecked(session.view.handle)
        self.flat.setChecked(selected is not None and selected.flat)
        self.look.setToolTip(words.look)
        self.look.setVisible(bool(words.look))
        self.picture.setEnabled(not session.in_file)
        self.picture.setToolTip(wrapped(IN_FILE) if session.in_file else self._picture_tip)

    # What is wanted --------------------------------------------------------------------

    def _add(self, kind: str, _checked: bool = False) -> None:
        session = self.store.session
        pair = self._period.of(session)
        self.store.change(changes.add_section, first_section(kind, session, pair))

    def _want_handle(self, shown: bool) -> None:
        self.store.change(changes.show_handle, shown)

    def _want_picture(self, paper: PageFormat) -> None:
        title, axes = self.titled.isChecked(), self.with_axes.isChecked()
        self.picture_wanted.emit(replace(paper, title=title, axes=axes))

    def _want_other_size(self) -> None:
        size = questions.ask_paper(self, *self._size)
        if size is not None:
            self._size = size
            self._want_picture(PageFormat.of_cm(*size))

    def _remove(self) -> None:
        view = self.store.session.view
        if view.section is not None:
            self.store.change(changes.remove_section, view.section_index)

    def _replace(self, section: Section) -> None:
        view = self.store.session.view
        if view.section is not None:
            self.store.change(changes.replace_section, view.section_index, section)

    def _checked(self, item: QListWidgetItem) -> None:
        row = self.list.row(item)
        section = self.store.session.view.sections[row]
        shown = item.checkState() == Qt.CheckState.Checked
        if shown != section.shown:
            self.store.change(changes.replace_section, row, replace(section, shown=shown))

    def _row_chosen(self, row: int) -> None:
        if row >= 0:
            self.store.change(changes.choose_section, row)


def _shown(session: Session) -> object:
    view = session.view
    return session.mesh, view.sections, view.section_index, view.handle


def sections_panel(window: Services) -> SectionsPanel:
    """Return a new sections panel, connected with a window."""
    panel = SectionsPanel(window.section_views)
    panel.picture_wanted.connect(lambda paper: save_picture(window, paper))
    return panel


def save_picture(window: Services, paper: PageFormat) -> None:
    """Ask for a file name and start the job that writes a picture of the selected section."""
    session, section = window.store.session, window.store.session.view.section
    if section is None or session.frame is None or window.runner.busy:
        return
    stem = session.path.stem if session.path is not None else "mesh"
    default = window.files.folder() / f"{stem}_section.png"
    path = questions.ask_save(window, "Save picture of the section", default, PLOT_FILTERS)
    if path is None:
        return
    window.settings.setValue("folder", str(path.parent))
    window.running.start_job(
        f"Drawing {path.name}",
        lambda done: window.show_status(f"Saved {done}"),
        save_section,
        path,
        session,
        section,
        paper,
    )
