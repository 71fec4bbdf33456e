"""Autosave: the session is written without its runs, so that a crash costs some seconds of work.

Each window has a file of its own, ``session-PID-N.slideviz``, and a lock file beside it that is
free when the process has ended, however it did. A session file without a held lock is of a session
that did not end properly. No file is ever deleted unasked: an unreadable one is renamed to
``….broken``.
"""

from __future__ import annotations

import contextlib
import logging
import os
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from functools import partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QLockFile, QObject

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.errors import CaseError
from slideviz.formats.openfoam_paths import shown_name
from slideviz.gui.background import BackgroundJob
from slideviz.gui.responsiveness.timers import AUTOSAVE_MS
from slideviz.gui.widgets.banner import Banner
from slideviz.gui.widgets.error_reporter import old_crashes
from slideviz.session import jobs
from slideviz.session.design_table import DesignTable
from slideviz.session.saving import Camera, as_recovered
from slideviz.session.session_file import (
    ENDING,
    StoredSession,
    read_session,
    stored_session,
    write_session,
)
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.system.cleanup import private_file, private_folder

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow


class SessionRecovery(QObject):
    """Finds the sessions of earlier starts that did not end properly, and offers to restore them.

    ``window``: opens a session. ``banner``: offers the sessions; a banner of its own, so that no
    other message replaces the offer. ``autosave``: saves the restored session from then on.
    """

    def __init__(self, window: MainWindow, banner: Banner, autosave: Autosave) -> None:
        super().__init__(window)
        self.window = window
        self.banner = banner
        self.autosave = autosave
        self.waiting: list[OrphanedSession] = []
        # Their locks are held while this window is open: they are offered at the next start.
        self._later: list[OrphanedSession] = []
        self._trace = ""

    def start(self, crashes: Path | None = None) -> None:
        """Find the sessions to restore, and traces of crashes in a folder; offer the first one."""
        self.waiting, problems = find_sessions(self.autosave.path.parent)
        for path in old_crashes(crashes) if crashes is not None else ():
            log.warning("slideviz crashed; the trace is in %s", path)
            self._trace = path.read_text(encoding="utf-8", errors="replace")
        for problem in problems:
            log.warning("%s", problem)
        if problems:
            self.window.banner.show_message("\n".join(problems), calm=False)
        self._offer()

    def _offer(self) -> None:
        if not self.waiting:
            self.banner.hide()
            return
        session = self.waiting[0]
        more = len(self.waiting) - 1
        path = session.content.source or session.content.mesh_file
        text = (
            f"slideviz did not end properly. Restore the session of {_time_text(session.when)} "
            f"with {shown_name(path)} in {path.parent}?" + (f" ({more} more)" if more else "")
        )
        answers = {"Restore": partial(self.answer, True), "Discard": partial(self.answer, False)}
        self.banner.ask(text, answers, self._trace, later=self._postpone)

    def answer(self, restore: bool) -> None:
        """Start restoring the offered session, or remove its file; then offer the next."""
        session = self.waiting[0]
        if not restore:
            self.waiting.pop(0).remove()
        elif self.window.files.ask_about_unsaved(partial(self.answer, True)):
            self._later.append(self.waiting.pop(0))
            self.window.files.start_opening(session.path, None, partial(self._opened, session))
        self._offer()

    def _postpone(self) -> None:
        self._later += self.waiting
        self.waiting = []

    def _opened(self, found: OrphanedSession, opened: jobs.Opened) -> None:
        session = as_recovered(opened.session, found.content.source)
        self.window.show_opened(replace(opened, session=session))
        self.autosave.replace(found)
        self.window.show_status("Session restored. Runs are not saved; Run computes them again")
        log.info("restored the session of %s", _time_text(found.when))


def _time_text(when: datetime) -> str:
    """Return a time as text, with the date only if it is not today."""
    return f"{when:%H:%M}" if when.date() == datetime.now().date() else f"{when:%Y-%m-%d %H:%M}"


HALF_WRITTEN_S = 60.0  # age in seconds from which a temporary file is not being written any more
_numbers = count(1)
log = logging.getLogger("slideviz")


class Autosave(BackgroundJob):
    """The file with the session of a window: written after changes, removed at a clean end.

    ``folder``: the folder of all windows' session files; made when needed. ``camera``: returns the
    camera of the first view. ``designs``: returns the table of designs, and the case of its
    results.
    """

    wait_ms = AUTOSAVE_MS

    def __init__(
        self,
        store: Store,
        folder: Path,
        camera: Callable[[], Camera | None],
        designs: Callable[[], tuple[DesignTable, Case | None]],
        parent: QObject | None = None,
    ) -> None:
        super().__init__(store, parent)
        self.path = folder / f"session-{os.getpid()}-{next(_numbers)}{ENDING}"
        self._camera = camera
        self._designs = designs
        self._lock: QLockFile | None = None
        self._written_key: object = ()
        self._pending_key: object = ()
        self._replaces: list[OrphanedSession] = []

    def _start(self) -> None:
        session = self.store.session
        if session.mesh is not None and self._key(session) != self._written_key:
            self._pending_key = self._key(session)
            self._runner.start(self._write, session, self._camera(), *self._designs())

    def replace(self, found: OrphanedSession) -> None:
        """Save this session, restored from an earlier one, then remove the earlier one's file."""
        self._replaces.append(found)
        self._written_key = ()
        self.begin()

    def close(self) -> None:
        """Stop writing the session, and remove its file."""
        super().close()
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)
        if self._lock is not None:
            self._lock.unlock()

    def schedule(self) -> None:
        """Write the session soon, if it differs from what was written."""
        session = self.store.session
        # The timer is not restarted by each change: also saved during constant changes.
        differs = session.mesh is not None and self._key(session) != self._written_key
        if differs and not self._timer.isActive():
            self._timer.start()

    def _key(self, session: Session) -> object:
        return session.mesh, session.case, session.view.style, self._designs()

    def _write(
        self,
        session: Session,
        camera: Camera | None,
        designs: DesignTable,
        of: Case | None,
        _job: object,
    ) -> None:
        private_folder(self.path.parent)
        if self._lock is None:
            self._lock = _lock(self.path)
            if self._lock.tryLock(0):
                private_file(Path(self._lock.fileName()))
        write_session(self.path, session, stored_session(session, designs, of), camera)
        private_file(self.path)

    def _finished(self, _: object) -> None:
        self._written_key = self._pending_key
        for found in self._replaces:
            found.remove()
        self._replaces.clear()
        self.schedule()

    def _failed(self, error: Exception) -> None:
        # Tried again at the next change.
        log.warning("the session could not be saved for a restart: %s", error)


@record
class OrphanedSession:
    """A session found in the file of a program that did not end properly."""

    path: Path
    """The session's file."""
    content: StoredSession
    lock: QLockFile
    """Held by this window, so that no other window offers the session too."""

    @property
    def when(self) -> datetime:
        """Return the time at which the session was written."""
        return datetime.fromtimestamp(self.path.stat().st_mtime)

    def remove(self) -> None:
        """Remove the session's files, and release its lock."""
        self.path.unlink(missing_ok=True)
        self.lock.unlock()


def find_sessions(folder: Path) -> tuple[list[OrphanedSession], list[str]]:
    """Return the sessions whose lock is free, newest first, and a sentence per unreadable file.

    The lock of each session returned is held. Unreadable and half-written files are renamed to
    ``….broken``.
    """
    found = []
    problems = []
    for path in sorted(folder.glob(f"session-*{ENDING}"), key=_modified, reverse=True):
        lock = _lock(path)
        if not lock.tryLock(0):
            continue
        try:
            found.append(OrphanedSession(path, read_session(path), lock))
        except CaseError as problem:
            problems.append(_rename_broken(path, str(problem)))
            lock.unlock()
    problems += [
        _rename_broken(path, "it was being written when the program ended")
        for path in folder.glob(".slideviz-*.tmp")
        if time.time() - _modified(path) > HALF_WRITTEN_S
    ]
    return found, problems


def _lock(path: Path) -> QLockFile:
    lock = QLockFile(str(path.with_suffix(".lock")))
    # A lock never expires by its age, only with its process.
    lock.setStaleLockTime(0)
    return lock


def _modified(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _rename_broken(path: Path, why: str) -> str:
    """Rename an unusable file to ``….broken``; return a sentence about it for the user."""
    target = path.with_name(f"{path.name.lstrip('.')}.broken")
    number = count(2)
    while target.exists():
        target = path.with_name(f"{path.name.lstrip('.')}.{next(number)}.broken")
    try:
        path.rename(target)
    except OSError as problem:
        return f"{path}: a saved session cannot be read ({why}), nor renamed ({problem})."
    return f"A saved session cannot be read ({why}); it was kept: {target}."
