"""Run a generator's work in pieces: in the event loop if it draws, else in a thread."""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any

from qtpy.QtCore import QObject, Signal

from slideviz.gui.responsiveness.settings import TURN_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.session.jobs import raise_if_cancelled
from slideviz.session.pieces import InThread


class PieceRunner(QObject):
    """Advances a generator (see `slideviz.session.pieces`) by one piece per turn of the event loop.

    A piece that it yields as a `InThread` is run in a thread first, and its result sent back.

    Signals
    -------
    came(object)
        A value that the generator yielded, if neither None nor a `InThread`.
    done(object)
        The generator's return value. Nothing is emitted for one that was stopped.
    failed(Exception)
        The error that it raised.
    """

    came = Signal(object)
    done = Signal(object)
    failed = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pieces: Generator[object, Any, Any] | None = None
        self._runner = self._make_runner()
        self._timer = later(self, lambda: self._go_on(next), TURN_MS)

    def _make_runner(self) -> JobRunner:
        runner = JobRunner(self)
        runner.finished.connect(lambda value: self._go_on(lambda pieces: pieces.send(value)))
        runner.failed.connect(lambda error: self._go_on(lambda pieces: pieces.throw(error)))
        return runner

    @property
    def busy(self) -> bool:
        """Return whether a generator is being run."""
        return self._pieces is not None

    def start(self, pieces: Generator[object, Any, Any]) -> None:
        """Run a generator; stop the one before, if it still runs."""
        self.stop()
        self._pieces = pieces
        self._timer.start()

    def stop(self) -> None:
        """Stop and close the generator, which can then clean up in its ``finally``."""
        self._timer.stop()
        if self._runner.busy:
            self._runner.close()
            self._runner.deleteLater()
            self._runner = self._make_runner()
        pieces, self._pieces = self._pieces, None
        if pieces is not None:
            pieces.close()

    def _go_on(self, step: Callable[[Generator[object, Any, Any]], object]) -> None:
        assert self._pieces is not None
        try:
            piece = step(self._pieces)
        except StopIteration as end:
            self._pieces = None
            self.done.emit(end.value)
        except Exception as error:
            # Any error: otherwise the signal `failed` would never come.
            self._pieces = None
            self.failed.emit(error)
        else:
            if isinstance(piece, InThread):
                self._runner.start(_call, piece)
                return
            self._timer.start()
            if piece is not None:
                self.came.emit(piece)


def raise_again(error: Exception) -> None:
    """Raise an error: a slot for `failed` that passes it to the window's handler of exceptions."""
    raise error


def _call(piece: InThread, _report: object, stopped: Callable[[], bool]) -> Any:
    return piece.call(partial(raise_if_cancelled, stopped))
