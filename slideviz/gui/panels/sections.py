"""The sections panel: planes and cylinders through the mesh, and the form for one of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from qtpy.QtCore import QSignalBlocker, Qt, Signal
from qtpy.QtGui import QKeySequence, QShortcut
from qtpy.QtWidgets import (
    QCheckBox,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QPushButton,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from slideviz.export.section_job import Paper, save_section
from slideviz.gui.panels.section_editor import SectionEditor
from slideviz.gui.panels.section_words import HINTS, NAMES, TIPS, UNSEEN
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.elided import elide_items
from slideviz.gui.widgets.icons import icon
from slideviz.gui.widgets.tips import wrapped
from slideviz.scene.passages import Period
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.section_cuts import can_cut
from slideviz.session.section_start import first_cylinder, first_plane
from slideviz.session.state import Session

if TYPE_CHECKING:
    from slideviz.gui.viewport.cutting import Cutting

PICTURES = "PNG picture (*.png);;SVG drawing (*.svg);;PDF drawing (*.pdf)"
SIZES = {
    "8.5 cm wide, a column…": Paper.of_cm(8.5, 6.4),
    "17 cm wide, a page…": Paper.of_cm(17.0, 10.6),
    "25 cm wide, a slide…": Paper.of_cm(25.0, 14.0),
    "1600 pixels wide, for the screen…": Paper((1600, 1000)),
}
"""Sizes of pictures, with the words of the menu; the height is the most."""


class SectionsPanel(QWidget):
    """A list of sections, and what can be said of the one that is chosen.

    Parameters
    ----------
    cutting : Cutting
        Knows which section is chosen, and shows its handle and its flat view.
    """

    picture_wanted = Signal(object)

    def __init__(self, cutting: Cutting) -> None:
        super().__init__()
        self.setObjectName("sections")
        self.cutting, self.store = cutting, cutting.store
        self._period = Period()
        self._icons: list[tuple[Any, str]] = []
        self._listed: tuple[object, ...] = ()
        self._make_list()
        self._make_rest()
        self.store.listen(self._session_changed)
        cutting.changed.connect(lambda: self.sync(self.store.session))
        self.sync(self.store.session)

    # Parts -----------------------------------------------------------------------------

    def _make_list(self) -> None:
        self.add_plane, self.add_cylinder = (QPushButton(word) for word in NAMES[3])
        self.add_plane.clicked.connect(self._add_plane)
        self.add_cylinder.clicked.connect(self._add_cylinder)
        self.remove = QToolButton()
        self.remove.setToolTip("Remove the section (Delete)")
        self.remove.clicked.connect(self._remove)
        self._icons += [
            (self.add_plane, "add"),
            (self.add_cylinder, "add"),
            (self.remove, "remove"),
        ]
        self.list = QListWidget()
        self.list.setObjectName("section_list")
        self.list.setMinimumHeight(48)
        elide_items(self.list)
        self.list.itemChanged.connect(self._checked)
        self.list.currentRowChanged.connect(self._row_chosen)
        # For the list alone: elsewhere the key means something else.
        delete = QShortcut(QKeySequence(QKeySequence.StandardKey.Delete), self.list)
        delete.setContext(Qt.ShortcutContext.WidgetShortcut)
        delete.activated.connect(self._remove)
        self.hint = QLabel(HINTS[3])
        self.hint.setWordWrap(True)
        self.hint.setProperty("hint", True)
        self.hint.setAlignment(Qt.AlignmentFlag.AlignTop)

    def _make_rest(self) -> None:
        self.editor = SectionEditor()
        self.editor.changed.connect(self._replace)
        self.editor.held.connect(self.store.hold)
        self.handle, self.flat = QCheckBox("Handle"), QCheckBox("Flat view")
        self.handle.clicked.connect(self.cutting.want_handle)
        self.flat.clicked.connect(self.cutting.want_flat)
        self.look, self.picture = QToolButton(), QToolButton()
        self.look.clicked.connect(self.cutting.look_along)
        self.picture.setToolTip("Save a picture of this section (PNG, SVG, PDF)…")
        self.picture.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.sizes = QMenu(self.picture)
        for words, paper in SIZES.items():
            choice = self.sizes.addAction(words)
            choice.triggered.connect(lambda _=False, paper=paper: self.picture_wanted.emit(paper))
        self.picture.setMenu(self.sizes)
        self._icons += [(self.look, "along"), (self.picture, "picture")]
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 6)
        column.setSpacing(5)
        column.addLayout(_row(self.add_plane, self.add_cylinder, None, self.remove))
        column.addWidget(self.hint)
        column.addWidget(self.list, 1)
        column.addWidget(self.editor)
        self.tools = QWidget()
        line = _row(self.handle, self.flat, None, self.look, self.picture)
        self.tools.setLayout(line)
        column.addWidget(self.tools)
        self.rest = QWidget()
        self.rest.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Expanding)
        column.addWidget(self.rest)

    def take_theme(self, look, colour: str) -> None:
        """Take other colours."""
        for button, name in self._icons:
            button.setIcon(icon(name, colour))
        self.cutting.set_look(look)

    # What is shown ---------------------------------------------------------------------

    def _session_changed(self, old: Session, new: Session) -> None:
        same = old.mesh is new.mesh and old.view.sections == new.view.sections
        if not same:
            self.sync(new)

    def sync(self, session: Session) -> None:
        """Show the sections of a session."""
        mesh, sections = session.mesh, session.view.sections
        flat = mesh is not None and mesh.dim == 2
        dim = 2 if flat else 3
        self.hint.setText(HINTS[dim])
        for button, word in zip((self.add_plane, self.add_cylinder), NAMES[dim], strict=True):
            button.setText(word)
            button.setEnabled(mesh is not None)
        self.add_plane.setToolTip(f"Add a {NAMES[dim][0].lower()} through the middle of the mesh.")
        self.add_cylinder.setToolTip(
            "Add a circle around what moves, or about the axis of the period."
            if flat
            else "Add a cylinder about the axis of the machine."
        )
        self._sync_list(session)
        chosen = self.cutting.section
        for widget in (self.list, self.tools):
            widget.setVisible(bool(sections))
        for widget in (self.hint, self.rest):
            widget.setVisible(not sections)
        self.remove.setEnabled(chosen is not None)
        fits = chosen is not None and can_cut(mesh, chosen)
        self.editor.show_section(chosen if fits else None, mesh, self.cutting.chosen)
        self._sync_tools(chosen, flat)

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
                # A new row has no box at all, which reads as one without its tick.
                if item.data(Qt.ItemDataRole.CheckStateRole) is None or item.checkState() != state:
                    item.setCheckState(state)
            chosen = self.cutting.chosen
            self.list.setCurrentRow(-1 if chosen is None else chosen)

    def _sync_tools(self, chosen: Section | None, flat: bool) -> None:
        plane = chosen is None or chosen.kind == "plane"
        kind = ("line" if plane else "circle") if flat else ("plane" if plane else "cylinder")
        tips = TIPS[kind]
        shown = chosen is not None and chosen.shown
        for box, words, tip in (
            (self.handle, "Handle", tips.handle),
            (self.flat, "Curve" if flat else "Flat view" if plane else "Unrolled", tips.flat),
        ):
            box.setText(words)
            box.setEnabled(shown)
            box.setToolTip(tip if shown else UNSEEN)
        self.handle.setChecked(self.cutting.wants_handle)
        self.flat.setChecked(self.cutting.is_flat)
        self.look.setToolTip(tips.look)
        self.look.setVisible(not flat)

    # What is wanted --------------------------------------------------------------------

    def _add_plane(self) -> None:
        self.store.change(changes.add_section, first_plane(self.store.session))

    def _add_cylinder(self) -> None:
        session = self.store.session
        pair = self._period.of(session)
        self.store.change(changes.add_section, first_cylinder(session, pair))

    def _remove(self) -> None:
        if self.cutting.section is not None:
            self.store.change(changes.remove_section, self.cutting.chosen)

    def _replace(self, section: Section) -> None:
        if self.cutting.section is not None:
            self.store.change(changes.replace_section, self.cutting.chosen, section)

    def _checked(self, item: QListWidgetItem) -> None:
        row = self.list.row(item)
        section = self.store.session.view.sections[row]
        shown = item.checkState() == Qt.CheckState.Checked
        if shown != section.shown:
            self.store.change(changes.replace_section, row, replace(section, shown=shown))

    def _row_chosen(self, row: int) -> None:
        if row >= 0:
            self.cutting.choose(row)


def sections_panel(window: Any) -> SectionsPanel:
    """Return the panel of a window."""
    panel = SectionsPanel(window.cutting)
    panel.picture_wanted.connect(lambda paper: save_picture(window, paper))
    return panel


def save_picture(window: Any, paper: Paper) -> None:
    """Ask for a name and write a picture of the section that is chosen, as it is shown."""
    session, section = window.store.session, window.cutting.section
    if section is None or session.frame is None or window.runner.busy:
        return
    stem = session.path.stem if session.path is not None else "mesh"
    default = window.files.folder() / f"{stem}_section.png"
    path = questions.ask_save(window, "Save picture of the section", default, PICTURES)
    if path is None:
        return
    window.settings.setValue("folder", str(path.parent))
    window.start_job(
        f"Drawing {path.name}",
        lambda done: window.say(f"Saved {done}"),
        save_section,
        path,
        session,
        section,
        paper,
    )


def _row(*widgets: QWidget | None) -> QHBoxLayout:
    """Return widgets in a row; None is what takes the room that is left."""
    line = QHBoxLayout()
    line.setContentsMargins(0, 0, 0, 0)
    line.setSpacing(5)
    for widget in widgets:
        if widget is None:
            line.addStretch(1)
        else:
            line.addWidget(widget)
    return line
