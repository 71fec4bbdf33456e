"""The note that a finished streamed run leaves, so that ``--resume`` does not run it again.

It is a hidden file beside the mesh, with the report, and size and time of each file written. It
counts only if these files have not changed since, and case, mesh and version are the same.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from slideviz.errors import Note, SlidevizError
from slideviz.mesh.io.atomic import atomic_write

Folded = Mapping[int, tuple[int, int]]
"""VTK type and first inverted step of the inverted cells with the lowest numbers, by number."""


def note_finished(about: str, files: list[Path], report: dict, folded: Folded) -> None:
    """Write the note of a finished run beside the first of its files, if it can be written.

    ``about`` is the hash of case, mesh and version (`slideviz.deformation.streaming.about_run`).
    """
    note = {
        "about": about,
        "files": _states(files),
        "report": report,
        "harmless": [text for text in report["warnings"] if isinstance(text, Note)],
        "folded": [[cell, *row] for cell, row in folded.items()],
    }
    with suppress(OSError, SlidevizError), atomic_write(_note_of(files[0])) as file:
        file.write(json.dumps(note).encode())


def finished(about: str, files: list[Path]) -> tuple[dict, Folded] | None:
    """Return report and inverted cells of a finished run; None if there is no valid note of it."""
    try:
        note = json.loads(_note_of(files[0]).read_bytes())
        if note["about"] != about or note["files"] != _states(files):
            return None
        report, harmless = note["report"], note["harmless"]
        report["warnings"] = [Note(t) if t in harmless else t for t in report["warnings"]]
        return report, {cell: (vtk, step) for cell, vtk, step in note["folded"]}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _note_of(output: Path) -> Path:
    real = Path(os.path.realpath(output))
    return real.with_name(f".{real.name}.finished")


def _states(files: list[Path]) -> list[list[str | int]]:
    """Return name, size in bytes and time of change of each file."""
    found = [(path.name, path.stat()) for path in files]
    return [[name, state.st_size, state.st_mtime_ns] for name, state in found]
