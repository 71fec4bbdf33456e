"""Threads of lower priority than the GUI thread, and garbage collection in the GUI thread."""

from __future__ import annotations

import contextlib
import gc
import sys
import time
from collections.abc import Callable
from importlib import import_module
from threading import Event, Thread, get_native_id
from threading import enumerate as enumerate_threads
from typing import Any

import pyvista as pv
from qtpy.QtCore import QCoreApplication, QObject, QTimer, Signal
from threadpoolctl import ThreadpoolController

from slideviz.gui.responsiveness.timers import (
    GARBAGE_MS,
    GARBAGE_OBJECTS,
    GARBAGE_REST_TIMES,
    NICENESS,
    NUMPY_THREADS,
    SWITCH_S,
)
from slideviz.scene.actors import VALUES
from slideviz.scene.stage import Stage
from slideviz.session import jit_warmup
from slideviz.session.jobs import Job
from slideviz.system import platform
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

    view.reduce_effects()
    draw()


class WarmupThread(QObject):
    """The daemon thread that runs `slideviz.session.jit_warmup.warm_up` once."""

    compiling = Signal(bool)
    """True when the first compilation begins, False when all are done; not emitted if everything
    was compiled before."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._stop = Event()
        self._compiles = False
        self._watched = contextlib.ExitStack()
        self.thread_: Thread | None = None

    def watch(self) -> None:
        """Report compilation in other threads like a job, until all loops are compiled."""
        self._watched.enter_context(compilation_watched(self._compilation_begun))

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
            jit_warmup.warm_up(self._compilation_begun, Job(stopped=self._stop.is_set))
        except RuntimeError:  # the interpreter shuts down, and no thread pool takes work
            if not self._stop.is_set():
                raise
            return
        # The imported modules stay: scanning them would take 100 ms per garbage collection.
        gc.freeze()
        self._watched.close()
        if self._compiles:
            self._emit_compiling(False)

    def _compilation_begun(self) -> None:
        if not self._compiles:
            self._compiles = True
            self._emit_compiling(True)

    def _emit_compiling(self, compiling: bool) -> None:
        # The window may be gone by now.
        with contextlib.suppress(RuntimeError):
            self.compiling.emit(compiling)


def import_numerics() -> None:
    """Import the numerics before any thread is started, and lower their threads' priority.

    If NumPy and SciPy have separate BLAS libraries, NumPy's is limited to `NUMPY_THREADS`.
    """
    # Once, here: if two threads (the warm-up and a run) import Numba at the same time, one finds
    # it partly initialized.
    import_module("slideviz.solver.deform")
    lower_library_priority()
    blas = ThreadpoolController().select(user_api="blas").lib_controllers
    numpys = [one for one in blas if "numpy.libs" in one.filepath]
    if len(numpys) < len(blas):
        for one in numpys:
            one.set_num_threads(NUMPY_THREADS)
    # Else threadpoolctl would let this thread alone set threads: limits of runs had no effect.
    for one in blas:
        getattr(one, "clear_controlling_thread", lambda: None)()


def tune_interpreter() -> GarbageCollector:
    """Set thread switching and garbage collection up for a responsive window."""
    # The modules live as long as the window, and need not be searched for garbage.
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)
    collector = GarbageCollector(QCoreApplication.instance())
    collector.start()
    return collector


def start_thread(work: Callable[[], object], name: str, daemon: bool = True) -> Thread:
    """Start a thread of lower priority than the GUI thread, and return it.

    Threads that it starts inherit the priority. It is a daemon by default, so that the program can
    end while a library keeps the thread.
    """

    def run() -> None:
        lower_priority()
        work()

    thread = Thread(target=run, name=name, daemon=daemon)
    thread.start()
    return thread


def lower_priority(thread: int | None = None) -> None:
    """Lower the priority of a thread (default: this one), and of those that it starts.

    Without a graphics card, the GUI thread draws on the processors that compute. Only on Linux.
    ``thread``: its native id (see `threading.get_native_id`).
    """
    platform.lower_priority(get_native_id() if thread is None else thread, NICENESS)


def lower_library_priority() -> None:
    """Lower the priority of the threads that libraries such as BLAS have started. Called once.

    They are recognized by their name: unlike threads of Qt and of the graphics driver, they have
    that of the main thread.
    """
    pythons = {thread.native_id for thread in enumerate_threads()}
    names = platform.thread_names()
    for thread, name in names.items():
        if thread not in pythons and name == names[get_native_id()]:
            lower_priority(thread)


class GarbageCollector(QObject):
    """Collects garbage in the GUI thread, instead of Python's automatic collection in any thread.

    A collection holds the interpreter: in a computing thread of low priority for up to 90 ms.
    Besides, objects of Qt and VTK may be deleted in the GUI thread only.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._timer = QTimer(self, interval=GARBAGE_MS)
        self._timer.timeout.connect(self.collect_if_due)

    def start(self) -> None:
        """Switch Python's automatic collection off, and collect from this timer instead."""
        gc.disable()
        self._timer.start()

    def end(self) -> None:
        """Switch Python's automatic collection on again."""
        self._timer.stop()
        gc.enable()

    def collect_if_due(self) -> None:
        """Collect garbage, if `GARBAGE_OBJECTS` were made since the last time."""
        if gc.get_count()[0] < GARBAGE_OBJECTS:
            return
        began = time.perf_counter()
        # All generations: few objects survive, as the modules are left out (`gc.freeze`), and the
        # more garbage there is, the longer a collection takes.
        gc.collect()
        took_ms = 1000.0 * (time.perf_counter() - began)
        self._timer.setInterval(max(GARBAGE_MS, round(GARBAGE_REST_TIMES * took_ms)))
