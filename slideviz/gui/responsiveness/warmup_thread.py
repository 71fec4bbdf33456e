"""Warm-up after the start: shaders compiled below the start page, numerics in a thread."""

from __future__ import annotations

import contextlib
import gc
from threading import Event, Thread
from typing import Any

import pyvista as pv
from qtpy.QtCore import QObject, QTimer, Signal

from slideviz.gui.responsiveness.threads import start_thread
from slideviz.scene.actors import VALUES
from slideviz.scene.stage import Stage
from slideviz.session import jit_warmup
from slideviz.system.jit_cache import compilation_watched


def prepare_drawing(view: Any, stage: Stage) -> None:
    """Draw a face with each combination of lighting and scalars, unseen below the start page.

    OpenGL compiles shaders for each, which takes a tenth of a second and would be felt later.
    """
    face = pv.Plane(i_resolution=1, j_resolution=1)
    face.cell_data[VALUES] = [0.5]
    ways = [(lit, valued) for lit in (True, False) for valued in (False, True)]

    def draw() -> None:
        if not ways or stage.plotter.renderer.actors:
            stage.remove("warm-up")
            return
        lit, valued = ways.pop()
        actor = stage.add(face, "warm-up", lighting=lit)
        actor.mapper.scalar_visibility = valued
        stage.edges(actor.prop, True)
        view.repaint()
        stage.remove("warm-up")
        QTimer.singleShot(0, draw)

    view.spare_software()
    draw()


class WarmupThread(QObject):
    """The daemon thread that runs `slideviz.session.jit_warmup.warm_up` once.

    Signals
    -------
    compiling(bool)
        True when the first compilation begins, False when all are done; not emitted if everything
        was compiled before.
    """

    compiling = Signal(bool)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._stop = Event()
        self._compiles = False
        self._watched = contextlib.ExitStack()
        self.thread_: Thread | None = None

    def watch(self) -> None:
        """Tell of compilation in other threads too, as of a job, until all loops are compiled."""
        self._watched.enter_context(compilation_watched(self._begun))

    def start(self) -> None:
        """Start the thread, unless it was started before."""
        if self.thread_ is None:
            self.thread_ = start_thread(self._run, "slideviz-warm-up")

    def close(self) -> None:
        """Ask the thread to end, without waiting."""
        self._stop.set()
        self._watched.close()
        self.blockSignals(True)

    def _run(self) -> None:
        # Numba's threads are started here, and inherit this thread's low priority.
        try:
            jit_warmup.warm_up(self._begun, self._stop.is_set)
        except RuntimeError:  # the interpreter shuts down, and no thread pool takes work
            if not self._stop.is_set():
                raise
            return
        # The imported modules stay: scanning them would take 100 ms per garbage collection.
        gc.freeze()
        self._watched.close()
        if self._compiles:
            self._tell(False)

    def _begun(self) -> None:
        if not self._compiles:
            self._compiles = True
            self._tell(True)

    def _tell(self, compiling: bool) -> None:
        # The window may be gone by now.
        with contextlib.suppress(RuntimeError):
            self.compiling.emit(compiling)
