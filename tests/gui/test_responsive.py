"""Cancel and close at any moment: the session stays sound, the window usable, the end clean."""

import os
import random
import subprocess
import sys
import threading
import time

import pytest

from slideviz.errors import Cancelled
from slideviz.formats.files import read
from slideviz.gui.responsiveness import worker
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import find_pairs
from slideviz.mesh.quality import quality
from slideviz.session import changes, jobs


@pytest.fixture
def case_file(sample_folder):
    return next((sample_folder / "hexahedron").glob("*.cfg"))


def sound(session):
    """The session is one that the window could have without any cancel."""
    run = session.runs[-1]
    assert run.end in ("done", "cancelled")
    assert 0 <= session.view.frame < len(session.frames)
    assert [frame.step.index for frame in run.frames] == list(range(1, len(run.frames) + 1))
    for frame in session.frames:
        assert frame.mesh.points.shape == session.mesh.points.shape
        assert len(frame.quality) == len(session.mesh.cells)
    assert (run.end == "done") == (len(run.frames) == run.case.steps)
    return run


@pytest.mark.slow
def test_cancel_at_ten_random_moments_of_a_3d_run(driver, case_file):
    window = driver.window
    driver.open(case_file)
    window.store.change(changes.set_case, steps=6)
    # The first run may compile: the second tells how long one takes.
    for _ in range(2):
        began = time.monotonic()
        window.start_run()
        driver.settle()
        whole = time.monotonic() - began
        assert sound(driver.session).end == "done"
    ends = []
    rng = random.Random(1)
    for _ in range(10):
        window.start_run()
        driver.qtbot.wait(round(1000 * rng.uniform(0.0, 0.5 * whole)))
        window.running.cancel()
        driver.settle()
        ends.append(sound(driver.session).end)
        assert window.run_panel.run.isVisible()
        assert window.run_panel.run.isEnabled()
        # A run that was done before the cancel may tell of inverted cells.
        assert ends[-1] == "done" or not window.banner.isVisible()
    assert "cancelled" in ends
    window.start_run()
    driver.settle()
    assert sound(driver.session).end == "done"
    drawn = window.scene.drawn[driver.session.case.markers_with("moving")[0]]
    assert drawn.shape.points == pytest.approx(
        driver.session.frame.mesh.points[drawn.surface.nodes]
    ), "the last step is what is seen"


def test_opening_can_be_cancelled_at_any_moment_and_keeps_what_is_open(driver, case_file):
    window = driver.window
    before = driver.open(case_file).mesh
    for pause in (0, 1, 3, 10, 30):
        window.files.open_path(case_file)
        driver.qtbot.wait(pause)
        window.running.cancel()
        driver.settle()
        assert driver.session.mesh is not None
        assert not window.banner.isVisible()
    assert len(before.points) == len(driver.session.mesh.points)


class Counter:
    """Stops at the nth time that it is asked."""

    def __init__(self, stop_at):
        self.asked, self.stop_at = 0, stop_at

    def __call__(self):
        self.asked += 1
        return self.asked >= self.stop_at


def test_every_part_of_opening_asks_whether_to_stop(case_file):
    never = Counter(10**9)
    jobs.open_file(case_file, None, jobs.Job(stopped=never))
    assert never.asked > 10
    for stop_at in range(1, never.asked + 1):
        with pytest.raises(Cancelled, match="stopped on request"):
            jobs.open_file(case_file, None, jobs.Job(stopped=Counter(stop_at)))


def test_pairs_and_quality_can_be_stopped_inside(case_file):
    mesh: Mesh = read(case_file.parent / "mesh.su2")

    def stop():
        raise Cancelled("inside")

    with pytest.raises(Cancelled, match="inside"):
        find_pairs(mesh, going_on=stop)
    with pytest.raises(Cancelled, match="inside"):
        quality(mesh, going_on=stop)


def test_a_stopped_save_leaves_the_old_file(case_file, tmp_path):
    target = tmp_path / "out.su2"
    target.write_text("old")
    opened = jobs.open_file(case_file, None, jobs.Job())
    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.save_mesh(target, opened.session.first, False, jobs.Job(stopped=lambda: True))
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_window_that_saves_closes_when_the_mesh_is_written(
    driver, answers, case_file, monkeypatch, tmp_path
):
    driver.open(case_file)
    go, target = threading.Event(), tmp_path / "out.su2"
    write = jobs.save_mesh

    def slow(*values, **named):
        assert go.wait(100)
        return write(*values, **named)

    monkeypatch.setattr(jobs, "save_mesh", slow)
    answers("ask_save", target)
    driver.window.files.save_mesh()
    assert not driver.window.close()
    assert driver.window.isVisible()
    go.set()
    driver.qtbot.waitUntil(lambda: not driver.window.isVisible())
    assert target.is_file()


def test_closing_does_not_wait_for_a_job_that_does_not_stop(driver, case_file, monkeypatch):
    monkeypatch.setattr(worker, "CLOSING_S", 0.05)
    driver.open(case_file)
    go = threading.Event()
    driver.window.running.start_job("Deaf", lambda _: None, lambda job: go.wait(100))
    try:
        assert driver.window.close()
        assert driver.window.left_behind
        assert driver.window.runner.alive
    finally:
        go.set()


def test_a_large_mesh_appears_part_by_part_but_a_picture_is_whole_and_what_is_hidden_stays_so(
    driver, case_file, monkeypatch, painting
):
    from slideviz.gui.viewport import canvas

    monkeypatch.setattr(canvas, "PART_CELLS", 40)
    view = driver.window.view
    with driver.qtbot.waitSignal(view.signals.unveiled):
        driver.open(case_file)
    for name, one in driver.window.scene.drawn.items():
        assert one.actor.visibility, name
    monkeypatch.setattr(painting, "is_on", False)
    driver.open(case_file)
    assert view._veiled, "the first part only"
    early = view.snapshot()
    assert not view._veiled
    assert (early == view.snapshot()).mean() > 0.999
    driver.open(case_file)
    assert view._veiled
    name = driver.session.mesh.marker_names[-1]
    driver.window.store.change(changes.show_boundaries, (name,), False)
    monkeypatch.setattr(painting, "is_on", True)
    view.update()
    driver.qtbot.waitUntil(lambda: not view._veiled)
    assert not driver.window.scene.drawn[name].actor.visibility
    assert driver.window.scene.drawn[driver.session.mesh.marker_names[0]].actor.visibility


CLOSED = """
import sys
from pathlib import Path
from qtpy.QtCore import QTimer
from slideviz.gui import app
from slideviz.gui.widgets import questions
from slideviz.gui.window import MainWindow

questions.ask_unsaved = lambda *_: "discard"
opened = MainWindow.show_opened

def then_run(window, *values):
    opened(window, *values)
    from slideviz.session import changes
    window.store.change(changes.set_case, steps=5000)
    QTimer.singleShot(0, window.start_run)
    QTimer.singleShot(int(sys.argv[2]), window.close)

MainWindow.show_opened = then_run
sys.exit(app.launch(Path(sys.argv[1])))
"""


@pytest.mark.slow
@pytest.mark.parametrize("after_ms", [5, 700])
def test_the_program_ends_well_when_it_is_closed_while_it_runs(case_file, tmp_path, after_ms):
    places = {f"XDG_{name}_HOME": str(tmp_path / name) for name in ("DATA", "CACHE", "CONFIG")}
    places["NUMBA_CACHE_DIR"] = os.environ.get("NUMBA_CACHE_DIR", "")
    call = [sys.executable, "-c", CLOSED, str(case_file), str(after_ms)]
    environment = os.environ | {name: value for name, value in places.items() if value}
    done = subprocess.run(call, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    left = [path for path in (tmp_path / "DATA").rglob("*") if path.is_file()]
    left += [path for path in (tmp_path / "CACHE").rglob("crash*") if path.is_file()]
    assert left == [], "a proper end leaves no session and no crash"
