"""Threads beside the window, all of lower priority, and garbage collection."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from threading import Thread, get_native_id
from threading import enumerate as enumerate_threads

from qtpy.QtCore import QCoreApplication, QObject, QTimer
from threadpoolctl import ThreadpoolController

from slideviz.gui.responsiveness.settings import (
    GARBAGE_MS,
    GARBAGE_OBJECTS,
    GARBAGE_REST_TIMES,
    NICENESS,
    NUMPY_THREADS,
    SWITCH_S,
)


def ready_numerics() -> None:
    """Import the numerics before there is another thread, and give their threads low priority."""
    # Here, once: two threads that import Numba at the same time (the warm-up and a run) find it
    # half-made.
    import_module("slideviz.deformation.solver")
    hold_libraries_back()
    blas = ThreadpoolController().select(user_api="blas").lib_controllers
    numpys = [one for one in blas if "numpy.libs" in one.filepath]
    if len(numpys) < len(blas):
        for one in numpys:
            one.set_num_threads(NUMPY_THREADS)


def be_quick() -> GarbageCollector:
    """Set Python up for a window that answers while other threads compute.

    Returns
    -------
    GarbageCollector
        Looks for garbage from now on; it belongs to the application.
    """
    # The modules live as long as the window, and need not be searched for garbage.
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_S)
    collector = GarbageCollector(QCoreApplication.instance())
    collector.start()
    return collector


def start_thread(work: Callable[[], object], name: str, daemon: bool = True) -> Thread:
    """Return a started thread of lower priority than the window, as are those that it starts.

    A daemon: the program must be able to end while a library keeps its thread.
    """

    def run() -> None:
        stand_back()
        work()

    thread = Thread(target=run, name=name, daemon=daemon)
    thread.start()
    return thread


def stand_back(thread: int | None = None) -> None:
    """Lower the priority of a thread (default: this one), and of those that it starts.

    Without a graphics card the picture is drawn by the same processor that computes.

    Parameters
    ----------
    thread : int, optional
        Its number in the system.
    """
    if sys.platform == "linux":  # only there it is for one thread, not for the whole program
        thread = get_native_id() if thread is None else thread
        with contextlib.suppress(OSError):
            before = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, before + NICENESS)


def hold_libraries_back() -> None:
    """Lower the priority of the threads of libraries, BLAS for example.

    They are as many as there are processors, begin when the library is imported, and bear the name
    of the program, unlike those of Qt and of the graphics. Called once.
    """
    tasks = Path("/proc/self/task")
    if not tasks.is_dir():
        return
    pythons = {thread.native_id for thread in enumerate_threads()}
    name = (tasks / str(get_native_id()) / "comm").read_text()
    for task in tasks.iterdir():
        # A thread may have ended meanwhile.
        with contextlib.suppress(OSError):
            if int(task.name) not in pythons and (task / "comm").read_text() == name:
                stand_back(int(task.name))


class GarbageCollector(QObject):
    """The collector of garbage in the window's thread, in place of Python's in any thread.

    That thread keeps the interpreter to itself meanwhile: one that computes, and stands back
    behind the window, for up to 90 ms. Besides, what belongs to Qt and VTK may end in the window's
    thread only.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._timer = QTimer(self)
        self._timer.setInterval(GARBAGE_MS)
        self._timer.timeout.connect(self.look)

    def start(self) -> None:
        """Switch Python's automatic collection off, and collect from this timer instead."""
        gc.disable()
        self._timer.start()

    def end(self) -> None:
        """Switch Python's automatic collection on again."""
        self._timer.stop()
        gc.enable()

    def look(self) -> None:
        """Collect garbage, if much was made since the last time."""
        if gc.get_count()[0] < GARBAGE_OBJECTS:
            return
        began = time.perf_counter()
        # All of it: what survives is little where the modules are left out (`gc.freeze`), and the
        # longer garbage waits, the longer it takes.
        gc.collect()
        took_ms = 1000.0 * (time.perf_counter() - began)
        self._timer.setInterval(max(GARBAGE_MS, round(GARBAGE_REST_TIMES * took_ms)))
