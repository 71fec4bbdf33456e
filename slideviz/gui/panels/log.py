"""The log panel: messages with times, also the warnings of libraries."""

from __future__ import annotations

import contextlib
import logging

from qtpy.QtCore import QObject, Qt, Signal
from qtpy.QtWidgets import QPlainTextEdit

from slideviz.gui.widgets.labels import fixed_font

LOGGERS = ("slideviz", "py.warnings")
"""Whose lines are shown: ours, those of Qt and VTK below it, and Python's warnings."""


class _Bridge(QObject):
    wrote = Signal(str)


class LogHandler(logging.Handler):
    """A log handler that hands lines of any thread to the window's thread."""

    def __init__(self) -> None:
        super().__init__()
        self.bridge = _Bridge()
        self._last: tuple[int, str] = (0, "")
        self._repeats = 0
        self.setFormatter(logging.Formatter("%(asctime)s  %(levelname)-7s %(message)s", "%H:%M:%S"))

    def emit(self, record: logging.LogRecord) -> None:
        """Emit the line of a log record."""
        line = self.format(record)
        # What a library says for every picture it draws would hide everything else.
        what, self._last = self._last, (record.levelno, record.getMessage())
        if what == self._last:
            self._repeats += 1
            return
        repeats, self._repeats = self._repeats, 0
        # The window may be gone when the thread that logs is not yet.
        with contextlib.suppress(RuntimeError):
            if repeats:
                self.bridge.wrote.emit(f"          … {repeats} times more")
            self.bridge.wrote.emit(line)


class LogPanel(QPlainTextEdit):
    """The panel with the newest lines of the log."""

    def __init__(self) -> None:
        super().__init__()
        self.setReadOnly(True)
        self.setMaximumBlockCount(2000)
        self.setFont(fixed_font())
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.WidgetWidth)
        self.handler = LogHandler()
        # In a turn of its own: what Qt complains of in the middle of something comes here too.
        self.handler.bridge.wrote.connect(self.appendPlainText, Qt.ConnectionType.QueuedConnection)
        logger = logging.getLogger("slideviz")
        for name in LOGGERS:
            logging.getLogger(name).addHandler(self.handler)
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)

    def detach(self) -> None:
        """Stop listening to the log."""
        for name in LOGGERS:
            logging.getLogger(name).removeHandler(self.handler)
