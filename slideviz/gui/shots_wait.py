"""Waits for a window that is photographed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from slideviz.errors import SlidevizError

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow

PATIENCE = 300.0
"""Seconds."""


def wait(until: Callable[[], bool]) -> None:
    """Let the window work until a condition holds.

    Raises
    ------
    SlidevizError
        It does not hold within some minutes.
    """
    from qtpy.QtWidgets import QApplication

    end = time.monotonic() + PATIENCE
    while not until():
        if time.monotonic() > end:
            raise SlidevizError(f"the window did not get ready within {PATIENCE:.0f} s")
        QApplication.processEvents()
        time.sleep(0.01)


def settle(window: MainWindow) -> None:
    """Let the window end what it does, and half a second more for what is drawn later."""
    wait(lambda: not window.runner.busy)
    end = time.monotonic() + 0.5
    wait(lambda: time.monotonic() > end)
