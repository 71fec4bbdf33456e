"""A progress bar that waits for the next turn of the event loop to be painted."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from qtpy.QtWidgets import QProgressBar


class QuietBar(QProgressBar):
    """Qt's own paints itself at once, with each value.

    Around a view drawn by OpenGL the whole window goes to the screen for that, 10 to 20 ms each
    time where no graphics card does it; with everything else that has changed it does so anyway.
    """

    def setValue(self, value: int) -> None:
        self.setUpdatesEnabled(False)
        super().setValue(value)
        self.setUpdatesEnabled(True)
