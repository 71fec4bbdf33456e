"""Session recovery: a banner offers the sessions that did not end properly, one by one."""

from __future__ import annotations

import logging
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QObject

from slideviz.errors import CaseError
from slideviz.gui.autosave import Autosave, LeftSession, find_sessions
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.widgets.banner import Banner
from slideviz.gui.widgets.error_reporter import old_crashes
from slideviz.session import jobs
from slideviz.session.keep import restored

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow

log = logging.getLogger("slideviz")


class SessionRecovery(QObject):
    """Finds the sessions of earlier starts that did not end properly, and offers to restore them.

    Parameters
    ----------
    window : MainWindow
        Opens a session.
    banner : Banner
        Offers the sessions; a banner of its own, so that no other message replaces the offer.
    autosave : Autosave
        Saves the restored session from then on.
    """

    def __init__(self, window: MainWindow, banner: Banner, autosave: Autosave) -> None:
        super().__init__(window)
        self.window = window
        self.banner = banner
        self.autosave = autosave
        self.waiting: list[LeftSession] = []
        # Their locks are held while this window is open: they are offered at the next start.
        self._later: list[LeftSession] = []
        self._trace = ""

    def look(self, crashes: Path | None = None) -> None:
        """Find the sessions to restore, and traces of crashes in a folder; offer the first one."""
        self.waiting, problems = find_sessions(self.autosave.path.parent)
        for path in old_crashes(crashes) if crashes is not None else ():
            log.warning("slideviz crashed; where it was is in %s", path)
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
        found = self.waiting[0]
        more = len(self.waiting) - 1
        path = found.case.mesh_file if found.source is None else found.source
        text = (
            f"slideviz did not end properly. Restore the session of {_time_text(found.when)} "
            f"with {path.name} in {path.parent}?" + (f" ({more} more)" if more else "")
        )
        answers = {"Restore": partial(self.answer, True), "Discard": partial(self.answer, False)}
        self.banner.ask(text, answers, self._trace, later=self._put_off)

    def answer(self, restore: bool) -> None:
        """Start restoring the offered session, or remove its file; then offer the next."""
        found = self.waiting[0]
        if not restore:
            self.waiting.pop(0).remove()
        elif self.window.files.ask_about_unsaved(partial(self.answer, True)):
            self._later.append(self.waiting.pop(0))
            done = partial(self._opened, found)
            name = found.case.mesh_file.name
            self.window.running.start_job(
                f"Restoring {name}", done, jobs.open_file, found.path, None
            )
        self._offer()

    def _put_off(self) -> None:
        self._later += self.waiting
        self.waiting = []

    def _opened(self, found: LeftSession, opened: jobs.Opened) -> None:
        session = restored(opened.session, found.source)
        self.window.show_opened(replace(opened, session=session))
        self._restore_designs(found)
        self.autosave.replace(found)
        self.window.say("Session restored. Runs are not kept; Run computes them again")

    def _restore_designs(self, found: LeftSession) -> None:
        """Show the restored table of designs, or the error of its file.

        Its results count as those of the session's case only if the file says so.
        """
        panel, session = self.window.dock_manager.panel(DesignsPanel), self.window.store.session
        try:
            table, current = found.designs()
        except CaseError as error:
            self.window.banner.show_error(error)
            return
        panel.case, panel.mesh = session.case if current else None, session.mesh
        panel.put(table)
        log.info("restored the session of %s", _time_text(found.when))


def _time_text(when: datetime) -> str:
    """Return a time as text, with the date only if it is not today."""
    return f"{when:%H:%M}" if when.date() == datetime.now().date() else f"{when:%Y-%m-%d %H:%M}"
