"""The log panel: log messages with their times, including the warnings of libraries."""

from __future__ import annotations

import contextlib
import logging

from qtpy.QtCore import QObject, Qt, Signal
from qtpy.QtWidgets import QPlainTextEdit

from slideviz.gui.widgets.build import fixed_font

LOGGERS = ("slideviz", "py.warnings")
"""The loggers shown: slideviz, with those of Qt and VTK below it, and Python's warnings."""


class _Bridge(QObject):
    wrote = Signal(str)


class LogHandler(logging.Handler):
    """A log handler that passes lines logged in any thread to the GUI thread, by a signal."""

    def __init__(self) -> None:
        super().__init__()
        self.bridge = _Bridge()
        self._last: tuple[int, str] = (0, "")
        self._repeats = 0
        self.setFormatter(logging.Formatter("%(asctime)s  %(levelname)-7s %(message)s", "%H:%M:%S"))

    def emit(self, record: logging.LogRecord) -> None:
        """Emit the line of a log record; a message repeated in a row is only counted."""
        line = self.format(record)
        # A library's warning at every drawing would push all else out of the panel.
        what = self._last
        self._last = (record.levelno, record.getMessage())
        if what == self._last:
            self._repeats += 1
            return
        repeats = self._repeats
        self._repeats = 0
        # A thread may still log when the window, and the signal's object with it, is gone.
        with contextlib.suppress(RuntimeError):
            if repeats:
                self.bridge.wrote.emit(f"          … {repeats} times more")
            self.bridge.wrote.emit(line)


class LogPanel(QPlainTextEdit):
    """The panel with the newest lines of the log."""

    def __init__(self) -> None:
        super().__init__(readOnly=True, maximumBlockCount=2000)
        self.setFont(fixed_font())
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.WidgetWidth)
        self.handler = LogHandler()
        # Queued: Qt's own warnings arrive here, which it may log in the middle of a paint event.
        self.handler.bridge.wrote.connect(self.appendPlainText, Qt.ConnectionType.QueuedConnection)
        logger = logging.getLogger("slideviz")
        for name in LOGGERS:
            logging.getLogger(name).addHandler(self.handler)
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)

    def detach(self) -> None:
        for name in LOGGERS:
            logging.getLogger(name).removeHandler(self.handler)
