"""Long jobs beside the window: one thread, one job at a time, one end for each.

The sender of the signals lives in the window's thread, so that every slot runs there; the job
itself runs in an executor and never touches Qt or VTK. What is reported meanwhile goes through a
mailbox: of `Doing` only the newest is delivered, everything else in full.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Event, Lock
from typing import Any

from qtpy.QtCore import QObject, Qt, Signal

from slideviz.errors import Cancelled
from slideviz.view.jobs import Doing

log = logging.getLogger("slideviz")


class JobRunner(QObject):
    """Runs ``function(*values, report, stopped)`` beside the window.

    Signals
    -------
    doing(Doing)
        The newest news.
    kept(list)
        Everything else that was reported since the last time, in order.
    finished(object), cancelled(), failed(Exception)
        Exactly one of them ends each job, after all that it reported was delivered.
    """

    doing = Signal(object)
    kept = Signal(list)
    finished = Signal(object)
    cancelled = Signal()
    failed = Signal(object)
    _wake = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="slideviz")
        self._lock = Lock()
        self._stop = Event()
        self._news: Doing | None = None
        self._items: list[object] = []
        self._end: tuple[str, Any] | None = None
        self._woken = False
        self.busy = False
        self._wake.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    def start(self, function: Callable[..., Any], *values: Any) -> None:
        """Start a job; there must be none."""
        assert not self.busy, "a job is running"
        self.busy = True
        self._stop = Event()
        self._pool.submit(self._run, self._stop, function, *values)

    def cancel(self) -> None:
        """Ask the job to end; it does within a second, with ``cancelled``."""
        self._stop.set()

    def close(self) -> None:
        """End the job and the thread; nothing is signalled any more."""
        self._stop.set()
        self.blockSignals(True)
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _run(self, stop: Event, function: Callable[..., Any], *values: Any) -> None:
        try:
            end = ("finished", function(*values, self._report, stop.is_set))
        except Cancelled:
            end = ("cancelled", None)
        except Exception as error:
            # Whatever it is, the window must hear of it: a thread swallows it otherwise.
            end = ("failed", error)
        with self._lock:
            self._end = end
            self._call()

    def _report(self, item: object) -> None:
        with self._lock:
            if isinstance(item, Doing):
                self._news = item
            else:
                self._items.append(item)
            self._call()

    def _call(self) -> None:
        if not self._woken:
            self._woken = True
            self._wake.emit()

    def _deliver(self) -> None:
        with self._lock:
            news, self._news = self._news, None
            items, self._items = self._items, []
            end, self._end = self._end, None
            self._woken = False
        if news is not None:
            self.doing.emit(news)
        if items:
            self.kept.emit(items)
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
