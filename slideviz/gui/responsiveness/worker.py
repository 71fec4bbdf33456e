"""Run long jobs in a thread, one at a time, each ending with exactly one signal.

The object with the signals lives in the GUI thread, so that every slot runs there; the job itself
runs in its thread and never uses Qt or VTK. Its reports go through a mailbox: only the newest
`JobProgress` is delivered, everything else in full.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Generator
from functools import partial
from threading import Event, Lock, Thread
from typing import Any

from qtpy.QtCore import QObject, Qt, QTimer, Signal

from slideviz.errors import Cancelled
from slideviz.gui.responsiveness.threads import start_thread
from slideviz.gui.responsiveness.timers import CLOSING_S, NEWS_S, TURN_MS, single_shot
from slideviz.session.jobs import Job, JobProgress
from slideviz.session.pieces import InThread


class PieceRunner(QObject):
    """Advances a generator (see `slideviz.session.pieces`) by one piece per turn of the event loop.

    A piece that it yields as a `InThread` is run in a thread first, and its result sent back.
    """

    yielded = Signal(object)
    """A value that the generator yielded, if neither None nor a `InThread`."""
    done = Signal(object)
    """The generator's return value. Nothing is emitted for one that was stopped."""
    failed = Signal(object)  # Exception
    """The error that it raised."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pieces: Generator[object, Any, Any] | None = None
        self._runner = self._make_runner()
        self._timer = single_shot(self, lambda: self._advance(next), TURN_MS)

    def _make_runner(self) -> JobRunner:
        runner = JobRunner(self)
        runner.finished.connect(lambda value: self._advance(lambda pieces: pieces.send(value)))
        runner.failed.connect(lambda error: self._advance(lambda pieces: pieces.throw(error)))
        return runner

    @property
    def busy(self) -> bool:
        return self._pieces is not None

    def start(self, pieces: Generator[object, Any, Any]) -> None:
        """Run a generator; stop the one before, if it still runs."""
        self.stop()
        self._pieces = pieces
        self._timer.start()

    def stop(self) -> None:
        """Stop and close the generator, which can then clean up in its ``finally``."""
        self._timer.stop()
        if self._runner.busy:
            self._runner.close()
            self._runner.deleteLater()
            self._runner = self._make_runner()
        pieces = self._pieces
        self._pieces = None
        if pieces is not None:
            pieces.close()

    def _advance(self, step: Callable[[Generator[object, Any, Any]], object]) -> None:
        assert self._pieces is not None
        try:
            piece = step(self._pieces)
        except StopIteration as end:
            self._pieces = None
            self.done.emit(end.value)
        except Exception as error:
            # Any error: otherwise the signal `failed` would never come.
            self._pieces = None
            self.failed.emit(error)
        else:
            if isinstance(piece, InThread):
                self._runner.start(_call, piece)
                return
            self._timer.start()
            if piece is not None:
                self.yielded.emit(piece)


def reraise(error: Exception) -> None:
    """Raise an error: a slot for `failed` that passes it to the window's handler of exceptions."""
    raise error


def _call(piece: InThread, job: Job) -> Any:
    return piece.call(job.going_on)


log = logging.getLogger("slideviz")


class JobRunner(QObject):
    """Runs jobs, ``function(*values, job)``, in a thread, one at a time.

    Its `Job` reports for the signals, and is stopped after `cancel`.
    """

    progressed = Signal(object)  # JobProgress
    """The newest progress that the job reported."""
    yielded = Signal(list)
    """All other items reported since the last emission, in order."""
    finished = Signal(object)
    cancelled = Signal()
    failed = Signal(object)  # Exception
    """`finished`, `cancelled`, `failed`: the job returned a value; raised `Cancelled`; raised
    another error. Exactly one is emitted per job, after all its reports."""
    _wake = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._thread: Thread | None = None
        self._lock = Lock()
        self._stop = Event()
        self._news: JobProgress | None = None
        self._delivered_s = float("-inf")
        self._items: list[object] = []
        self._end: tuple[str, Any] | None = None
        self._woken = False
        self._closed = False
        self.busy = False
        self._wake.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    @property
    def alive(self) -> bool:
        """Return whether the thread of the last job is alive, even after `close`."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, function: Callable[..., Any], *values: Any) -> None:
        """Start a job in a new thread; none may be running."""
        assert not self.busy, "a job is running"
        self.busy = True
        self._stop = Event()
        work = partial(self._run, self._stop, function, *values)
        self._thread = start_thread(work, "slideviz")

    def cancel(self) -> None:
        """Ask the job to stop, which it does within a second, with ``cancelled``."""
        self._stop.set()

    def close(self) -> bool:
        """Stop the job without a signal, wait `CLOSING_S`; return whether its thread has ended."""
        self._stop.set()
        self._closed = True
        self.blockSignals(True)
        if self._thread is not None:
            self._thread.join(CLOSING_S)
        return not self.alive

    def _run(self, stop: Event, function: Callable[..., Any], *values: Any) -> None:
        try:
            end = ("finished", function(*values, Job(self._report, stop.is_set)))
        except Cancelled:
            end = ("cancelled", None)
        except Exception as error:
            # Any error: it is passed on to the GUI thread.
            end = ("failed", error)
        with self._lock:
            self._end = end
            self._call()

    def _report(self, item: object) -> None:
        with self._lock:
            if isinstance(item, JobProgress):
                self._news = item
            else:
                self._items.append(item)
            self._call()

    def _call(self) -> None:
        # The window may be deleted before its job has ended.
        with contextlib.suppress(RuntimeError):
            if not self._woken and not self._closed:
                self._woken = True
                self._wake.emit()

    def _deliver(self) -> None:
        """Emit the reports of the job, and its end, in the GUI thread; progress is delayed."""
        if self._closed:
            return
        wait = self._delivered_s + NEWS_S - time.monotonic()
        with self._lock:
            if wait > 0 and self._end is None and not self._items:
                QTimer.singleShot(round(1000 * wait) + 1, self._deliver)
                return
            news = self._news
            self._news = None
            items = self._items
            self._items = []
            end = self._end
            self._end = None
            self._woken = False
        if news is not None:
            self._delivered_s = time.monotonic()
            self.progressed.emit(news)
        if items:
            self.yielded.emit(items)
        if end is None:
            return
        self.busy = False
        name, value = end
        if name == "finished":
            self.finished.emit(value)
        elif name == "cancelled":
            self.cancelled.emit()
        else:
            log.debug("a job failed", exc_info=value)
            self.failed.emit(value)
