"""Jobs in the background of the window: checks, previews, reading the cells of sections.

Each has a runner of its own, so that neither it nor a run waits for the other.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

from qtpy.QtCore import QObject, Signal

from slideviz.case.model import Case
from slideviz.design.live_fields import LiveFields
from slideviz.gui.responsiveness.timers import FIELDS_MS, HAND_MS, INTERSECTION_MS, single_shot
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.running import Running
from slideviz.mesh.model import Mesh
from slideviz.sections.model import Section
from slideviz.session import changes, jobs
from slideviz.session.jobs import Job, check_frame
from slideviz.session.panes import shown_views
from slideviz.session.section_cuts import cut_key, is_awaited, keep_slab, read_slab
from slideviz.session.state import CheckedLimits, Preview, Session, StepFrame
from slideviz.session.store import Store
from slideviz.system.platform import free_memory

log = logging.getLogger("slideviz")

READING = "Reading the cells of the section"  # begin of the progress messages of `SectionReader`


class BackgroundJob(QObject):
    """The base of a job that follows the session: `_start` begins it, soon after a change."""

    wait_ms = 0

    def __init__(self, store: Store, parent: QObject | None) -> None:
        super().__init__(parent)
        self.store = store
        self._runner = JobRunner(self)
        self._timer = single_shot(self, self.begin, self.wait_ms)
        self._runner.finished.connect(self._finished)
        self._runner.cancelled.connect(self.schedule)
        self._runner.failed.connect(self._failed)
        store.listen(self._changed)

    @property
    def busy(self) -> bool:
        return self._runner.busy or self._timer.isActive()

    def close(self) -> None:
        self._timer.stop()
        self._runner.close()

    def _changed(self, _old: Session, _new: Session) -> None:
        """Follow a change of the session."""
        self.schedule()

    def schedule(self) -> None:
        """Start the timer, if there is something to do."""
        self._timer.start()

    def begin(self) -> None:
        """Start the job, or later if one runs."""
        if self._runner.busy:
            self._timer.start()
        else:
            self._start()

    def _start(self) -> None:
        """Start the job."""
        raise NotImplementedError

    def _finished(self, found: Any) -> None:
        """Take the result of the job."""
        raise NotImplementedError

    def _failed(self, error: Exception) -> None:
        raise NotImplementedError


class IntersectionCheck(BackgroundJob):
    """Keeps ``Session.intersection`` up to date by a background job."""

    wait_ms = INTERSECTION_MS
    _running_key: tuple[object, ...] = ()
    _checked_key: tuple[object, ...] = ()

    def _changed(self, old: Session, new: Session) -> None:
        if old.mesh is not new.mesh or old.case is not new.case:
            self.store.change(jobs.forget_intersection, self._checked_key)
            self.schedule()

    def schedule(self) -> None:
        session = self.store.session
        if session.mesh is not None and jobs.intersection_key(session) != self._checked_key:
            self._timer.start()

    def _start(self) -> None:
        session = self.store.session
        if session.mesh is not None:
            self._running_key = jobs.intersection_key(session)
            self._runner.start(jobs.find_intersection, session.case, session.mesh)

    def _finished(self, found: tuple[str, str]) -> None:
        self._checked_key = self._running_key
        self.store.change(jobs.set_intersection, found, self._running_key)
        self.schedule()

    def _failed(self, error: Exception) -> None:
        log.error("the intersection check failed: %s", error)
        self._checked_key = self._running_key


class LimitCheck(BackgroundJob):
    """Keeps ``Session.checked`` up to date: the limits of the case on the frame that is shown."""

    wait_ms = INTERSECTION_MS

    def schedule(self) -> None:
        session = self.store.session
        running = session.runs and not session.runs[-1].end
        if session.frame is not None and session.limit_results is None and not running:
            self._timer.start()

    def _start(self) -> None:
        session = self.store.session
        if session.frame is not None and session.mesh is not None:
            self._runner.start(check_frame, session.frame, session.mesh, session.case)

    def _finished(self, checked: CheckedLimits) -> None:
        self.store.change(replace, checked=checked)
        self.schedule()

    def _failed(self, error: Exception) -> None:
        log.error("limits: %s", error)


class LivePreview(BackgroundJob):
    """Shows the mesh while a hand moves its boundaries, and runs the case when the hand rests.

    Live fields are made when the case has come to rest, and dropped where memory is short.
    """

    def __init__(self, store: Store, running: Running, parent: QObject) -> None:
        super().__init__(store, parent)
        self.is_on = False
        self.fields: LiveFields | None = None
        self._running = running
        self._tried: Case | None = None
        self._pulled: Case | None = None  # as the mouse left it, perhaps before there were fields
        self._at_rest = single_shot(self, self._make_fields, FIELDS_MS)
        self._hand = single_shot(self, self._run, HAND_MS)
        running.began.connect(self._spare_memory)

    def switch(self, on: bool) -> None:
        """Begin or end to follow the hand."""
        self.is_on = on
        self.fields = self._tried = None
        self._at_rest.start()
        self.store.change(changes.end_preview)

    def close(self) -> None:
        for timer in (self._at_rest, self._hand):
            timer.stop()
        super().close()

    def _changed(self, old: Session, new: Session) -> None:
        if old.mesh is not new.mesh:
            self.fields = self._tried = None
        elif old.case.motions != new.case.motions and self.fields is not None:
            self._running.cancel_live()
            self._hand.start()
            if new.run_shown is not None and new.run_shown.frames and not new.outdated:
                self.store.change(changes.end_preview)
            else:
                self.begin()
        if old.case is not new.case:
            self._at_rest.start()
            self._pulled = new.case if self.store.dragging else None

    def _spare_memory(self) -> None:
        if self.fields is not None and free_memory() < self.fields.nbytes:
            self.fields = None

    def _make_fields(self) -> None:
        session = self.store.session
        case = session.case
        known = case == self._tried or (self.fields is not None and self.fields.fits(case))
        if not self.is_on or session.mesh is None or session.lacks_cells or known:
            return
        if self._runner.busy:
            self._at_rest.start()
        elif case.method == "rbf" and case.motions:
            self._tried = case
            self._runner.start(jobs.make_live_fields, case, session.mesh)

    def begin(self) -> None:
        self._spare_memory()
        if self.fields is not None and not self._runner.busy:
            session = self.store.session
            done = (run for run in reversed(session.runs) if run.end == "done" and run.frames)
            self._runner.start(jobs.make_preview, self.fields, session.case, next(done, None))

    def _finished(self, found: LiveFields | tuple[LiveFields, Preview | None] | None) -> None:
        if not isinstance(found, tuple):
            # It may have been switched off, or another mesh opened, meanwhile.
            stale = found is not None and found.mesh is not self.store.session.mesh
            self.fields = found if self.is_on and not stale else None
            if self._pulled is self.store.session.case:
                self._hand.start()
                self.begin()
            return
        fields, preview = found
        if self.fields is None or fields.mesh is not self.store.session.mesh:
            return
        if preview is None:
            self.fields = None
            self._at_rest.start()
            return
        self.fields = fields
        if self.store.session.case is not preview.case:
            self.begin()
        self.store.change(changes.show_preview, preview)

    def _run(self) -> None:
        preview = self.store.session.preview
        if preview is None or self.fields is None:
            return
        moving = self.store.dragging or preview.case is not self.store.session.case
        if moving or self._running.runner.busy:
            self._hand.start()
        else:
            self._running.start_run(live=True)

    def _failed(self, error: Exception) -> None:
        log.error("the preview failed: %s", error)
        self.fields = None


class SectionReader(BackgroundJob):
    """Reads the cells that shown sections cut, of a mesh that stays in its file.

    A job whose section has changed is cancelled.
    """

    finished = Signal()
    """The cells of a section have been read."""
    progressed = Signal(str)
    """A message for the status bar."""

    def __init__(self, store: Store, parent: QObject) -> None:
        super().__init__(store, parent)
        self._runner.progressed.connect(lambda doing: self.progressed.emit(doing.text))
        self._running: tuple[Mesh, Section] | None = None
        self._unreadable: set[tuple[Mesh, Section]] = set()

    def _changed(self, _old: Session, new: Session) -> None:
        if new.lacks_cells:
            self._timer.start()

    def _awaited(self) -> list[tuple[StepFrame, Section]]:
        """Return the sections whose cells are still to be read, each with the frame it cuts."""
        return [
            (view.frame, cut_key(section))
            for view in shown_views(self.store.session)
            for section in view.view.sections
            if view.frame is not None
            and section.shown
            and is_awaited(view.frame.mesh, section)
            and (view.frame.mesh, cut_key(section)) not in self._unreadable
        ]

    def begin(self) -> None:
        # The section being read may be dragged on, and its cells no longer wanted.
        wanted = [(frame.mesh, section) for frame, section in self._awaited()]
        if not self._runner.busy:
            self._start()
        elif self._running not in wanted:
            self._runner.cancel()

    def _start(self) -> None:
        for frame, section in self._awaited()[:1]:
            self._running = frame.mesh, section
            self._runner.start(_read_section, frame, section)

    def _finished(self, slab: StepFrame) -> None:
        assert self._running is not None
        keep_slab(*self._running, slab)
        self.progressed.emit("")
        self.finished.emit()
        self._timer.start()

    def _failed(self, error: Exception) -> None:
        assert self._running is not None
        self._unreadable.add(self._running)
        log.error("the section cannot be read: %s", error)
        self.progressed.emit(f"The section cannot be read: {error}")
        self._timer.start()


def _read_section(frame: StepFrame, section: Section, job: Job) -> StepFrame:
    def progress(part: float) -> None:
        job.progress(f"{READING}: {part:.0%}")

    return read_slab(frame, section, progress, job.going_on)
