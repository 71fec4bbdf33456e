"""The jobs of a window: one at a time, with messages about their progress and end."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from qtpy.QtCore import QObject, Signal

from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.widgets.banner import Banner
from slideviz.session import changes, jobs
from slideviz.session.jobs import compute_streamed
from slideviz.session.run_messages import (
    limits_words,
    preview_words,
    remarks_of,
    repair_words,
    run_requirements,
    stopped_words,
    to_mend,
    with_field_labels,
)
from slideviz.session.runs_words import method_words
from slideviz.session.state import Run, StepFrame, result_settings
from slideviz.session.store import Store
from slideviz.session.walls_table import heights_words
from slideviz.terms import PERIODIC_MODES

log = logging.getLogger("slideviz")


class Running(QObject):
    """Starts the jobs and runs of a window, and passes their steps and ends to the session."""

    began = Signal(str)
    progressed = Signal(object)  # JobProgress
    ended = Signal()
    """`began`, `progressed`, `ended`: a job has started, with its name; reports progress; has
    ended, in whatever way."""
    cancelling = Signal()
    """The running job was asked to stop."""
    status_changed = Signal(str)
    """A message for the status bar."""

    def __init__(self, store: Store, banner: Banner, parent: QObject) -> None:
        super().__init__(parent)
        self.store = store
        self.banner = banner
        self.runner = JobRunner(self)
        self._finish: Callable[[Any], object] | None = None
        self._next: Callable[[], object] | None = None
        self._deforms = self._shows_design = False
        self.runner.progressed.connect(self.progressed)
        self.runner.progressed.connect(lambda doing: self.status_changed.emit(doing.text))
        self.runner.yielded.connect(lambda frames: store.change(changes.add_frames, frames))
        self.runner.finished.connect(self._finished)
        self.runner.cancelled.connect(self._cancelled)
        self.runner.failed.connect(self._failed)

    def start_job(
        self,
        text: str,
        finish: Callable[[Any], object],
        function: Callable[..., Any],
        *values: object,
    ) -> None:
        """Start a job, shown as ``text``; ``finish`` is called with its result.

        If a job is running, it is cancelled first, and the new one starts when it has ended.
        """
        if self.runner.busy:
            self._next = partial(self.start_job, text, finish, function, *values)
            self.cancel()
            return
        self._finish = finish
        self.runner.start(function, *values)
        self.began.emit(text)
        self.status_changed.emit(text)

    def start_run(self, output: Path | None = None, live: bool = False) -> None:
        """Start a run of the session's case, if nothing is missing for it.

        ``output`` is the file of the deformed mesh, needed if the mesh stays in its file. ``live``:
        whether the hand rests that moves the boundaries.
        """
        if not self.runner.busy and not run_requirements(self.store.session):
            self._start_run(self.store.session.case, output=output, live=live)

    def cancel_live(self) -> None:
        """Cancel the run that began because the hand rested, if it goes on."""
        if self._deforms and self.store.session.runs[-1].live:
            self.cancel()

    def repair(self) -> None:
        """Mend the last step of the run that is shown, or the mesh, as a new run."""
        session = self.store.session
        frame = to_mend(session)
        run = session.run_shown
        if self.runner.busy or frame is None:
            return
        settings = {"repair": "yes", "repair_steps": False}
        ran = run is not None and frame is run.last
        case = (run.case if ran and run is not None else session.case).change(**settings)
        frames = run.frames if ran and run is not None else (frame,)
        if not ran or not session.outdated:
            self.store.change(changes.set_case, **settings)
        self._show_started(case)
        log.info("repair")
        case = session.with_chosen_roles(case)
        self.start_job("Repairing", self._run_done, jobs.repair, case, session.mesh, frames)

    def show_design(self, case: Case, name: str) -> bool:
        """Show the run of a design, started first unless there is one already, done or going on.

        The run of another design is cancelled. Return False if a job of another kind is running.
        """
        wanted = result_settings(case)
        for run in self.store.session.runs:
            known = run.panels is not None and result_settings(run.case) == wanted
            known = known and not (run.last is not None and run.last.label)
            if known and (run.end == "done" or (not run.end and self._next is None)):
                self.store.change(changes.show_design, run.number, name)
                return True
        if self.runner.busy:
            if self._shows_design:
                self._next = partial(self.show_design, case, name)
                self.cancel()
            return self._shows_design
        self._shows_design = True
        self._start_run(case, name)
        return True

    def show_designs(self, case: Case, cases: Mapping[int, Case]) -> None:
        """Start the run whose steps are designs, by number; ``case`` is that of their table."""
        self._show_started(case, "designs")
        session = self.store.session
        said = f"The steps of run {session.shown} are the designs"
        done = partial(self.status_changed.emit, said)
        whole = {number: session.with_chosen_roles(one) for number, one in cases.items()}
        self.start_job("Starting", lambda _: done(), jobs.compute_designs, whole, session.mesh)

    def _show_started(self, case: Case, name: str = "", live: bool = False) -> None:
        """Show a new run, without steps yet."""
        self.banner.hide()
        self.store.change(changes.start_run, case, name, live)
        if self.store.session.view.color_by == "role":
            self.store.change(changes.set_view, color_by="size-skew")
        self._deforms = True

    def _start_run(
        self, case: Case, name: str = "", output: Path | None = None, live: bool = False
    ) -> None:
        self._show_started(case, name, live)
        session = self.store.session
        periodic = PERIODIC_MODES[case.periodic].name
        steps = case.steps or "automatic"
        words = "1 step" if steps == 1 else f"{steps} steps"
        log.info("run: %s, %s, %s", method_words(case), periodic, words)
        case = session.with_chosen_roles(case)
        if session.lacks_cells:
            call = self._run_done, compute_streamed, case, session.first, output
            self.start_job("Starting", *call)
            return
        self.start_job("Starting", self._run_done, jobs.compute, case, session.mesh)

    def cancel(self, follow: Callable[[], object] | None = None) -> None:
        """Ask the running job to stop; ``follow`` is called when it has ended."""
        if self.runner.busy:
            self._next = follow or self._next
            self.cancelling.emit()
            self.runner.cancel()

    def close(self) -> bool:
        """End the job without a signal; return whether its thread has ended."""
        self._next = None
        return self.runner.close()

    def _end(self, how: str) -> None:
        self._finish = None
        self._shows_design = False
        if self._deforms:
            self._deforms = False
            self.store.change(changes.end_run, how)
        self.ended.emit()

    def _start_next(self) -> None:
        follow = self._next
        self._next = None
        if follow is not None:
            follow()

    def _finished(self, value: Any) -> None:
        finish = self._finish
        self._end("done")
        self._start_next()
        if finish is not None:
            finish(value)

    def _cancelled(self) -> None:
        last = self.store.session.runs[-1] if self._deforms else None
        if last is not None:
            self._log_remarks(last)
        self._end("cancelled")
        run = None if last is None else self.store.session.run(last.number)
        words = stopped_words(run)
        log.info("cancelled%s", f": {words}" if words else "")
        self.status_changed.emit(words or "Cancelled")
        self._start_next()

    @staticmethod
    def _log_remarks(run: Run) -> None:
        """Write the notes and warnings of a run to the log."""
        for note in remarks_of(run, "note"):
            log.info("%s", note)
        for warning in remarks_of(run, "warning"):
            log.warning("%s", warning)

    def _failed(self, error: Exception) -> None:
        if self._deforms and isinstance(error, SlidevizError):
            # The message names keys of a case file: say it in the words of the window.
            error = type(error)(with_field_labels(str(error)))
        self.banner.show_error(error)
        log.error("%s", error)
        self.status_changed.emit("")
        self._end("failed")
        self._start_next()

    def _run_done(self, _: Any) -> None:
        """Show the result of a finished run, and write it to the log, with its warnings."""
        run = self.store.session.runs[-1]
        if run.last is None:
            return
        quality = run.last.quality
        file = run.last.file
        if file is not None:
            self.store.change(changes.saved_mesh)
        text = (
            f"{_steps_text(run.last)}min {quality.min:.4f}, mean {quality.mean:.4f}, "
            f"{quality.inverted:,} inverted"
        )
        if heights := heights_words(run.last, run.case):
            text += f", first heights {heights} of those before"
        if missed := limits_words(run):
            text += f", {missed}"
        if words := repair_words(run):
            text += f", {words}"
        if words := preview_words(run):
            text += f"; {words}"
        log.info("done: %s", text)
        self._log_remarks(run)
        if file is not None:
            log.info("the deformed mesh is in %s", file)
        self.status_changed.emit(f"Done: {text}")


def _steps_text(frame: StepFrame) -> str:
    """Return the number of steps of an automatic run, and those it tried; else an empty text."""
    if frame.step is None or not frame.step.tried:
        return ""
    count = frame.step.total
    tried = ", ".join(str(trial.steps) for trial in frame.step.tried)
    return f"{count} step{'s' if count > 1 else ''} (automatic, tried {tried}); "
