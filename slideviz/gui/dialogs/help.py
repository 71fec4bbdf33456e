"""Help in the window: the manual, keyboard shortcuts, case keys, about, details for a report."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from qtpy.QtCore import QModelIndex, QObject, QSignalBlocker, QSize, Qt, QUrl
from qtpy.QtGui import (
    QAction,
    QImage,
    QKeyEvent,
    QKeySequence,
    QTextCursor,
    QTextDocument,
)
from qtpy.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QSplitter,
    QTextBrowser,
    QToolButton,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

import slideviz
from slideviz import __version__
from slideviz.case.cfg import describe_keys
from slideviz.case.keys import KEYS, Key
from slideviz.case.words import counted
from slideviz.gui.commands import COMMANDS, MOUSE, PANEL_KEYS, CommandState
from slideviz.gui.widgets.build import (
    dialog_buttons,
    fixed_font,
    hint_label,
    in_column,
    in_row,
    push_button,
    reveal,
)
from slideviz.gui.widgets.error_reporter import versions
from slideviz.gui.widgets.services import Services
from slideviz.gui.widgets.theme import logo
from slideviz.session import changes
from slideviz.session.panes import run_title

RECENT = 12  # entries that the palette has first, as they were chosen last
LOG_LINES = 40  # number of the log's last lines in a bug report
CLOSE = QDialogButtonBox.StandardButton.Close


class Help(QObject):
    """What the Help menu does: manual, palette, case keys, about, and details for a bug report."""

    def __init__(self, window: Services) -> None:
        super().__init__(window)
        self.window = window
        self._shown: dict[str, Any] = {}

    def case_keys(self, wanted: str = "") -> None:
        """Show all keys of a case, at a wanted text."""
        self._show("keys", lambda: TextDialog(self.window, "Case keys", describe_keys()))
        if wanted:
            self._shown["keys"].search.setText(wanted)

    def manual(self, page: Path | None = None) -> None:
        """Show the manual, at a page."""
        folder = manual_folder()
        if folder is None:
            self.window.banner.show_message(
                "The manual was not installed with this copy of slideviz."
            )
            return
        self._show("manual", lambda: ManualDialog(self.window, folder))
        if page is not None:
            self._shown["manual"].pages.show_page(page)

    def palette(self) -> None:
        self._show("palette", lambda: PaletteDialog(self))
        self._shown["palette"].refresh()

    def show_key(self, key: Key) -> None:
        """Go to the field of a key of the case, or else show it among all keys."""
        panel = self.window.dock_manager.panels["method"]
        field = panel.findChild(QWidget, key.field) if key.form else None
        if field is None:
            self.case_keys(f"{key.name}=")
            return
        panel.findChild(QToolButton, "more").setChecked(True)
        self.window.dock_manager.bring_to_front("method")
        field.setFocus()
        reveal(field)

    def about(self) -> None:
        self._show("about", lambda: AboutDialog(self.window))

    def copy_details(self) -> None:
        """Copy the details for a bug report to the clipboard (see `details`)."""
        QApplication.clipboard().setText(details(self.window))
        self.window.show_status("Copied; paste it into the report and say what you did")

    def _show(self, name: str, make: Callable[[], QDialog]) -> None:
        dialog = self._shown.get(name)
        if dialog is None:
            dialog = self._shown[name] = make()
        dialog.show()
        dialog.raise_()
        dialog.activateWindow()
        for field in dialog.findChildren(QLineEdit):  # typing replaces what was searched before
            field.setFocus()
            field.selectAll()


class SearchDialog(QDialog):
    """The base of dialogs with a search field above a body: ``words`` are shown in the empty field.

    ``size``: its width and height in pixels, where the screen is large enough.
    """

    def __init__(self, parent: QWidget, title: str, size: QSize, words: str) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.resize(size.boundedTo(self.screen().availableSize()))
        self.search = QLineEdit(placeholderText=words, clearButtonEnabled=True)
        self.search.textChanged.connect(self.look_for)
        self.count = hint_label()
        self.count.setWordWrap(False)

    def lay_out(self, body: QWidget, *beside: QPushButton) -> None:
        """Place the search field above the body, with buttons beside it."""
        buttons = dialog_buttons(self, CLOSE)
        for button in (*beside, buttons.button(CLOSE)):
            button.setAutoDefault(False)  # Enter belongs to the search
        head = in_row(self.search, self.count, *beside, wide=[self.search])
        self.setLayout(in_column(head, body, buttons, wide=[body]))
        self.search.setFocus()

    def look_for(self, wanted: str) -> None:
        """Show what has the searched words, and how often."""
        raise NotImplementedError


def show_matching(above: QTreeWidgetItem, matches: Callable[[QTreeWidgetItem], bool]) -> int:
    """Hide the items below one that neither match nor have any that do; return the matches."""
    count = 0
    for item in filter(None, map(above.child, range(above.childCount()))):
        found = matches(item) + show_matching(item, matches)
        item.setHidden(not found)
        count += found
    return count


class Entry(NamedTuple):
    """A row of the palette."""

    title: str
    keys: str
    about: str
    """What it does or is; of a command that is disabled, why."""
    do: Callable[..., object] | None = None
    """Does it; None where that is not possible from here."""
    synonyms: str = ""
    """What else it is called."""


def palette_entries(helper: Help) -> Iterator[Entry]:
    """Yield commands, boundaries, runs, keys of the case, pages, and what keys and mouse do."""
    window = helper.window
    session = window.store.session
    now = CommandState(session)  # a plain one: no title such as “Undo role”
    for name, command in COMMANDS.items():
        act = window.findChild(QAction, name)
        about, do = (command.tip, act.trigger) if act.isEnabled() else (act.whatsThis(), None)
        keys = act.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
        title = command.called(now).replace("&", "").rstrip("…")
        yield Entry(title, keys, about, do, command.synonyms)
    add = window.findChild(QToolButton, "add_motion")
    for act in add.menu().actions() if add.isEnabled() else ():
        if act.isEnabled():
            yield Entry(f"Add motion: {act.text()}", "", "motion", act.trigger)
    change = partial(partial, window.store.change)
    for name in session.mesh.marker_names if session.mesh is not None else ():
        yield Entry(name, "", "boundary", change(changes.select, [name]))
    for run in session.runs:
        yield Entry(run_title(run, session.runs), "", "run", change(changes.show_run, run.number))
    for key in KEYS.values():
        yield Entry(key.name, "", key.meaning, partial(helper.show_key, key))
    folder = manual_folder()
    for _, path in manual_pages(folder) if folder is not None else ():
        yield Entry(page_title(path), "", "page of the manual", partial(helper.manual, path))
    for what, (keys, *about) in PANEL_KEYS.items():
        yield Entry(what, keys, "".join(about) or "in its panel")
    yield from (Entry(what, keys, "mouse") for keys, what in MOUSE.items())


class PaletteDialog(SearchDialog):
    """The dialog that finds and does everything by letters of its name; what was done is first."""

    def __init__(self, helper: Help) -> None:
        words = "Find a command, boundary, run, key or page (Enter does it)"
        super().__init__(helper.window, "Find anything", QSize(1060, 700), words)
        self.count.setText("Nothing found")
        self.helper = helper
        self.tree = QTreeWidget()
        self.tree.setHeaderLabels(["Name", "Keys", "What it does"])
        for column, width in enumerate((360, 170)):
            self.tree.setColumnWidth(column, width)
        self.tree.setRootIsDecorated(False)
        self.tree.itemActivated.connect(self._do)
        self.lay_out(self.tree)

    def refresh(self) -> None:
        """Take the present commands, boundaries and runs."""
        self.entries = list(palette_entries(self.helper))
        self.look_for(self.search.text())

    @property
    def _recent(self) -> list[str]:
        titles: Any = self.helper.window.settings.value("palette", [], type=list)
        return list(titles)

    def look_for(self, wanted: str) -> None:
        recent = self._recent
        near = wanted.strip().lower()
        letters = re.compile(".*?".join(map(re.escape, near)))

        def rank(entry: Entry) -> tuple[bool, bool, bool, int]:
            done = recent.index(entry.title) if entry.title in recent else RECENT
            title = entry.title.lower()
            return title != near, near not in title, entry.do is None, done

        self.tree.clear()
        for entry in sorted(self.entries, key=rank):
            others = f"{entry.keys} {entry.about} {entry.synonyms}".lower()
            if letters.search(entry.title.lower()) or near in others:
                item = QTreeWidgetItem(self.tree, entry[:3])
                item.setData(0, PATH, entry)
                item.setToolTip(2, entry.about)
                item.setDisabled(entry.do is None)
        self.count.setVisible(not self.tree.topLevelItemCount())
        self.tree.setCurrentIndex(self.tree.model().index(0, 0))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        super().keyPressEvent(event)
        self.tree.keyPressEvent(event)  # the search field does nothing with arrows and Enter

    def _do(self, item: QTreeWidgetItem) -> None:
        entry = item.data(0, PATH)
        if entry.do is not None:
            recent = dict.fromkeys([entry.title, *self._recent])
            self.helper.window.settings.setValue("palette", list(recent)[:RECENT])
            self.accept()
            entry.do()


class TextDialog(SearchDialog):
    """A dialog with a long text and a field to search it."""

    def __init__(self, parent: QWidget, title: str, text: str) -> None:
        super().__init__(parent, title, QSize(860, 640), "Find (Enter: the next one)")
        self.text = QPlainTextEdit(text, readOnly=True)
        self.text.setFont(fixed_font())
        self.text.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.search.returnPressed.connect(self.next)
        self.lay_out(self.text)

    def look_for(self, wanted: str) -> None:
        self.text.moveCursor(QTextCursor.MoveOperation.Start)
        matches = self.text.toPlainText().lower().count(wanted.lower()) if wanted else 0
        self.count.setText(f"{matches} found" if wanted else "")
        self.next()

    def next(self) -> None:
        """Select the next match of the searched words; after the last one, the first."""
        wanted = self.search.text()
        if wanted and not self.text.find(wanted, QTextDocument.FindFlag(0)):
            self.text.moveCursor(QTextCursor.MoveOperation.Start)
            self.text.find(wanted, QTextDocument.FindFlag(0))


class AboutDialog(QDialog):
    """The dialog with version, libraries and licence."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)

        self.setWindowTitle("About slideviz")
        picture = QLabel(pixmap=logo().pixmap(QSize(64, 64)))
        title = QLabel(
            f"<span style='font-size:18pt; font-weight:600'>slideviz</span> &nbsp;{__version__}<br>"
            "Deforms CFD meshes with radial basis functions,<br>"
            "with boundaries that slide and repeat."
        )
        self.text = QLabel(
            f"<pre>{html.escape(versions())}</pre>",
            textInteractionFlags=Qt.TextInteractionFlag.TextSelectableByMouse,
        )
        licence = QLabel("MIT licence: use, change and pass it on freely; no warranty.")
        buttons = dialog_buttons(self, CLOSE)
        self.copy = buttons.addButton("Copy", QDialogButtonBox.ButtonRole.ActionRole)
        self.copy.setAutoDefault(False)
        self.copy.setToolTip("Copy the versions.")
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(versions()))
        head = in_row(picture, 8, title, wide=[title])
        self.setLayout(in_column(head, self.text, licence, buttons))


def details(window: Services) -> str:
    """Return a text for a bug report: versions, OpenGL, mesh, settings, last log messages."""
    session = window.store.session
    lines = [versions(), _graphics(window)]
    mesh = session.mesh
    if mesh is not None:
        roles = [session.role(name) for name in mesh.marker_names]
        count = ", ".join(f"{roles.count(role)} {role}" for role in dict.fromkeys(roles))
        case = session.case
        lines += [
            f"mesh: {mesh.dim}D, {mesh.file_counts[1]} cells, {len(mesh.points)} points",
            f"boundaries: {count or 'none'}",
            f"sliding {case.sliding}, periodic {case.periodic}, steps {case.steps or 'automatic'}",
            f"runs: {len(session.runs)}, steps shown: {max(len(session.frames) - 1, 0)}",
        ]
    log = window.dock_manager.panels["log"]
    assert isinstance(log, QPlainTextEdit)
    messages = log.toPlainText().splitlines()[-LOG_LINES:]
    return "\n".join([*lines, "", "last messages:", *(messages or ["(none)"]), ""])


def _graphics(window: Services) -> str:
    """Return OpenGL's vendor, renderer and version, as lines."""
    said = window.viewing.view.render_window.ReportCapabilities().splitlines()
    versions = [" ".join(line.split()) for line in said if line.startswith("OpenGL")]
    return "\n".join(versions[:3]) or "OpenGL: not known yet"


_PACKAGE = Path(slideviz.__file__).parent
PLACES = (_PACKAGE / "manual", _PACKAGE.parent / "docs")
"""Folders of the pages: those that are installed with a wheel, and those of the repository."""

_TREE = re.compile(r"^```\{toctree\}\n(.*?)^```\n?", re.MULTILINE | re.DOTALL)
_BLOCK = re.compile(r"^```\{code-block\} ", re.MULTILINE)
_PICTURE = re.compile(r"^!\[[^\]]*\]\(([^)]+)\)\n?", re.MULTILINE)

ELSEWHERE = {
    "commands": "`slideviz --help` lists the commands, and `slideviz COMMAND --help` has the "
    "arguments of one.",
    "python": "In Python, `help(slideviz)` lists the names, and `help(slideviz.deform)` explains "
    "one.",
    "gallery": "The examples are in the folder `docs/examples` of the repository.",
}
"""Pages and folders that are made when the site is built, and where their text is otherwise."""


def manual_folder() -> Path | None:
    """Return the folder of the pages; None where they were not installed."""
    return next((place for place in PLACES if (place / "index.md").is_file()), None)


def manual_pages(folder: Path, page: str = "index", level: int = 0) -> Iterator[tuple[int, Path]]:
    """Yield the pages below ``page`` in the order of the tables of contents, with their level."""
    path = folder / f"{page}.md"
    for block in _TREE.findall(path.read_text(encoding="utf-8")):
        for name in (line.strip() for line in block.splitlines()):
            child = path.parent / f"{name}.md"
            if name in ("keys", *ELSEWHERE) or child.is_file():
                yield level, child
            if child.is_file():
                below = child.relative_to(folder).with_suffix("").as_posix()
                yield from manual_pages(folder, below, level + 1)


def page_text(path: Path) -> str:
    """Return a page as Markdown without Sphinx's directives and pictures that are not there."""
    path = path.with_suffix(".md")
    if path.stem == "keys":
        return f"# Keys of a case file\n\n```\n{describe_keys()}\n```\n"
    if not path.is_file():
        where = ELSEWHERE.get(path.stem) or ELSEWHERE.get(path.parent.name)
        return f"# {path.stem.capitalize()}\n\n{where or 'This page is not in the manual.'}\n"
    text = _TREE.sub("", path.read_text(encoding="utf-8"))
    text = _PICTURE.sub(lambda m: m[0] if (path.parent / m[1]).is_file() else "", text)
    return _BLOCK.sub("```", text)


def page_title(path: Path) -> str:
    """Return the title of a page: its first heading."""
    heading = re.search(r"^# (.+)$", page_text(path), re.MULTILINE)
    return heading[1].replace("`", "") if heading else path.stem


PATH = Qt.ItemDataRole.UserRole
PAGES = (".md", ".rst", "")  # endings of the names of pages in links
LARGEST = 740  # largest width of a picture in a page, in pixels


class Pages(QTextBrowser):
    """A browser of the manual's pages, whose links lead to other pages."""

    def __init__(self) -> None:
        super().__init__(openExternalLinks=True)
        self.sourceChanged.connect(lambda _: self._space())

    def doSetSource(  # type: ignore[override]  # Qt gives a URL, and both
        self, url: QUrl, kind: QTextDocument.ResourceType
    ) -> None:
        # Qt takes only names that end in .md for Markdown.
        is_page = Path(url.path()).suffix in PAGES
        super().doSetSource(url, QTextDocument.ResourceType.MarkdownResource if is_page else kind)

    def loadResource(self, kind: int, url: QUrl | str) -> object:
        path = Path(QUrl(url).toLocalFile())
        if path.suffix in PAGES:
            return page_text(path)
        picture = QImage(str(path))
        if picture.width() > LARGEST:
            return picture.scaledToWidth(LARGEST, Qt.TransformationMode.SmoothTransformation)
        return super().loadResource(kind, url)

    def _space(self) -> None:
        """Put space around the page, and above its headings."""
        self.document().setDocumentMargin(14.0)
        block = self.document().begin()
        while block.isValid():
            form = block.blockFormat()
            if form.headingLevel() > 1:
                form.setTopMargin(18.0)
                QTextCursor(block).setBlockFormat(form)
            block = block.next()

    def show_page(self, path: Path) -> None:
        self.setSource(QUrl.fromLocalFile(str(path)))


class ManualDialog(SearchDialog):
    """The dialog with a list of the manual's pages, a page, and a search in all of them."""

    def __init__(self, parent: QWidget, folder: Path) -> None:
        words = "Find pages with these words (Enter: the next place)"
        super().__init__(parent, "Manual", QSize(1120, 760), words)
        self.pages = Pages()
        self._found: list[Path] = []
        self.search.returnPressed.connect(self._next)
        self.tree = QTreeWidget()
        self.tree.setHeaderHidden(True)
        self.tree.setIndentation(14)
        above: list[QTreeWidget | QTreeWidgetItem] = [self.tree]
        for level, path in manual_pages(folder):
            del above[level + 1 :]
            item = QTreeWidgetItem(above[level], [page_title(path)])
            item.setData(0, PATH, str(path))
            above.append(item)
        self.tree.expandAll()
        self.tree.currentItemChanged.connect(lambda item, _: self._show(item))
        self.pages.sourceChanged.connect(self._select)
        back = push_button("Back", "The page before.", self.pages.backward)
        self.pages.backwardAvailable.connect(back.setEnabled)
        back.setEnabled(False)
        split = QSplitter()
        split.addWidget(self.tree)
        split.addWidget(self.pages)
        split.setSizes([300, 820])
        self.lay_out(split, back)
        self.pages.show_page(folder / "index.md")

    def _show(self, item: QTreeWidgetItem | None) -> None:
        if item is not None:
            self.pages.show_page(Path(item.data(0, PATH)))

    def _select(self, url: QUrl) -> None:
        path = f"{url.toLocalFile().removesuffix('.md')}.md"  # some links leave the ending out
        how = Qt.MatchFlag.MatchExactly | Qt.MatchFlag.MatchRecursive
        model = self.tree.model()
        places = model.match(model.index(0, 0), PATH, path, 1, how)
        with QSignalBlocker(self.tree):
            self.tree.setCurrentIndex(places[0] if places else QModelIndex())

    def look_for(self, wanted: str) -> None:
        words = wanted.strip().lower()
        self._found = []

        def matches(item: QTreeWidgetItem) -> bool:
            path = Path(item.data(0, PATH))
            there = words in page_text(path).lower()
            if there:
                self._found.append(path)
            return there

        show_matching(self.tree.invisibleRootItem(), matches)
        found = counted(len(self._found), "page") if self._found else "Nothing found"
        self.count.setText(found if words else "")

    def _next(self) -> None:
        """Select the next place of the words; where the page has none, that of the first found."""
        words = self.search.text().strip()
        if not words or self.pages.find(words):
            return
        self.pages.moveCursor(self.pages.textCursor().MoveOperation.Start)
        if self.pages.find(words):
            return
        shown = self.pages.source()
        for path in self._found:
            self.pages.show_page(path)
            if self.pages.find(words):
                return
        self.pages.setSource(shown)
