"""Read the cells of sections of a mesh that stays in its file, by a job in a thread."""

from __future__ import annotations

import logging
from functools import partial

from qtpy.QtCore import QObject, Signal

from slideviz.gui.responsiveness.timers import later
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.mesh.model import Mesh
from slideviz.sections.model import Section
from slideviz.session.jobs import JobProgress, Report, Stopped, raise_if_cancelled
from slideviz.session.panes import shown_views
from slideviz.session.section_cuts import is_awaited
from slideviz.session.slabs import keep_slab, plain, read_slab
from slideviz.session.state import Session, StepFrame
from slideviz.session.store import Store

log = logging.getLogger("slideviz")

READING = "Reading the cells of the section"
"""Begin of the job's progress messages."""


class SectionReader(QObject):
    """Reads the cells that shown sections cut, by a job; cancels it if its section has changed.

    Signals
    -------
    found()
        The cells of a section have been read.
    said(str)
        A message for the status bar.
    """

    found = Signal()
    said = Signal(str)

    def __init__(self, store: Store, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.store = store
        # A runner of its own: a section need not wait for a run.
        self._runner = JobRunner(self)
        self._timer = later(self, self._look)
        self._runner.finished.connect(self._read)
        self._runner.cancelled.connect(self._timer.start)
        self._runner.failed.connect(self._failed)
        self._runner.doing.connect(lambda doing: self.said.emit(doing.text))
        self._now: tuple[Mesh, Section] | None = None
        self._broken: set[tuple[Mesh, Section]] = set()
        store.listen(lambda _old, new: self._changed(new))

    @property
    def busy(self) -> bool:
        """Return whether a section is being read, or reading is scheduled."""
        return self._runner.busy or self._timer.isActive()

    def close(self) -> None:
        """Stop reading."""
        self._timer.stop()
        self._runner.close()

    def _changed(self, session: Session) -> None:
        if session.in_file:
            self._timer.start()

    def _wanted(self) -> list[tuple[StepFrame, Section]]:
        """Return the sections whose cells are still to be read, each with the frame it cuts."""
        return [
            (view.frame, plain(section))
            for view in shown_views(self.store.session)
            for section in view.view.sections
            if view.frame is not None
            and section.shown
            and is_awaited(view.frame.mesh, section)
            and (view.frame.mesh, plain(section)) not in self._broken
        ]

    def _look(self) -> None:
        wanted = self._wanted() if self.store.session.in_file else []
        if self._runner.busy:
            # The section being read may be dragged on, and its cells no longer wanted.
            if self._now not in [(frame.mesh, section) for frame, section in wanted]:
                self._runner.cancel()
            return
        if wanted:
            frame, section = wanted[0]
            self._now = frame.mesh, section
            self._runner.start(_reading, frame, section)

    def _read(self, slab: StepFrame) -> None:
        assert self._now is not None
        keep_slab(*self._now, slab)
        self.said.emit("")
        self.found.emit()
        self._timer.start()

    def _failed(self, error: Exception) -> None:
        assert self._now is not None
        self._broken.add(self._now)
        log.error("the section cannot be read: %s", error)
        self.said.emit(f"The section cannot be read: {error}")
        self._timer.start()


def _reading(frame: StepFrame, section: Section, report: Report, stopped: Stopped) -> StepFrame:
    def tell(part: float) -> None:
        report(JobProgress(f"{READING}: {part:.0%}"))

    return read_slab(frame, section, tell, partial(raise_if_cancelled, stopped))
