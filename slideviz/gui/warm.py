"""Compiles the numerics beside the window, so that the first run need not wait for it."""

from __future__ import annotations

import contextlib
import gc
from threading import Event, Thread

from qtpy.QtCore import QObject, Signal

from slideviz.view import warmup


class WarmUp(QObject):
    """Runs `slideviz.view.warmup.warm_up` once, in a thread that no exit waits for.

    Signals
    -------
    compiling(bool)
        True when compilation began, false when all of it is done; neither when nothing had to be.
    """

    compiling = Signal(bool)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._stop = Event()
        self._told = False
        self.thread_: Thread | None = None

    def start(self) -> None:
        """Start, unless it was started before."""
        if self.thread_ is None:
            self.thread_ = Thread(target=self._run, name="slideviz-warm-up", daemon=True)
            self.thread_.start()

    def close(self) -> None:
        """Ask it to end, without waiting."""
        self._stop.set()
        self.blockSignals(True)

    def _run(self) -> None:
        warmup.warm_up(self._begun, self._stop.is_set)
        # What was imported stays: to look through all of it for garbage takes 100 ms each time.
        gc.freeze()
        if self._told:
            self._tell(False)

    def _begun(self) -> None:
        if not self._told:
            self._told = True
            self._tell(True)

    def _tell(self, compiling: bool) -> None:
        # The window may be gone by now.
        with contextlib.suppress(RuntimeError):
            self.compiling.emit(compiling)
