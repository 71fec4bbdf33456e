"""The lines of a case file: ``KEY= value``, comments, and lines that go on in the next."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from slideviz.argument_types import frozen
from slideviz.case.words import COMMENT_SIGNS, without_comment
from slideviz.errors import CaseError, Message, shown
from slideviz.system.file_checks import require_length

_END_OF_LINE = re.compile(r"\r\n|\n|\r")
_KEY_LINE = re.compile(r"\s*([A-Za-z][A-Za-z0-9_]*)\s*=(.*)\Z", re.DOTALL)
_LISTED = 30
LARGEST = {
    "case file": 16_000_000,
    "displacement file": 2_000_000_000,
    "surface file": 2_000_000_000,
    "file of sensitivities": 2_000_000_000,
    "table of designs": 100_000_000,
}
"""Most bytes of a file, by its kind: larger ones are not read. Most kinds have a line a node."""


@frozen
class Entry:
    """A key in upper case, its value without comments, and its line (from 1)."""

    key: str
    value: str
    line: int


def read_text(path: Path, what: str) -> tuple[str, tuple[str, ...]]:
    """Return the text of a file, and warnings.

    UTF-8 with or without a byte order mark, UTF-16 with one; anything else is read as Latin-1,
    with a warning. Raises CaseError if it cannot be read, is empty, too large, or not text; the
    message calls it ``what``, one of ``LARGEST``.
    """
    try:
        with suppress(FileNotFoundError):  # reported below
            require_length(path, CaseError, what, LARGEST[what])
        data = path.read_bytes()
    except FileNotFoundError as problem:
        raise CaseError(f"{path}: there is no such {what}; check name and folder") from problem
    except IsADirectoryError as problem:
        raise CaseError(f"{path}: is a folder; expected a {what}") from problem
    except (OSError, ValueError) as problem:  # ValueError: no name of a file
        reason = getattr(problem, "strerror", None) or problem
        raise CaseError(f"{path}: cannot be read: {reason}") from problem
    if not data.strip():
        raise CaseError(f"{path}: the file is empty; expected a {what}")
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    elif b"\0" in data:
        raise CaseError(f"{path}: is a binary file; expected a {what}, which is text")
    else:
        try:
            return data.decode("utf-8-sig"), ()
        except UnicodeDecodeError:
            warning = f"{path}: the file is not UTF-8; it was read as Latin-1"
            return data.decode("latin-1"), (warning,)
    return text, ()


def entries_of(text: str, signs: str = COMMENT_SIGNS) -> tuple[list[Entry], list[Message]]:
    """Return the entries of a case file (comments by ``signs``), and a problem per invalid line."""
    entries: list[Entry] = []
    problems: list[Message] = []
    for line, content in _joined(text, problems, signs):
        match = _KEY_LINE.match(content)
        if match is None:
            problems.append(Message(f"{shown(content.strip())} is not `KEY= value`", line=line))
        else:
            entries.append(Entry(match[1].upper(), match[2].strip(), line))
    return entries, problems


def require_no_mesh(path: Path, entries: list[Entry]) -> None:
    """Raise CaseError where the entries of a file are those of an SU2 mesh."""
    if any(entry.key in ("NDIME", "NZONE") for entry in entries):
        raise CaseError(f"{path}: is an SU2 mesh, not a case file; name it in MESH_FILENAME=")


def _joined(text: str, problems: list[Message], signs: str) -> Iterator[tuple[int, str]]:
    """Yield the number and the content of each line, joined with its continuation lines.

    Comments and empty lines are left out. If a backslash joins a line that has a key to the line
    before, a problem is added to ``problems``.
    """
    start = 0
    parts: list[str] = []
    for line, raw in enumerate(_END_OF_LINE.split(text), start=1):
        content = without_comment(raw, signs).rstrip()
        # A comment between the lines of a long list does not end it; an empty line does.
        if parts and not content.strip() and raw.strip():
            continue
        match = _KEY_LINE.match(content)
        if parts and match is not None:
            rule = f"the backslash at the end of the line before joins {match[1]} to it"
            problems.append(Message(f"{rule}; take the backslash away", line=line))
            yield start, " ".join(parts)
            parts = []
        if not parts:
            start = line
        goes_on = content.endswith("\\")
        parts.append(content[:-1] if goes_on else content)
        if not goes_on:
            if any(part.strip() for part in parts):
                yield start, " ".join(parts)
            parts = []
    if any(part.strip() for part in parts):
        yield start, " ".join(parts)


def listed(path: Path, problems: Iterable[Message]) -> list[Message]:
    """Return the problems of a file by ascending line.

    Line 0 is for a problem that is not in the file, but was given beside it.
    """
    ordered = sorted(problems, key=lambda problem: (problem.line, str(problem)))
    return first_of_many(path, CaseError(*ordered).within(path))


def first_of_many(path: Path, problems: Sequence[Message]) -> list[Message]:
    """Return the first of very many problems of a file, and how many more there are.

    There are very many where it is not a case file at all.
    """
    more = [Message(f"{path}: and {len(problems) - _LISTED} more problems")]
    return [*problems[:_LISTED], *(more if len(problems) > _LISTED else ())]
