"""The folder of a sweep: ``results.csv``, a row for each design, and ``sweep.json``, its sources.

A row is written as soon as a design is done, so that a stopped sweep can be resumed.
"""

from __future__ import annotations

import errno
import json
import os
import pickle
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from hashlib import blake2b
from itertools import chain
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, SoftFileLock, Timeout

from slideviz import __version__
from slideviz.case.boxes import system_of
from slideviz.case.check import effective
from slideviz.case.key import FILES, VIEW
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.motions.box import box_motions
from slideviz.design.sweeps.columns import Value
from slideviz.design.sweeps.table import (
    WORDS,
    DesignRow,
    Designs,
    cells_of,
    design_columns,
    head_of,
    result_of,
)
from slideviz.errors import CaseError
from slideviz.ffd.section import boxes_of
from slideviz.mesh.model import Mesh
from slideviz.system.atomic import atomic_write, reason_of
from slideviz.system.csv_table import csv_rows, csv_text, write_csv
from slideviz.system.file_checks import read_json, require_regular_file

RESULTS = "results.csv"
SOURCES = "sweep.json"
LOCK = "sweep.lock"
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)  # errors of file systems without locks


class SweepResults:
    """The results of a sweep in a folder, which no other sweep writes to until `close`.

    ``sources``: what the results depend on, as `sources_of` returns it.
    """

    def __init__(self, folder: Path, designs: Designs, sources: Mapping[str, str]) -> None:
        self._folder = folder
        self._designs = designs
        self._sources = sources
        self._lock: BaseFileLock | None = None
        limited = any(design.case.limits for design in designs.rows)
        self._words = ("limits", *WORDS) if limited else WORDS
        self._head = head_of(designs.columns, self._words)

    @property
    def path(self) -> Path:
        """Return the path of the table."""
        return self._folder / RESULTS

    def start(self, *, resume: bool, force: bool, meshes: bool) -> list[DesignRow]:
        """Lock the folder; begin the table, or with ``resume`` return the rows that are done.

        Not among them are designs that failed, and with ``meshes`` those whose mesh is missing.
        Raises CaseError if there are results, with neither ``resume`` nor ``force``; or, to be
        resumed, they are of another case, mesh or table; or the table cannot be written; or another
        sweep writes it.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as problem:
            raise CaseError(
                f"{self._folder}: cannot create this folder: {reason_of(problem)}"
            ) from problem
        self._lock = lock_folder(self._folder)
        try:
            return self._started(resume, force, meshes)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Unlock the folder, and remove the file of the lock."""
        if self._lock is not None and self._lock.is_locked:
            if isinstance(self._lock, FileLock):  # the other one removes its file by itself
                with suppress(OSError):
                    Path(self._lock.lock_file).unlink()
            self._lock.release()

    def _started(self, resume: bool, force: bool, meshes: bool) -> list[DesignRow]:
        """Do what `start` does, in the locked folder."""
        if resume and self.path.exists():
            earlier = {row.design: row for row in self._earlier_rows()}
            return [row for row in earlier.values() if not row.problem and _has_mesh(row, meshes)]
        if self.path.exists() and not force:
            raise CaseError(
                f"{self.path}: there are results already; continue with --resume (resume=True), "
                f"start again with --force (force=True), or choose another folder"
            )
        self._write_head()
        return []

    def _write_head(self) -> None:
        text = json.dumps({"slideviz": __version__, **self._sources}, indent=2) + "\n"
        with atomic_write(self._folder / SOURCES, CaseError) as file:
            file.write(text.encode())
        write_csv(self.path, [self._head], CaseError)

    def _earlier_rows(self) -> list[DesignRow]:
        """Return the rows of the table; CaseError where they are of another sweep.

        A last line that was cut off when the sweep was stopped is removed from the file.
        """
        self._require_same_sources()
        try:
            data = self.path.read_bytes()
            whole = data[: data.rfind(b"\n") + 1]
            if len(whole) < len(data):
                os.truncate(self.path, len(whole))
        except OSError as problem:
            raise CaseError(f"{self.path}: cannot be read: {reason_of(problem)}") from problem
        try:
            head, *lines = csv_rows(whole.decode("utf-8", "replace")) or [[]]
        except ValueError as problem:
            raise CaseError(
                f"{self.path}: is not a table of a sweep ({problem}); {_REMEDY}"
            ) from None
        if head != self._head:
            names = ", ".join(head[design_columns(head)])
            raise CaseError(
                f"{self.path}: has other columns ({names}) than the table of designs "
                f"({', '.join(self._designs.columns)}); {_REMEDY}"
            )
        return [self._row(at, line) for at, line in enumerate(lines, start=2)]

    def add(self, row: DesignRow) -> None:
        """Append a row to the table, by one write.

        Raises CaseError if the table cannot be written.
        """
        try:
            with self.path.open("ab", buffering=0) as file:
                file.write(csv_text([self._cells(row)]).encode())
        except OSError as problem:
            raise CaseError(f"{self.path}: cannot be written: {reason_of(problem)}") from problem

    def sort(self, rows: Iterable[DesignRow]) -> None:
        """Write the table anew, in the order of the designs, each once."""
        last = {row.design: row for row in rows}
        rows_in_order = (self._cells(last[number]) for number in sorted(last))
        write_csv(self.path, [self._head, *rows_in_order], CaseError)

    def _cells(self, row: DesignRow) -> list[object]:
        """Return the cells of a row, each in one line, so that a line cut off is known as such."""
        warnings = tuple(" ".join(text.split()) for text in row.warnings)
        plain = replace(row, problem=" ".join(row.problem.split()), warnings=warnings)
        values = [row.values[name] for name in self._designs.columns]
        return cells_of(row.design, values, plain, self._words, self._folder)

    def _row(self, line: int, cells: Sequence[str]) -> DesignRow:
        """Return the row of a line; CaseError where the design of that number is another."""
        try:
            row = result_of(self._head, cells, self._folder)
        except ValueError:
            raise CaseError(
                f"{self.path}:{line}: is not a row of a sweep; remove the line, or {_REMEDY}"
            ) from None
        rows = self._designs.rows
        values = dict(zip(self._designs.columns, cells[1:], strict=False))
        if not 1 <= row.design <= len(rows):
            raise CaseError(
                f"{self.path}:{line}: has design {row.design}, and the table of designs has "
                f"{len(rows)}; {_REMEDY}"
            )
        for name, value in values.items():
            now = rows[row.design - 1].values[name]
            if not _means_same(value, now):
                raise CaseError(
                    f"{self.path}:{line}: design {row.design} was made with {name}= "
                    f"{value or '(the value of the case)'}, and the table of designs has "
                    f"{now or '(the value of the case)'} now; {_REMEDY}"
                )
        return replace(row, values=rows[row.design - 1].values, earlier=True)

    def _require_same_sources(self) -> None:
        """Raise CaseError where the results in the folder depend on something else."""
        path = self._folder / SOURCES
        try:
            before = read_json(path)
            if not isinstance(before, dict) or not all(isinstance(x, str) for x in before.values()):
                raise ValueError
        except (OSError, ValueError):
            raise CaseError(
                f"{path}: is missing or not readable, so that it is unknown what {self.path} was "
                f"made of; {_REMEDY}"
            ) from None
        before.pop("slideviz", None)
        now = self._sources
        changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
        if not changed:
            return
        message = "; ".join(
            f"{key}= {_short(before.get(key))} before, {_short(now.get(key))} now"
            if key in KEYS
            else f"the {key} changed"
            for key in changed
        )
        raise CaseError(f"{self.path}: was made from other input: {message}; {_REMEDY}")


_REMEDY = "choose another folder, or start again with --force (force=True)"


def lock_folder(folder: Path) -> BaseFileLock:
    """Return the lock of a folder, held: two sweeps would write over each other's results.

    The system frees it however the process ends; where a network's file system has no locks, the
    file itself is the lock, and counts for nothing once its process has ended. Raises CaseError if
    another sweep has the lock, or its file cannot be written.
    """
    path = folder / LOCK
    try:
        with suppress(FileNotFoundError):
            require_regular_file(path, CaseError)
        try:
            lock: BaseFileLock = FileLock(path, thread_local=False, fallback_to_soft=False)
            lock.acquire(blocking=False)
            path.write_text(f"{os.getpid()}\n")
        except OSError as problem:
            if problem.errno not in _NO_LOCKS:
                raise
            if not path.stat().st_size:  # made just now, by the attempt
                path.unlink()
            lock = SoftFileLock(path, thread_local=False)
            lock.acquire(blocking=False)
    except Timeout:
        number = ""
        with suppress(OSError):
            number = path.read_text(errors="replace").partition("\n")[0]
        who = f"process {number}" if number else "another process"
        raise CaseError(
            f"{folder}: another sweep writes its results here ({who}); wait for its end, or "
            "choose another folder"
        ) from None
    except OSError as problem:
        raise CaseError(f"{path}: cannot be written: {reason_of(problem)}") from problem
    return lock


def sources_of(case: Case, mesh: Mesh | None) -> dict[str, str]:
    """Return the digests by name, and keys as text, that the results of a case depend on.

    A mesh that is None stays in its file, which counts by its size and its time of change.
    """
    written = tuple(motion for motion in case.motions if motion.verb)
    plain = effective(case.change(motions=written))
    if mesh is None:
        assert case.mesh_file is not None
        state = case.mesh_file.stat()
        found = {"mesh": f"{state.st_size} bytes, {state.st_mtime_ns}"}
    else:
        parts = [(marker.name.encode(), marker.cells.connectivity) for marker in mesh.markers]
        cells = mesh.cells
        found = {"mesh": _digest(mesh.points, cells.types, cells.connectivity, *chain(*parts))}
    if mesh is not None and box_motions(case):
        boxes = boxes_of(mesh, system_of(case))
        found["FFD_TAG section of the mesh"] = _digest(pickle.dumps(boxes))
    arrays = (motion.content for motion in case.motions if motion.content)
    for at, content in enumerate(arrays, start=1):
        found[f"displacement {at}"] = _digest(*content)
    for path in (path for motion in written for path in motion.files):
        try:
            found[f"file {path.name}"] = _digest(path.read_bytes())
        except OSError:
            found[f"file {path.name}"] = "not readable"
    for key in KEYS.values():
        value = key.get(plain) if key.group not in (FILES, VIEW) else None
        if value is not None and key.name != "DEFORMATION_FILENAME":
            found[key.name] = " ".join(key.kind.write(value).split())
    return found


def _has_mesh(row: DesignRow, meshes: bool) -> bool:
    return not meshes or (row.mesh is not None and row.mesh.is_file())


def _digest(*parts: Any) -> str:
    digest = blake2b(digest_size=16)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _means_same(text: str, value: Value) -> bool:
    """Return whether a cell's text means a value: the same text, or the same number."""
    if text == str(value):
        return True
    try:
        return float(text) == float(value)
    except ValueError:
        return False


def _short(text: str | None) -> str:
    if text is None:
        return "nothing"
    return text if len(text) <= 60 else f"{text[:57]}..."
