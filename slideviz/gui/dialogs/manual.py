"""The manual in the window: the pages of the documentation, with a search."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from qtpy.QtCore import QModelIndex, QSignalBlocker, QSize, Qt, QUrl
from qtpy.QtGui import QImage, QTextCursor, QTextDocument
from qtpy.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QLineEdit,
    QSplitter,
    QTextBrowser,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)

import slideviz
from slideviz.gui.widgets.build import dialog_buttons, hint_label, in_column, in_row, push_button

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
        from slideviz.case.cfg import describe_keys

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
        super().__init__()
        self.setOpenExternalLinks(True)
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
        """Show a page."""
        self.setSource(QUrl.fromLocalFile(str(path)))


class ManualDialog(QDialog):
    """The dialog with a list of the manual's pages, a page, and a search in all of them."""

    def __init__(self, parent: QWidget, folder: Path) -> None:
        super().__init__(parent)
        self.setWindowTitle("Manual")
        self.resize(QSize(1120, 760).boundedTo(parent.screen().availableSize()))
        self.pages = Pages()
        self.search = QLineEdit()
        self.search.setPlaceholderText("Find pages with these words (Enter: the next place)")
        self.search.setClearButtonEnabled(True)
        self.count = hint_label()
        self.count.setWordWrap(False)
        self._found: list[Path] = []
        self.search.textChanged.connect(self._filter)
        self.search.returnPressed.connect(self._next)
        self.tree = QTreeWidget()
        self.tree.setHeaderHidden(True)
        self.tree.setIndentation(14)
        self._fill(folder)
        self.tree.currentItemChanged.connect(lambda item, _: self._show(item))
        self.pages.sourceChanged.connect(self._select)
        back = push_button("Back", "The page before.", self.pages.backward)
        self.pages.backwardAvailable.connect(back.setEnabled)
        back.setEnabled(False)
        split = QSplitter()
        split.addWidget(self.tree)
        split.addWidget(self.pages)
        split.setSizes([300, 820])
        buttons = dialog_buttons(self, QDialogButtonBox.StandardButton.Close)
        for button in (back, buttons.button(QDialogButtonBox.StandardButton.Close)):
            button.setAutoDefault(False)  # Enter belongs to the search
        head = in_row(self.search, self.count, back, wide=[self.search])
        self.setLayout(in_column(head, split, buttons, wide=[split]))
        self.pages.show_page(folder / "index.md")
        self.search.setFocus()

    def _fill(self, folder: Path) -> None:
        above: list[QTreeWidget | QTreeWidgetItem] = [self.tree]
        for level, path in manual_pages(folder):
            del above[level + 1 :]
            item = QTreeWidgetItem(above[level], [page_title(path)])
            item.setData(0, PATH, str(path))
            above.append(item)
        self.tree.expandAll()

    def _show(self, item: QTreeWidgetItem | None) -> None:
        if item is not None:
            self.pages.show_page(Path(item.data(0, PATH)))

    def _select(self, url: QUrl) -> None:
        """Select the page that is shown, which a link or “Back” may have led to."""
        path = f"{url.toLocalFile().removesuffix('.md')}.md"  # some links leave the ending out
        items = (one for section in self._items() for one in (section, *self._items(section)))
        places = (self.tree.indexFromItem(one) for one in items if one.data(0, PATH) == path)
        with QSignalBlocker(self.tree):
            self.tree.setCurrentIndex(next(places, QModelIndex()))

    def _items(self, item: QTreeWidgetItem | None = None) -> list[QTreeWidgetItem]:
        top = item or self.tree.invisibleRootItem()
        children = (top.child(k) for k in range(top.childCount()))
        return [child for child in children if child is not None]

    def _filter(self, words: str) -> None:
        """Show the pages whose text has the words, below their sections, and their number."""
        words = words.strip().lower()
        self._found = []
        for section in self._items():
            pages = (section, *self._items(section))
            paths = [Path(one.data(0, PATH)) for one in pages]
            matches = [words in page_text(path).lower() for path in paths]
            for one, there in zip(pages, matches, strict=True):
                one.setHidden(not there)
            section.setHidden(not any(matches))
            self._found += [path for path, there in zip(paths, matches, strict=True) if there]
        pages_found = "1 page" if len(self._found) == 1 else f"{len(self._found)} pages"
        self.count.setText((pages_found if self._found else "Nothing found") if words else "")

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
