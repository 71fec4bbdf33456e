"""The manual in the window: the pages of the documentation, from the folder or the package."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import slideviz

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
    found = re.search(r"^# (.+)$", page_text(path), re.MULTILINE)
    return found[1].replace("`", "") if found else path.stem
