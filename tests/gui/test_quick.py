"""What keeps the window answering: priorities, garbage, and painting once instead of twice."""

import ast
import gc
import os
import re
import subprocess
import sys
import weakref
from pathlib import Path

import pytest
from qtpy.QtCore import QEvent, QObject
from qtpy.QtWidgets import QApplication, QLabel, QVBoxLayout, QWidget

from slideviz.gui.responsiveness import threads, timers
from slideviz.gui.responsiveness.threads import GarbageCollector
from slideviz.gui.responsiveness.timers import GARBAGE_OBJECTS
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.widgets import plot_canvas
from slideviz.gui.widgets.build import QuietBar
from slideviz.plots.style import PRINT
from tests.windows import come_to_rest


class Painted(QObject):
    """Counts what is painted."""

    def __init__(self, *widgets):
        super().__init__()
        self.widgets = []
        for widget in widgets:
            widget.installEventFilter(self)

    def eventFilter(self, widget, event):  # noqa: N802
        if event.type() == QEvent.Type.Paint:
            self.widgets.append(widget)
        return False


def turns(count=30):
    for _ in range(count):
        QApplication.processEvents()


@pytest.fixture
def framed_view(qtbot):
    """A view with a label below it, shown and at rest."""
    frame = QWidget()
    layout = QVBoxLayout(frame)
    frame.view, frame.label = View3D(multi_samples=0), QLabel("before")
    layout.addWidget(frame.view)
    layout.addWidget(frame.label)
    frame.resize(300, 300)
    qtbot.addWidget(frame, before_close_func=lambda one: one.view.close())
    with qtbot.waitExposed(frame):
        frame.show()
    come_to_rest()
    qtbot.waitUntil(lambda: not frame.view._repaints._timer.isActive())
    return frame


def test_what_tells_of_a_change_is_painted_together_with_the_view(framed_view, qtbot):
    frame = framed_view
    painted = Painted(frame, frame.view, frame.label)
    for order in (0, 1):
        painted.widgets.clear()
        if order:
            frame.view.render()
        frame.label.update()
        if not order:
            frame.view.render()
        assert not painted.widgets, "not at once"
        qtbot.waitUntil(lambda: frame.view in painted.widgets)
        turns()
        assert painted.widgets.count(frame) == 1, "the window went to the screen once"
        assert painted.widgets.count(frame.label) == 1
        assert painted.widgets.count(frame.view) == 1


def test_a_window_is_painted_though_its_view_goes_before_it_was(framed_view, qtbot):
    frame = framed_view
    painted = Painted(frame.label)
    frame.view._repaints._timer.setInterval(10**6)
    frame.view.render()
    frame.label.update()
    turns()
    assert not painted.widgets, "it waits for the view"
    frame.view.close()
    qtbot.waitUntil(lambda: frame.label in painted.widgets)


def test_a_view_of_another_size_is_drawn_once_it_has_it(framed_view, qtbot):
    frame = framed_view
    drawn = []
    frame.view.renderer.AddObserver(
        "EndEvent", lambda *_: drawn.append((frame.view.width(), frame.view.height()))
    )
    for size in ((400, 320), (420, 350), (500, 400)):
        frame.resize(*size)
        frame.layout().activate()
    assert not drawn, "nobody sees the sizes on the way"
    qtbot.waitUntil(lambda: bool(drawn))
    turns()
    assert set(drawn) == {(frame.view.width(), frame.view.height())}
    assert frame.view.width() > 450


def test_a_closed_view_names_nothing_of_qt_that_is_gone(framed_view):
    view = framed_view.view
    surface = view._surface
    assert surface is not None
    known = sys.getrefcount(surface)
    view.close()
    assert view._surface is None
    assert sys.getrefcount(surface) == known - 1
    view.close()


def test_a_progress_bar_is_painted_in_the_next_turn(qtbot):
    bar = QuietBar()
    bar.setRange(0, 1000)
    qtbot.addWidget(bar)
    with qtbot.waitExposed(bar):
        bar.show()
    turns()
    painted = Painted(bar)
    for value in (500, 800):
        bar.setValue(value)
        assert not painted.widgets, "not at once"
        assert bar.value() == value
    qtbot.waitUntil(lambda: bool(painted.widgets))


class Ring:
    """An object that only a search for garbage ends."""

    def __init__(self):
        self.itself = self


@pytest.fixture
def tidy(qtbot):
    made = GarbageCollector()
    made.start()
    yield made
    made.end()
    assert gc.isenabled()


def test_garbage_is_looked_for_in_the_windows_thread_only(tidy, qtbot):
    assert not gc.isenabled()
    gc.collect()
    gone = weakref.ref(Ring())
    tidy.collect_if_due()
    assert gone() is not None, "for little, nobody looks"
    much = [[] for _ in range(2 * GARBAGE_OBJECTS)]
    assert gone() is not None
    qtbot.waitUntil(lambda: gone() is None)
    assert len(much) == 2 * GARBAGE_OBJECTS


def test_old_garbage_is_found_too(tidy):
    ring = Ring()
    gone = weakref.ref(ring)
    for _ in range(3):
        gc.collect()
    del ring
    much = [[] for _ in range(2 * GARBAGE_OBJECTS)]
    tidy.collect_if_due()
    assert gone() is None
    assert much


BACK = """
import _thread, os, threading, time
from slideviz.gui.responsiveness import threads, timers

numbers = {}

def wait(name):
    numbers[name] = threading.get_native_id()
    time.sleep(60)

_thread.start_new_thread(wait, ("library",))
threading.Thread(target=wait, args=("python",), daemon=True).start()
while len(numbers) < 2:
    time.sleep(0.01)
def read():
    mine = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    return [os.getpriority(os.PRIO_PROCESS, numbers[name]) - mine for name in ("library", "python")]
before = read()
threads.lower_library_priority()
print(before, read(), timers.NICENESS)
os._exit(0)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has priorities of threads")
def test_the_window_goes_before_threads_of_libraries():
    done = subprocess.run(
        [sys.executable, "-c", BACK], capture_output=True, text=True, timeout=120, check=True
    )
    assert done.stdout.strip() == "[0, 0] [5, 0] 5"


NUMERICS = """
from slideviz.gui.responsiveness.threads import import_numerics

import_numerics()
from threadpoolctl import threadpool_info
blas = [one for one in threadpool_info() if one["user_api"] == "blas"]
numpys = [one["num_threads"] for one in blas if "numpy.libs" in one["filepath"]]
print(len(blas) > len(numpys) > 0, numpys)
from threading import Thread
from slideviz.rbf.solve import enough_threads

def limited():
    with enough_threads(0.0):
        print({one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"})

thread = Thread(target=limited)
thread.start()
thread.join()
"""


def test_numpy_multiplies_in_the_thread_that_asks():
    done = subprocess.run(
        [sys.executable, "-c", NUMERICS],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "2"},
    )
    first, limited = done.stdout.splitlines()
    assert limited == "{1}", "a run rounds as it does without the window"
    apart, threads = first.split(" ", 1)
    if apart != "True":
        pytest.skip("NumPy and SciPy share a BLAS here")
    assert set(threads.strip("[]").split(", ")) == {"1"}


def test_every_thread_stands_back_before_it_works(window, qtbot, monkeypatch):
    order = []
    monkeypatch.setattr(threads, "lower_priority", lambda: order.append("back"))
    monkeypatch.setattr(threads.jit_warmup, "warm_up", lambda *_: order.append("warm"))
    window.warmup.start()
    qtbot.waitUntil(lambda: len(order) == 2)
    assert order == ["back", "warm"], "before Numba makes its threads, which inherit it"
    gc.unfreeze()
    order.clear()
    runner = JobRunner()
    runner.start(lambda job: order.append("job"))
    qtbot.waitUntil(lambda: not runner.busy)
    plot_canvas.draw_in_thread(
        lambda *_: order.append("plot"),
        plot_canvas.PlotFormat(50, 50, 1.0, PRINT),
        plot_canvas.AxesPlace(),
    ).result()
    assert order == ["back", "job", "back", "plot"]


def test_python_is_set_up_for_a_window(qapp):
    before = sys.getswitchinterval()
    try:
        collector = threads.tune_interpreter()
        assert sys.getswitchinterval() == pytest.approx(timers.SWITCH_S)
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 1000
        assert collector.parent() is qapp
        collector.end()
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)


# One place for what steers them ------------------------------------------------------------

GUI = Path(timers.__file__).parents[1]
STEERING = re.compile(
    r"\bgc\.\w|setswitchinterval\(|setpriority\(|\bnice\(|\bThread\(|Executor\(|QThread|"
    r"set_num_threads\(|ThreadpoolController|(?:setInterval|singleShot)\([1-9]|^[A-Z_]+_MS\b *="
)
OF_THE_FILM = {"viewport/player.py": ("PLAY_MS", "STEP_MS")}
"""What is seen how long is no matter of the window's answering."""


def test_nothing_else_in_the_window_steers_threads_timers_and_garbage():
    strays = []
    for path in sorted(GUI.rglob("*.py")):
        place = path.relative_to(GUI).as_posix()
        if place.startswith("responsiveness/"):
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if STEERING.search(line) and not line.startswith(OF_THE_FILM.get(place, ("#",))):
                strays.append(f"{place}:{number}: {line.strip()}")
    assert not strays, "it belongs to gui/responsiveness/"


def test_every_setting_has_its_reason_and_is_used():
    tree = ast.parse(Path(timers.__file__).read_text())
    text = "".join(p.read_text() for p in GUI.rglob("*.py") if p != Path(timers.__file__))
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(node, ast.Assign):
            reason = getattr(getattr(after, "value", None), "value", "")
            assert isinstance(reason, str), ast.unparse(node)
            assert len(reason) > 40, ast.unparse(node)
            for name in ast.walk(node.targets[0]):
                if isinstance(name, ast.Name):
                    assert re.search(rf"\b{name.id}\b", text), name.id


def test_the_last_number_along_x_is_whole_when_it_becomes_longer():
    def draw(low):
        return lambda figure, _style: figure.add_subplot().set_xlim(low, 1.0)

    paper, place = plot_canvas.PlotFormat(300, 200, 1.0, PRINT), plot_canvas.AxesPlace()
    for low in (0.0, 0.995):
        found = plot_canvas.picture(draw(low), paper, place)
        place = found.place
        ends = [label.get_window_extent().x1 for label in found.figure.axes[0].get_xticklabels()]
        assert max(ends) <= 300.0


@pytest.mark.parametrize("end", [1.09, 1.01, 1.001])
def test_the_last_number_along_x_is_whole_after_another_plot(end):
    """It is centred at its tick, so that it juts out the more the nearer that is to the end."""

    def draw_to(high):
        def draw(figure, style):
            axes = figure.subplots()
            axes.set_xlim(0.0, high)
            axes.set_xticks([0.0, 1.0], ["0.0", "1.000"])

        return draw

    paper = plot_canvas.PlotFormat(300, 200, 1.0, PRINT)
    place = plot_canvas.picture(draw_to(1.1), paper, plot_canvas.AxesPlace()).place
    figure = plot_canvas.picture(draw_to(end), paper, place).figure
    last = figure.axes[0].get_xticklabels()[-1]
    assert last.get_window_extent().x1 <= figure.bbox.x1
