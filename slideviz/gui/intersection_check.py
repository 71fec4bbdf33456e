"""The intersection check: a job in a thread, started after motions or roles have changed."""

from __future__ import annotations

import logging

from qtpy.QtCore import QObject

from slideviz.gui.responsiveness.timers import INTERSECTION_MS, later
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.session import intersections
from slideviz.session.state import Session
from slideviz.session.store import Store

log = logging.getLogger("slideviz")


class IntersectionCheck(QObject):
    """Keeps ``Session.intersection`` up to date by a job; a result stays until the next one."""

    def __init__(self, store: Store, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.store = store
        # A runner of its own: neither a run nor the check waits for the other.
        self._runner = JobRunner(self)
        self._runner.finished.connect(self._found)
        self._runner.cancelled.connect(self._again)
        self._runner.failed.connect(self._failed)
        self._timer = later(self, self._look, INTERSECTION_MS)
        self._asked: tuple[object, ...] = ()
        self._known: tuple[object, ...] = ()
        store.listen(self._changed)

    @property
    def busy(self) -> bool:
        """Return whether a check is running or scheduled."""
        return self._runner.busy or self._timer.isActive()

    def close(self) -> None:
        """Stop checking."""
        self._timer.stop()
        self._runner.close()

    def _changed(self, old: Session, new: Session) -> None:
        if new.mesh is None or (old.mesh is new.mesh and old.case is new.case):
            return
        if intersections.intersection_key(new) != self._known:
            self._timer.start()

    def _look(self) -> None:
        session = self.store.session
        if self._runner.busy:
            self._timer.start()
        elif session.mesh is not None:
            self._asked = intersections.intersection_key(session)
            self._runner.start(intersections.find_intersection, session.case, session.mesh)

    def _found(self, found: tuple[str, str]) -> None:
        self._known = self._asked
        self.store.change(intersections.set_intersection, found, self._asked)
        self._again()

    def _failed(self, error: Exception) -> None:
        log.error("the intersection check failed: %s", error)
        self._known = self._asked

    def _again(self) -> None:
        session = self.store.session
        if session.mesh is not None and intersections.intersection_key(session) != self._known:
            self._timer.start()
