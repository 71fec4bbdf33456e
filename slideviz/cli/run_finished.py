"""The note that a finished streamed run leaves, so that ``--resume`` does not run it again.

It is a hidden file beside the mesh, with the report, and size and time of each file written. It
counts only if these files have not changed since, and case, mesh and version are the same.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import Any

from slideviz.errors import Note, SlidevizError
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import read_json

Folded = Mapping[int, tuple[int, int]]
"""VTK type and first inverted step of the inverted cells with the lowest numbers, by number."""


def note_finished(about: str, files: list[Path], report: dict, folded: Folded, advice: str) -> None:
    """Write the note of a finished run beside the first of its files, if it can be written.

    ``about`` is the hash of case, mesh and version (`slideviz.streaming.run.about_run`),
    ``advice`` what may help against inverted cells (`slideviz.cli.run_outcome.advice_for`).
    """
    note: dict[str, Any] = {
        "about": about,
        "files": _states(files),
        "report": report,
        "harmless": [text for text in report["warnings"] if isinstance(text, Note)],
        "folded": [[cell, *row] for cell, row in folded.items()],
        "advice": advice,
    }
    note["digest"] = _digest(note)
    with suppress(OSError, SlidevizError):
        _note_of(files[0]).unlink(missing_ok=True)  # it might be a link to another file
        with atomic_write(_note_of(files[0])) as file:
            file.write(json.dumps(note).encode())


def finished(about: str, files: list[Path]) -> tuple[dict, Folded, str] | None:
    """Return report, inverted cells and advice of a finished run; None without a valid note."""
    try:
        note = read_json(_note_of(files[0]))
        is_whole = note.pop("digest") == _digest(note)
        if not is_whole or note["about"] != about or note["files"] != _states(files):
            return None
        report, harmless = note["report"], note["harmless"]
        report["warnings"] = [Note(t) if t in harmless else t for t in report["warnings"]]
        folded = {cell: (vtk, step) for cell, vtk, step in note["folded"]}
        return report, folded, note["advice"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _digest(note: dict[str, Any]) -> str:
    """Return a digest of a note: one that was changed since it was written does not count."""
    return blake2b(json.dumps(note, sort_keys=True).encode(), digest_size=16).hexdigest()


def _note_of(output: Path) -> Path:
    real = Path(os.path.realpath(output))
    return real.with_name(f".{real.name}.finished")


def _states(files: list[Path]) -> list[list[str | int]]:
    """Return name, size in bytes and time of change of each file."""
    found = [(path.name, path.stat()) for path in files]
    return [[name, state.st_size, state.st_mtime_ns] for name, state in found]
