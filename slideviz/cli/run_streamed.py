"""``slideviz run --stream``: from file to file, with only the boundary in memory."""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slideviz.cli.run_outcome import (
    CELLS,
    QUALITY_BYTES,
    advice_for,
    report_outcome,
    report_warnings,
    save_report,
    write_qualities,
)
from slideviz.cli.terminal import say
from slideviz.errors import Note, SlidevizError
from slideviz.system.atomic import atomic_write
from slideviz.system.file_checks import read_json

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.terms import FileFormat

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


def require_streamable(
    arguments: argparse.Namespace, case: Case, output: Path, kind: FileFormat | None
) -> None:
    """Raise where ``--stream`` or ``--resume`` is given for a run that cannot be streamed.

    Raises
    ------
    CaseError, MeshError
        An option or the method needs the mesh in memory, or mesh or output are no SU2 meshes.
    """
    if not (arguments.stream or arguments.resume):
        return
    from slideviz.errors import CaseError
    from slideviz.streaming.run import require_stream

    for name in _needing_memory(arguments):
        option = f"--{name.replace('_', '-')}"
        raise CaseError(f"{option} needs the mesh in memory; leave it out, or --stream")
    if not (arguments.output or case.mesh_out or case.mesh_out_format):
        require_stream(case)  # the name of the result is that of the mesh then
    if not _is_su2(output, kind):
        raise CaseError(
            f"{output}: a streamed run writes SU2 meshes; end its name in .su2, or .su2b for the "
            "binary form"
        )
    require_stream(case)


def is_to_be_streamed(
    arguments: argparse.Namespace, case: Case, output: Path, kind: FileFormat | None
) -> bool:
    """Return whether to stream a run: if asked for, or possible and memory is too small for it."""
    from slideviz.streaming.resources import missing_memory

    if arguments.stream:
        return True
    able = _is_su2(output, kind) and not _needing_memory(arguments)
    why = missing_memory(case) if able else ""
    if arguments.resume:
        why = why or "--resume needs a run with --stream"
    if why and not arguments.quiet:
        say("note", f"{why}; it is streamed")
    return bool(why)


def _needing_memory(arguments: argparse.Namespace) -> list[str]:
    return [name for name in ("picture", "steps_dir", "steps_file") if getattr(arguments, name)]


def _is_su2(output: Path, kind: FileFormat | None) -> bool:
    return (kind or output.suffix.lower().removeprefix(".")) in ("su2", "su2b")


def run_streamed(
    arguments: argparse.Namespace,
    case: Case,
    begin: float,
    output: Path,
    qualities: Path | None,
    kind: FileFormat | None,
) -> int:
    """Deform a mesh from file to file, with the same report as ``run``; return the exit code.

    ``begin`` is the time of ``time.perf_counter`` when the command began.
    """
    from slideviz.cli.output_paths import REPLACED
    from slideviz.cli.progress import Bar
    from slideviz.cli.report import LISTED, run_report
    from slideviz.streaming.run import about_run, stream
    from slideviz.system.ranks import SERIAL

    note = partial(say, "" if arguments.quiet else "note")
    about = about_run(case)
    made = [path for path in (output, qualities) if path]
    if arguments.resume and (known := finished(about, made)):
        arguments.begun(REPLACED)
        note(
            f"{output}: the run of this case, mesh and version is finished; there is nothing to do"
        )
        save_report(arguments, known[0])
        return report_warnings(*known, quiet=arguments.quiet)
    with Bar(not arguments.quiet, begun=arguments.begun) as bar:
        done = stream(
            case,
            output,
            file_format=kind,
            tell=bar.phase,
            note=note,
            warn=partial(say, "warning"),
            resume=arguments.resume,
            replaces=case.mesh_file if arguments.force else None,
            listed=LISTED,
            later=QUALITY_BYTES if qualities else 0,
            ranks=arguments.ranks or SERIAL,
        )
    seconds = dict(done.seconds)
    if qualities:
        seconds["write"] -= time.perf_counter()
        write_qualities(qualities, done.quality)
        seconds["write"] += time.perf_counter()
    seconds["total"] = time.perf_counter() - begin
    report = run_report(
        case,
        done.skin,
        done.steps,
        seconds,
        quality=done.quality,
        undeformed=done.undeformed,
        folded=done.folded,
    )
    advice = advice_for(case, done.steps[-1].layers)
    note_finished(about, made, report, done.folded, advice)
    files = {"mesh": output, CELLS: qualities}
    return report_outcome(
        arguments, report, files, done.quality, done.undeformed, done.folded, advice=advice
    )
