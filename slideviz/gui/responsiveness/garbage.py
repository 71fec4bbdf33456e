"""Garbage is looked for in the window's thread, in small portions."""

from __future__ import annotations

import gc
import time

from qtpy.QtCore import QObject, QTimer

from slideviz.gui.responsiveness.settings import GARBAGE_MS, GARBAGE_OBJECTS, GARBAGE_REST_TIMES


class GarbageCollector(QObject):
    """Takes over from Python, which looks for garbage in whatever thread makes many objects.

    That thread keeps the interpreter to itself meanwhile: one that computes, and stands back
    behind the window, for up to 90 ms. Besides, what belongs to Qt and VTK may end in the window's
    thread only.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._timer = QTimer(self)
        self._timer.setInterval(GARBAGE_MS)
        self._timer.timeout.connect(self.look)

    def start(self) -> None:
        """Switch Python's automatic collection off, and collect from this timer instead."""
        gc.disable()
        self._timer.start()

    def end(self) -> None:
        """Leave it to Python again."""
        self._timer.stop()
        gc.enable()

    def look(self) -> None:
        """Look for garbage, if much was made since the last time."""
        if gc.get_count()[0] < GARBAGE_OBJECTS:
            return
        began = time.perf_counter()
        # All of it: what survives is little where the modules are left out (`gc.freeze`), and the
        # longer garbage waits, the longer it takes.
        gc.collect()
        took_ms = 1000.0 * (time.perf_counter() - began)
        self._timer.setInterval(max(GARBAGE_MS, round(GARBAGE_REST_TIMES * took_ms)))
