"""The window with 2 million hexahedra in memory, and with 10 million that stay in their file.

``worst_gap_ms`` is the worst time between two ticks of a timer that should tick every 10 ms;
``processor_ms`` the most that the window's own thread computed in such a time, drawing included;
``render_ms`` the longest picture. Drawing is by software under Xvfb, on the cores that compute.
"""

from __future__ import annotations

import resource
import time

import pytest

from slideviz.mesh.model import Skin
from slideviz.samples.table import write_sample
from slideviz.sections.model import Section
from slideviz.session import changes
from tests.benchmarks.bench_window import Beat, Bench

from qtpy.QtCore import QPoint, Qt  # isort: skip
from qtpy.QtTest import QTest  # isort: skip

STEPS = 5
pytestmark = pytest.mark.slow


class Meter(Beat):
    """A beat that also knows the processor time of its thread, and the longest picture."""

    def __init__(self, renderer) -> None:
        super().__init__()
        self._cpu, self._begun = time.thread_time(), 0.0
        self.most_cpu_ms = self.longest_ms = 0.0
        renderer.AddObserver("StartEvent", lambda *_: setattr(self, "_begun", time.perf_counter()))
        renderer.AddObserver("EndEvent", lambda *_: self._drawn())

    def _drawn(self) -> None:
        self.longest_ms = max(self.longest_ms, 1000.0 * (time.perf_counter() - self._begun))

    def _tick(self) -> None:
        super()._tick()
        now = time.thread_time()
        self.most_cpu_ms = max(self.most_cpu_ms, 1000.0 * (now - self._cpu))
        self._cpu = now

    def told(self) -> dict[str, float]:
        found = super().told() | {
            "processor_ms": self.most_cpu_ms,
            "render_ms": self.longest_ms,
            "memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        }
        self.most_cpu_ms = self.longest_ms = 0.0
        return found


@pytest.fixture(scope="module", params=[2_000_000, 10_000_000], ids=["memory", "file"])
def bench(request, qapp, tmp_path_factory):
    from slideviz.gui.widgets import questions

    folder = tmp_path_factory.mktemp("large")
    write_sample("stator", folder, request.param, file_format="su2b")
    asked = questions.ask_unsaved, questions.ask_save
    questions.ask_unsaved = lambda *_: "discard"
    questions.ask_save = lambda *_: folder / "out.su2b"
    made = Bench(qapp, folder)
    made.beat = Meter(made.window.view.renderer)
    yield made
    made.window.close()
    questions.ask_unsaved, questions.ask_save = asked


def measure(benchmark, bench, work) -> None:
    """Do the work once, and tell of the gaps in it and in what follows of it."""
    bench.rest()
    bench.beat.told()
    benchmark.pedantic(work, rounds=1)
    bench.rest(1.0)
    benchmark.extra_info.update(bench.beat.told())


def until_read(bench) -> None:
    bench.rest(0.1)
    bench.until(lambda: not bench.window.section_reader.busy)


def test_opening(benchmark, bench):
    measure(benchmark, bench, bench.open)
    mesh = bench.window.store.session.mesh
    assert bool(bench.window.store.session.lacks_cells) == isinstance(mesh, Skin)


def test_turning(benchmark, bench):
    view = bench.window.view

    def work():
        QTest.mousePress(view, Qt.MouseButton.LeftButton, pos=QPoint(200, 200))
        for k in range(40):
            QTest.mouseMove(view, QPoint(200 + 5 * k, 200 + 3 * k))
            bench.rest(0.02)
        QTest.mouseRelease(view, Qt.MouseButton.LeftButton, pos=QPoint(395, 317))

    measure(benchmark, bench, work)


@pytest.mark.parametrize("what", ["size-skew", "displacement"])
def test_coloring(benchmark, bench, what):
    measure(benchmark, bench, lambda: bench.change(color_by=what))


def test_cutting_by_a_plane(benchmark, bench):
    store = bench.window.store
    x, y, z = bench.window.store.session.mesh.points.mean(axis=0).tolist()

    def work():
        store.change(changes.add_section, Section("plane", (x, y, z)))
        until_read(bench)
        store.set_dragging(True)
        for k in range(10):
            store.change(changes.replace_section, 0, Section("plane", (x, y, z + 0.001 * k)))
            bench.rest(0.1)
        store.set_dragging(False)
        until_read(bench)

    measure(benchmark, bench, work)


def test_cutting_by_a_cylinder(benchmark, bench):
    store = bench.window.store

    def work():
        store.set_dragging(True)
        for k in range(10):
            other = Section("cylinder", (0.0, 0.0, 0.0), (0, 0, 1), 0.26 + 0.002 * k)
            store.change(changes.replace_section, 0, other)
            bench.rest(0.1)
        store.set_dragging(False)
        until_read(bench)

    measure(benchmark, bench, work)


def test_running(benchmark, bench):
    window = bench.window
    window.store.change(changes.remove_section, 0)
    window.store.change(changes.set_case, steps=STEPS)
    measure(benchmark, bench, lambda: bench.job(window.start_run))


def test_playing(benchmark, bench):
    window = bench.window

    def work():
        for step in (*range(len(window.store.session.frames)), 0):
            window.player.go(step)
            bench.rest(0.15)

    measure(benchmark, bench, work)


def test_cancelling_a_run(benchmark, bench):
    window = bench.window

    def work():
        window.start_run()
        bench.rest(2.0)
        began = time.perf_counter()
        window.running.cancel()
        bench.until(lambda: not window.runner.busy)
        benchmark.extra_info["cancel_s"] = time.perf_counter() - began

    measure(benchmark, bench, work)
