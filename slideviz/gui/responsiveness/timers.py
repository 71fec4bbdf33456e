"""Single-shot timers that merge many events in quick succession into one call."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import QObject, QTimer


def later(parent: QObject | None, call: Callable[[], object], wait_ms: int = 0) -> QTimer:
    """Return a single-shot timer that calls ``call``, ``wait_ms`` after it was last started.

    At 0 ms it calls in the next turn of the event loop, once for all starts in this one.
    """
    timer = QTimer(parent)
    timer.setSingleShot(True)
    timer.setInterval(wait_ms)
    timer.timeout.connect(call)
    return timer
