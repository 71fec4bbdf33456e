"""Timers that call once for many events in quick succession."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import QObject, QTimer


def later(parent: QObject | None, call: Callable[[], object], wait_ms: int = 0) -> QTimer:
    """Return a timer that calls once, ``wait_ms`` after it was last started.

    At 0 ms that is the next turn of the event loop: once for all that happens in this one.
    """
    timer = QTimer(parent)
    timer.setSingleShot(True)
    timer.setInterval(wait_ms)
    timer.timeout.connect(call)
    return timer
