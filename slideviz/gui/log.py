"""The log panel: what happened, with times; also what libraries complain about."""

from __future__ import annotations

import contextlib
import logging

from qtpy.QtCore import QObject, Signal
from qtpy.QtGui import QFontDatabase
from qtpy.QtWidgets import QPlainTextEdit


class _Bridge(QObject):
    wrote = Signal(str)


class LogHandler(logging.Handler):
    """Hands log lines of any thread to the window's thread."""

    def __init__(self) -> None:
        super().__init__()
        self.bridge = _Bridge()
        self.setFormatter(logging.Formatter("%(asctime)s  %(levelname)-7s %(message)s", "%H:%M:%S"))

    def emit(self, record: logging.LogRecord) -> None:
        """Pass one line on."""
        # The window may be gone when the thread that logs is not yet.
        with contextlib.suppress(RuntimeError):
            self.bridge.wrote.emit(self.format(record))


class LogPanel(QPlainTextEdit):
    """Shows the newest lines of the log."""

    def __init__(self, parent=None) -> None:
        super().__init__(parent)
        self.setReadOnly(True)
        self.setMaximumBlockCount(2000)
        self.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.handler = LogHandler()
        self.handler.bridge.wrote.connect(self.appendPlainText)
        logger = logging.getLogger("slideviz")
        logger.addHandler(self.handler)
        if logger.level == logging.NOTSET:
            logger.setLevel(logging.INFO)

    def detach(self) -> None:
        """Stop listening to the log."""
        logging.getLogger("slideviz").removeHandler(self.handler)
