"""Unexpected errors: shown once, then counted, with details to copy, while the window goes on."""

from __future__ import annotations

import contextlib
import faulthandler
import logging
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QObject, QtMsgType, Signal, qInstallMessageHandler, qVersion
from qtpy.QtWidgets import QApplication
from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

from slideviz.gui.responsiveness.timers import COUNTING_MS, single_shot
from slideviz.system.cleanup import private_file, private_folder
from slideviz.system.platform import is_alive
from slideviz.system.versions import versions as library_versions

if TYPE_CHECKING:
    from slideviz.gui.widgets.banner import Banner

REST_S = 5.0
"""Seconds without an error after which the same error is shown anew rather than counted."""

_LEVELS = {
    QtMsgType.QtDebugMsg: logging.DEBUG,
    QtMsgType.QtInfoMsg: logging.INFO,
    QtMsgType.QtWarningMsg: logging.WARNING,
    QtMsgType.QtCriticalMsg: logging.ERROR,
    QtMsgType.QtFatalMsg: logging.CRITICAL,
}
"""Log levels of Qt's messages."""

log = logging.getLogger("slideviz")


class ErrorReporter(QObject):
    """Receives the unexpected errors of a window: shows each once in its banner, then counts it."""

    _reported = Signal(object)

    def __init__(
        self,
        banner: Banner,
        parent: QObject | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(parent)
        self.count = 0
        """The number of all errors so far."""
        self._banner = banner
        self._clock = clock
        self._known: dict[tuple[object, ...], tuple[int, float]] = {}
        self._shown: tuple[object, ...] = ()
        self._timer = single_shot(self, self._count_again, COUNTING_MS)
        self._reported.connect(self._take)

    def show(self, error: BaseException) -> None:
        """Show an error, from any thread."""
        with contextlib.suppress(RuntimeError):  # the window may be gone
            self._reported.emit(error)

    def _take(self, error: BaseException) -> None:
        self.count += 1
        key = _identity(error)
        now = self._clock()
        times, last = self._known.get(key, (0, float("-inf")))
        fresh = now - last >= REST_S
        self._known[key] = (1 if fresh else times + 1, now)
        if fresh:
            log.error("unexpected", exc_info=error)
            self._shown = key
            self._banner.show_error(error)
        elif key == self._shown and not self._timer.isActive():
            # Later: an error in a paint event would cause a repaint, and thus itself.
            self._timer.start()

    def _count_again(self) -> None:
        self._banner.count(self._known[self._shown][0])


def _identity(error: BaseException) -> tuple[object, ...]:
    """Return what identifies an error: its type, and file and line that raised it.

    Without a trace: its type and its text.
    """
    trace = traceback.extract_tb(error.__traceback__)
    last = (trace[-1].filename, trace[-1].lineno) if trace else (str(error),)
    return (type(error).__name__, *last)


def details_of(error: BaseException) -> str:
    """Return the details of an error for a bug report: trace, versions, platform."""
    trace = "".join(traceback.format_exception(error))
    return f"{trace}\n{versions()}\n"


def versions() -> str:
    """Return the versions of libraries, and the platform, a line for each."""
    return library_versions(f"Qt {qVersion()}")


@contextlib.contextmanager
def caught(reporter: ErrorReporter) -> Iterator[None]:
    """Pass uncaught errors of all threads to ``reporter`` within the context.

    Messages of Qt, VTK and Python's warnings go to the log.
    """
    with ExitStack() as stack:
        stack.callback(setattr, sys, "excepthook", sys.excepthook)
        stack.callback(setattr, threading, "excepthook", threading.excepthook)
        stack.callback(setattr, sys, "unraisablehook", sys.unraisablehook)
        sys.excepthook = lambda _, error, __: _uncaught(reporter, error)
        threading.excepthook = partial(_thread_failed, reporter)
        sys.unraisablehook = lambda what: log.warning("ignored: %r", what.exc_value)
        qInstallMessageHandler(_qt_says)
        stack.callback(qInstallMessageHandler, None)
        stack.enter_context(_vtk_heard())
        logging.captureWarnings(True)
        stack.callback(logging.captureWarnings, False)
        yield


def _thread_failed(reporter: ErrorReporter, what: threading.ExceptHookArgs) -> None:
    if what.exc_value is not None:
        reporter.show(what.exc_value)


def _uncaught(reporter: ErrorReporter, error: BaseException) -> None:
    if isinstance(error, KeyboardInterrupt):
        QApplication.quit()
    else:
        reporter.show(error)


def _qt_says(kind: QtMsgType, _context: object, text: str) -> None:
    logging.getLogger("slideviz.qt").log(_LEVELS.get(kind, logging.WARNING), "Qt: %s", text)


@contextlib.contextmanager
def _vtk_heard() -> Iterator[None]:
    """Put VTK's errors and warnings into the log, instead of the terminal."""
    before = vtkOutputWindow.GetInstance()
    heard = vtkStringOutputWindow()
    logger = logging.getLogger("slideviz.vtk")
    for event, level in (("ErrorEvent", logging.ERROR), ("WarningEvent", logging.WARNING)):

        def says(_window: object, _event: str, text: str, level: int = level) -> None:
            logger.log(level, "VTK: %s", " ".join(text.split()))

        says.CallDataType = "string0"  # type: ignore[attr-defined]
        heard.AddObserver(event, says)  # type: ignore[arg-type]  # a name is taken, too
    vtkOutputWindow.SetInstance(heard)
    # What passes it by is harmless, such as four lines about the sizes of buffers on Wayland.
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_INFO)
        vtkOutputWindow.SetInstance(before)


# Crashes of the whole program ------------------------------------------------------------
@contextlib.contextmanager
def crash_log(folder: Path) -> Iterator[None]:
    """Write the traces of all threads to ``crash-PID.log`` in a folder if the process crashes.

    The file is removed when the context ends.
    """
    path = folder / f"crash-{os.getpid()}.log"
    try:
        private_folder(folder)
        private_file(path)
        file = path.open("w", encoding="utf-8")
    except OSError as problem:
        log.warning("a crash would leave no trace: %s", problem)
        yield
        return
    with file:
        faulthandler.enable(file)
        try:
            yield
        finally:
            faulthandler.disable()
    path.unlink(missing_ok=True)


def old_crashes(folder: Path) -> list[Path]:
    """Return the files of crashes since the last call, newest last, renamed ``crash-DATE-PID.txt``.

    Empty files, of processes that were killed, are removed.
    """
    files = []
    for path in sorted(folder.glob("crash-*.log"), key=lambda path: path.stat().st_mtime):
        if is_alive(path.stem.partition("-")[2]):
            continue
        with contextlib.suppress(OSError):
            if not path.stat().st_size:
                path.unlink()
                continue
            when = datetime.fromtimestamp(path.stat().st_mtime)
            files.append(path.replace(folder / f"crash-{when:%Y%m%d-%H%M%S}-{path.stem[6:]}.txt"))
    return files
