"""The window with 240,000 hexahedra: how long it does not answer, frames a second, memory.

``extra_info`` has, in milliseconds, the worst time between two ticks of a timer that should tick
every 10 ms (``worst_gap_ms``), and the gap that one tick in a hundred exceeds. Drawing is by
software under Xvfb, on the same cores that compute.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import time
from pathlib import Path

import pytest

if not (os.environ.get("DISPLAY") or shutil.which("Xvfb")):
    pytest.skip("there is no display, and no Xvfb", allow_module_level=True)

from qtpy.QtCore import QSettings, Qt, QTimer

from slideviz.samples.table import write_sample
from slideviz.session import changes

TICK_MS = 10
STEPS = 20


class Beat:
    """Listens to the event loop of the window's thread."""

    def __init__(self) -> None:
        self.gaps_ms: list[float] = []
        self._last = time.perf_counter()
        self._timer = QTimer()
        self._timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._timer.setInterval(TICK_MS)
        self._timer.timeout.connect(self._tick)
        self._timer.start()

    def _tick(self) -> None:
        now = time.perf_counter()
        self.gaps_ms.append(1000.0 * (now - self._last))
        self._last = now

    def told(self) -> dict[str, float]:
        """Return the worst gap since the last call, and that of the worst hundredth."""
        gaps, self.gaps_ms = sorted(self.gaps_ms), []
        return {
            "worst_gap_ms": gaps[-1],
            "gap_99_percent_ms": gaps[int(0.99 * len(gaps))],
        }


class Bench:
    """A window, the beat of its event loop, and what waits for it."""

    def __init__(self, app, folder: Path) -> None:
        from slideviz.gui.responsiveness.threads import (
            import_numerics,
            prepare_drawing,
            tune_interpreter,
        )
        from slideviz.gui.window import MainWindow

        import_numerics()
        self.app = app
        settings = QSettings(str(folder / "settings.ini"), QSettings.Format.IniFormat)
        self.window = MainWindow(settings, kept=folder / "sessions")
        self.case = folder / "stator.cfg"
        tune_interpreter()
        self.window.show()
        prepare_drawing(self.window.view, self.window.scene.stage)
        self.window.warmup.start()
        self.until(lambda: not self.window.warmup.thread_.is_alive())
        self.beat = Beat()
        self.rest()

    def until(self, done) -> None:
        while not done():
            self.app.processEvents()
            time.sleep(0.0005)

    def rest(self, seconds: float = 0.5) -> None:
        end = time.perf_counter() + seconds
        self.until(lambda: time.perf_counter() > end)

    def job(self, start) -> None:
        start()
        self.until(lambda: not self.window.runner.busy)

    def open(self) -> None:
        self.job(lambda: self.window.files.open_path(self.case))

    def change(self, **view) -> None:
        self.window.store.change(changes.set_view, **view)
        self.rest(0.3)


@pytest.fixture(scope="module")
def bench(qapp, tmp_path_factory):
    from slideviz.gui.widgets import questions

    folder = tmp_path_factory.mktemp("window")
    write_sample("stator", folder, 240_000)
    asked, questions.ask_unsaved = questions.ask_unsaved, lambda *_: "discard"
    made = Bench(qapp, folder)
    made.open()
    yield made
    made.window.close()
    questions.ask_unsaved = asked


def measure(benchmark, bench, work) -> None:
    """Do the work once, and tell of the gaps in it and in what follows of it."""
    bench.rest()
    bench.beat.told()
    benchmark.pedantic(work, rounds=1)
    bench.rest()
    benchmark.extra_info.update(bench.beat.told())


def test_opening(benchmark, bench):
    measure(benchmark, bench, bench.open)
    benchmark.extra_info["cells"] = len(bench.window.store.session.mesh.cells)


def test_coloring(benchmark, bench):
    def work():
        for name in ("size-skew", "size", "displacement", "role"):
            bench.change(color_by=name)

    measure(benchmark, bench, work)


def test_cutting(benchmark, bench):
    from slideviz.sections.model import Section

    store = bench.window.store

    def work():
        store.change(changes.add_section, Section("cylinder", (0.0, 0.0, 0.0), (0, 0, 1), 0.27))
        bench.rest()
        for radius in (0.26, 0.265, 0.275, 0.28):
            other = Section("cylinder", (0.0, 0.0, 0.0), (0, 0, 1), radius)
            store.change(changes.replace_section, 0, other)
            bench.rest(0.3)
        store.change(changes.remove_section, 0)

    measure(benchmark, bench, work)


def test_running(benchmark, bench):
    bench.window.store.change(changes.set_case, steps=STEPS)
    measure(benchmark, bench, lambda: bench.job(bench.window.start_run))
    benchmark.extra_info["memory_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def test_playing(benchmark, bench):
    window = bench.window
    if len(window.store.session.frames) <= STEPS:
        window.store.change(changes.set_case, steps=STEPS)
        bench.job(window.start_run)
    drawn: list[float] = []
    window.view.renderer.AddObserver("EndEvent", lambda *_: drawn.append(time.perf_counter()))

    def work():
        for step in range(STEPS + 1):
            before = len(drawn)
            window.player.go(step)
            bench.until(lambda before=before: len(drawn) > before)

    window.player.go(STEPS)
    measure(benchmark, bench, work)
    benchmark.extra_info["frames_per_second"] = (STEPS + 1) / benchmark.stats["min"]


def test_cancel(benchmark, bench):
    """The longest of ten, five while opening and five while running."""
    rng, worst = random.Random(0), {"open": 0.0, "run": 0.0}
    window = bench.window

    def cancel(kind, start, most):
        start()
        bench.rest(rng.uniform(0.0, most))
        began = time.perf_counter()
        window.running.cancel()
        bench.until(lambda: not window.runner.busy)
        worst[kind] = max(worst[kind], time.perf_counter() - began)

    def work():
        for _ in range(5):
            cancel("open", lambda: window.files.open_path(bench.case), 1.5)
            cancel("run", window.start_run, 3.0)

    measure(benchmark, bench, work)
    benchmark.extra_info.update({f"{kind}_cancel_s": value for kind, value in worst.items()})
