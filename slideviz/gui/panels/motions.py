"""The motion panel: motions of the boundaries, the editor of one, tables of displacements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from qtpy.QtCore import QSignalBlocker, QSize, Qt
from qtpy.QtGui import QAction, QKeySequence
from qtpy.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QHBoxLayout,
    QLabel,
    QListWidget,
    QMenu,
    QPlainTextEdit,
    QToolButton,
    QWidget,
)

from slideviz.case.motion_text import read_motions, write_motions
from slideviz.case.motion_words import describe
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.kinds import KINDS
from slideviz.case.motions.motion import Motion, MotionStart, Target, named
from slideviz.case.motions.rigid import Translate
from slideviz.errors import SlidevizError
from slideviz.gui.panels.motion_editor import KIND_LABELS, MotionEditor
from slideviz.gui.responsiveness.timers import TABLE_MS, single_shot
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    dialog_buttons,
    elide_items,
    fixed_font,
    hint_label,
    in_column,
    in_row,
    set_style,
    tool_button,
    wrapped,
)
from slideviz.gui.widgets.panel import FieldWatch, Panel, SpanWalls
from slideviz.mesh.model import Mesh
from slideviz.session import changes
from slideviz.session.motions import (
    TableRows,
    box_names,
    boxes_hint,
    centroid,
    chord_of,
    machine_axis,
    new_target,
    table_text,
    targets,
    write_table,
)
from slideviz.session.reach import TYPED_TIP, typed_words
from slideviz.session.run_messages import Requirement
from slideviz.session.state import Session

FILTERS = "Displacements (*.txt)"
ABOUT = (
    "A row for each node: its number, counted from 0 as in the mesh file, and its displacement in "
    "the mesh's length unit. Columns are separated by tabs, spaces, commas or semicolons, so that "
    "rows of a spreadsheet can be pasted. Nodes without a row stay."
)


class TableDialog(QDialog):
    """The dialog for a table of displacements; a text below it shows its effect or its error.

    ``rows``: the nodes it may list; checks the text. ``text``: the initial table.
    """

    def __init__(self, parent: QWidget | None, rows: TableRows, text: str) -> None:
        super().__init__(parent)
        self.rows = rows
        self.setWindowTitle(f"Displacements of {rows.of}")
        self.resize(QSize(520, 560).boundedTo(self.screen().availableSize()))
        about = QLabel(ABOUT, wordWrap=True)
        self.edit = QPlainTextEdit(text)
        self.edit.setObjectName("table")
        self.edit.setFont(fixed_font())
        self.edit.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.edit.setPlaceholderText(f"{rows.heading}\n…")
        self.answer = QLabel(wordWrap=True)
        self.buttons = dialog_buttons(self)
        kind = QDialogButtonBox.ButtonRole
        self.fill = self.buttons.addButton("List all nodes", kind.ActionRole)
        self.fill.setToolTip("Add a row of zeros for each node that has none yet.")
        self.fill.setAutoDefault(False)
        self.save = self.buttons.addButton("Save as…", kind.AcceptRole)
        self.save.setToolTip("Save the table as a displacement file, which the case then uses.")
        self.buttons.addButton(QDialogButtonBox.StandardButton.Cancel)
        self.setLayout(in_column(about, self.edit, self.answer, self.buttons, wide=[self.edit]))
        self.fill.clicked.connect(self._fill)
        self._soon = single_shot(self, self.check, TABLE_MS)
        self.edit.textChanged.connect(self._soon.start)
        self.edit.setFocus()
        self.check()

    @property
    def text(self) -> str:
        return self.edit.toPlainText()

    def _fill(self) -> None:
        self.edit.selectAll()
        # Unlike `setPlainText`, this can be undone.
        self.edit.insertPlainText(self.rows.fill(self.text))
        self.check()

    def check(self) -> None:
        """Show the effect of the table, or its error, and enable the save button accordingly."""
        self._soon.stop()
        try:
            said = self.rows.check(self.text)
            wrong = False
        except SlidevizError as error:
            said = str(error)
            wrong = True
        self.answer.setText(said)
        set_style(self.answer, "bad", wrong and bool(self.text.strip()))
        self.save.setEnabled(not wrong)

    def accept(self) -> None:
        self.check()
        if self.save.isEnabled():
            super().accept()


def ask_table(parent: QWidget, rows: TableRows, path: Path, default: Path) -> Path | None:
    """Open the dialog of a table; return the file it was saved to, or None if it was not saved.

    Raises SlidevizError if the file cannot be read or written. ``rows``: the nodes the table may
    list; checks the text. ``path``: the displacement file to edit, if it exists. ``default``: the
    name that is offered for a new file.
    """
    dialog = TableDialog(parent, rows, table_text(path))
    there = path.is_file()
    while dialog.exec():
        target = questions.ask_save(parent, "Save the table", path if there else default, FILTERS)
        if target is not None:
            write_table(target, dialog.text, path)
            return target
    return None


HEIGHT = 300  # preferred height of the panel, in pixels


class MotionPanel(Panel):
    """The panel of the case's motions: their list, and the editor of the selected one."""

    def make(self) -> None:
        self._mesh: Mesh | None = None
        self._extent = 0.0
        buttons = self._make_buttons()
        self.list = QListWidget()
        self.list.setObjectName("motions")
        self.list.setMinimumHeight(52)
        self.list.setMaximumHeight(140)
        self.list.setAlternatingRowColors(True)
        elide_items(self.list)
        self.list.currentRowChanged.connect(self._row_changed)
        # A click on the row that is current already brings its handle back.
        self.list.clicked.connect(lambda at: self.change(changes.choose_motion, at.row()))
        self.list.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self.list.addActions(list(self.actions_table.values()))
        self.editor = MotionEditor(SpanWalls(self.services))
        self.editor.centroid_of = self._centroid
        self.editor.chord_of = self._chord
        self.editor.changed.connect(self._edited)
        self.editor.drawn.dragging.connect(self.store.set_dragging)
        self.editor.table_wanted.connect(self.edit_table)
        self.editor.box_wanted.connect(lambda: self.change(changes.add_box, self.list.currentRow()))
        self.editor.box_changed.connect(
            lambda *shape: self.change(changes.shape_box, self.list.currentRow(), *shape)
        )
        self.hint = hint_label(align=Qt.AlignmentFlag.AlignTop)
        parts = (buttons, self.list, self.editor, self.hint, None)
        layout = in_column(*parts, spacing=4, on=self, margins=(6, 6, 6, 4))
        layout.setStretchFactor(self.list, 4)
        self.follow(lambda session: session.mesh, self._set_mesh)
        self.follow()
        self.watch = FieldWatch(self, self.store, "motion")

    def _make_buttons(self) -> QHBoxLayout:
        menu = QMenu()
        self.add = tool_button("", image="add", text="Add motion", menu=menu, name="add_motion")
        self.add_actions = {}
        for kind, label in KIND_LABELS.items():
            words = f"{label}: {', '.join(kind.verbs)}" if len(kind.verbs) > 1 else label
            self.add_actions[kind] = menu.addAction(words[:1].upper() + words[1:])
            self.add_actions[kind].triggered.connect(partial(self._add, kind))
        self.add_table = menu.addAction("Displacement table…", self.new_table)
        return in_row(self.add, None, *self._make_actions(), spacing=2)

    def _make_actions(self) -> Iterator[QToolButton]:
        """Make the actions of the list's menu, and yield a button for each that has an icon."""
        self.actions_table: dict[str, QAction] = {}
        for name, text, keys, function, image, tip in (
            ("duplicate", "Duplicate", "Ctrl+D", self._duplicate, "", ""),
            ("copy", "Copy", "Ctrl+C", self._copy, "", ""),
            ("paste", "Paste", "Ctrl+V", self._paste, "", ""),
            ("earlier", "Perform it earlier", "Ctrl+Up", lambda: self._move(-1), "up", ""),
            ("later", "Perform it later", "Ctrl+Down", lambda: self._move(1), "down", ""),
            ("remove", "Remove", "Del", self._remove, "remove", "Remove the motion (Del)"),
        ):
            act = self.actions_table[name] = QAction(text, self)
            act.setShortcut(QKeySequence(keys))
            # The keys work while the list has the focus.
            act.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
            act.triggered.connect(lambda _=False, function=function: function())
            if image:
                button = tool_button(tip or text, act.trigger, image=image, name=f"motion_{image}")
                act.enabledChanged.connect(button.setEnabled)
                yield button

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        motions = session.case.motions
        moving = session.case.markers_with("moving")
        dim = session.mesh.dim if session.mesh is not None else 2
        said = (describe(motion, dim, self._extent) for motion in motions)
        texts = [f"{i}.  {text}" for i, text in enumerate(said, 1)]
        with QSignalBlocker(self.list):
            chosen = session.motion_index
            row = -1 if chosen is None else chosen
            if self.list.count() != len(texts) or row != self.list.currentRow():
                self.editor.show_another()
            if self.list.count() != len(texts):
                self.list.clear()
                self.list.addItems(texts)
            for place, text in enumerate(texts):
                self.list.item(place).setText(text)
                self.list.item(place).setToolTip(wrapped(text))
            self.list.setCurrentRow(row)
        self.editor.machine = machine_axis(session)
        self.editor.boxes = box_names(session)
        case = session.case
        names = (name for name, _ in case.ffd_boxes)
        self.editor.degrees = dict(zip(names, case.ffd_degrees, strict=False))
        self.editor.system = case.ffd_system
        self._sync_editor(session)
        self._sync_buttons(session, moving)

    def _set_mesh(self, session: Session) -> None:
        """Store another mesh and its extent (slow for a large mesh) and pass both to the editor."""
        mesh = session.mesh
        self._mesh = mesh
        self._extent = mesh.extent if mesh is not None else 0.0
        for kind in (kind for kind in KINDS if kind.only_3d):  # as in the editor
            self.add_actions[kind].setEnabled(mesh is None or mesh.dim == 3)
        self.editor.set_extent(self._extent)

    def _chord(self, target: Target) -> tuple[float, float]:
        moving = self.session.case.markers_with("moving")
        return (0.0, 1.0) if self._mesh is None else chord_of(self._mesh, named(target) or moving)

    def _centroid(self, target: Target) -> tuple[float, ...]:
        """Return the centroid of a target: the boundaries it names, or all moving ones."""
        moving = self.session.case.markers_with("moving")
        assert self._mesh is not None
        return centroid(self._mesh, named(target) or moving)

    def _sync_editor(self, session: Session) -> None:
        row = self.list.currentRow()
        motions = session.case.motions
        dim = session.mesh.dim if session.mesh else 3
        motion = motions[row] if 0 <= row < len(motions) else None
        self.editor.show_motion(motion, targets(session), dim)

    def _sync_buttons(self, session: Session, moving: tuple[str, ...]) -> None:
        row = self.list.currentRow()
        count = self.list.count()
        for name, able in (
            ("duplicate", row >= 0),
            ("copy", row >= 0),
            ("paste", bool(moving)),
            ("earlier", row > 0),
            ("later", 0 <= row < count - 1),
            ("remove", row >= 0),
        ):
            self.actions_table[name].setEnabled(able)
        self.add.setEnabled(bool(moving))
        if session.mesh is None:
            why = "Open a mesh first."
        elif not moving:
            why = "No boundary moves yet. Give one the role “moving” in the table above."
        else:
            why = ""
        self.add.setToolTip(why or "Add a motion; several are performed in sequence.")
        usual = "Add the motions of the boundary; the view shows them at once."
        reach = typed_words(session)
        hints = [why or (usual if count == 0 else ""), boxes_hint(session), reach]
        self.hint.setText("\n".join(filter(None, hints)))
        self.hint.setToolTip(wrapped(TYPED_TIP) if reach else "")
        self.hint.setVisible(any(hints))

    # Widgets to state ------------------------------------------------------------------
    def _row_changed(self, row: int) -> None:
        self.editor.show_another()
        self.change(changes.choose_motion, row)

    def _add(self, kind: type[Motion], *_checked: bool) -> None:
        self._add_for(new_target(self.session), kind)

    def _add_for(self, target: Target, kind: type[Motion]) -> None:
        """Add a motion with zero displacement, and put the cursor into its first field."""
        session = self.session
        boxes = box_names(session)
        machine = machine_axis(session)
        chord = self._chord(target)
        motion = kind.new(target, MotionStart(session.mesh.dim, machine, boxes, chord))
        self.change(changes.add_motion, motion)
        self.editor.focus()

    def focus_requirement(self, missing: Requirement) -> None:
        """Put the cursor where a missing requirement is met; add a motion if one is missing."""
        motions = self.session.case.motions
        if self.watch.focus():
            return
        if missing.marker:
            self.change(changes.select, (missing.marker,))
            self._add_for(missing.marker, type(motions[-1]) if motions else Translate)
        elif motions:
            self.list.setCurrentRow(missing.motion)
            self.editor.focus()

    def _insert(self, motion: Motion) -> None:
        row = self.list.currentRow() + 1
        self.change(changes.add_motion, motion, row)

    def _duplicate(self) -> None:
        self._insert(self.session.case.motions[self.list.currentRow()])

    def _copy(self) -> None:
        """Copy the selected motion to the clipboard, written as in a case file."""
        motion = self.session.case.motions[self.list.currentRow()]
        with self.services.banner.showing_errors():
            QApplication.clipboard().setText(write_motions((motion,)))

    def _paste(self) -> None:
        """Add the motions in the clipboard, as written in a case file, below the selected one."""
        session = self.session
        moving = session.case.markers_with("moving")
        try:
            motions = read_motions(QApplication.clipboard().text().replace("\\\n", " "))
        except SlidevizError as error:
            said = SlidevizError(f"The clipboard has no motion: {error}")
            self.services.banner.show_error(said)
            return
        for motion in motions:
            fits = set(named(motion.marker)) <= set(moving)
            self._insert(motion if fits else replace(motion, marker=new_target(session)))

    def new_table(self) -> None:
        marker = new_target(self.session)
        path = self._ask_table(marker, Path())
        if path is not None:
            self.change(changes.add_motion, FromFile(path, marker))

    def edit_table(self) -> None:
        row = self.list.currentRow()
        motion = self.session.case.motions[row]
        (before,) = motion.files
        path = self._ask_table(motion.marker, before)
        if path is None:
            return
        if path == before:
            # The file has other rows now, but the motion is equal: change it and back, so that
            # whoever caches the file's content reads it again.
            self.change(changes.replace_motion, row, FromFile(Path(), motion.marker))
        self.change(changes.replace_motion, row, FromFile(path, motion.marker))

    def _ask_table(self, marker: Target, path: Path) -> Path | None:
        session = self.session
        case = session.case
        mesh = session.opened_mesh
        beside = case.source or session.path
        folder = beside.parent if beside is not None else self.services.files.folder()
        names = named(marker)
        default = folder / f"displacement_{names[0] if len(names) == 1 else 'moving'}.txt"
        with self.services.banner.showing_errors():
            rows = TableRows.on(mesh, case, marker)
            return ask_table(self.window(), rows, path, default)
        return None

    def _edited(self, motion: object) -> None:
        self.change(changes.replace_motion, self.list.currentRow(), motion)

    def _remove(self) -> None:
        self.change(changes.remove_motion, self.list.currentRow())

    def _move(self, by: int) -> None:
        self.change(changes.move_motion, self.list.currentRow(), by)

    def sizeHint(self) -> QSize:
        # Independent of the shown form, so that the panel above does not jump.
        return QSize(super().sizeHint().width(), HEIGHT)
