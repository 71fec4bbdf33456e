"""The histogram panel, by itself: what it draws, the brush, the words."""

import time

import numpy as np
import pytest
from qtpy.QtCore import QPoint, Qt
from qtpy.QtTest import QTest

from slideviz.color_scheme import DARK
from slideviz.errors import SlidevizError
from slideviz.gui.panels.histogram import HistogramPanel
from slideviz.gui.widgets import plot_canvas
from slideviz.mesh.quality import INVERTED, quality
from slideviz.plots.session_plots import distribution
from slideviz.sections.polygons import ONLY_INVERTED
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from tests.gui.test_worst import session_with_runs


@pytest.fixture
def panel(plot_panel):
    return plot_panel(HistogramPanel)


@pytest.fixture
def full(panel, qtbot):
    with qtbot.waitSignal(panel.canvas.drawn):
        panel.store.put(session_with_runs())
    return panel


def labels(panel):
    return [text.get_text() for text in panel.canvas.figure.axes[0].get_legend().get_texts()]


def bars_of(panel):
    return [bar for bar in panel.canvas.figure.axes[0].patches if bar.get_gid() == "shown"]


def drag(panel, low, high, release=True):
    canvas = panel.canvas
    y = canvas.height() // 2
    a, b = (QPoint(round(canvas.pixel_of(value)), y) for value in (low, high))
    QTest.mousePress(canvas, Qt.MouseButton.LeftButton, pos=a)
    QTest.mouseMove(canvas, (a + b) / 2)
    QTest.mouseMove(canvas, b)
    if release:
        QTest.mouseRelease(canvas, Qt.MouseButton.LeftButton, pos=b)


def test_without_a_mesh_it_says_what_to_do(panel):
    assert panel.area.shows_text
    assert "Open a mesh first" in panel.area.words.text()
    assert not panel.save.isVisible()


def test_it_shows_the_step_the_undeformed_mesh_and_other_runs(full, qtbot):
    assert not full.area.shows_text
    assert sorted(labels(full)) == ["run 1", "run 2", "undeformed"]
    quality = full.store.session.frame.quality
    assert f"{quality.min:.4f}" in full.numbers.text()
    assert f"{quality.mean:.4f}" in full.numbers.text()
    assert f"inverted <b>{quality.inverted}" in full.numbers.text()
    with qtbot.waitSignal(full.canvas.drawn):
        full.store.change(changes.show_frame, 0)
    assert sorted(labels(full)) == ["run 1", "undeformed"]


def test_it_follows_the_colors_of_the_view(full, qtbot):
    numbers = {"skew": "skew quality", "wall-angle": "wall angle", "displacement": "displacement"}
    for by, word in numbers.items():
        with qtbot.waitSignal(full.canvas.drawn):
            full.store.change(changes.set_view, color_by=by)
        assert full.canvas.figure.axes[0].get_xlabel().startswith(word)
    moved = full.store.session.frame.values("displacement", full.store.session.mesh)
    moved = moved[full.store.session.frame.quality.status != INVERTED]
    low, high = full.canvas.figure.axes[0].get_xlim()
    assert moved.max() <= high <= 1.3 * moved.max()
    assert low <= moved.min()
    mesh = full.store.session.mesh
    shift = np.linalg.norm(full.store.session.frame.mesh.points - mesh.points, axis=1).max()
    assert shift > moved.max()
    assert f"highest <b>{shift:.4g}</b>" in full.numbers.text()


def good_session(mesh):
    """A session whose cells all are of about the same quality."""
    rng = np.random.default_rng(5)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    points = mesh.points + rng.uniform(-0.004, 0.004, mesh.points.shape)
    frame = StepFrame(mesh.with_points(points), quality(mesh.with_points(points), mesh))
    return changes.end_run(changes.add_frames(changes.start_run(session), [frame]), "done")


def test_the_axis_is_close_around_the_values_or_from_0_to_1(panel, qtbot):
    session = good_session(session_with_runs().mesh)
    with qtbot.waitSignal(panel.canvas.drawn):
        panel.store.put(session)
    low, high = panel.canvas.figure.axes[0].get_xlim()
    worst = session.frame.quality.values.min()
    assert 0.8 < low <= worst
    assert high == pytest.approx(1.0)
    bars = [bar.get_height() for bar in bars_of(panel)]
    assert np.count_nonzero(bars) > 5
    # A range that begins at the left end of the axis has all that are worse, too.
    drag(panel, low, 0.5 * (low + high))
    assert panel.store.session.view.threshold[0] <= worst
    panel.clear_range()
    with qtbot.waitSignal(panel.canvas.drawn):
        panel.whole.click()
    assert panel.canvas.figure.axes[0].get_xlim() == pytest.approx((0.0, 1.0))


def test_the_brush_chooses_the_cells_between_and_each_drag_is_undone_as_one(full, qtbot):
    full.whole.click()
    qtbot.waitUntil(lambda: not full.canvas.busy)
    drag(full, 0.6, 0.9)
    drag(full, 0.3, 0.5)
    full.store.undo()
    assert full.store.session.view.threshold == pytest.approx((0.6, 0.9), abs=0.01)
    full.store.undo()
    assert full.store.session.view.threshold is None
    drag(full, 0.6, 0.9)
    qtbot.waitUntil(lambda: full.store.session.view.threshold is not None)
    low, high = full.store.session.view.threshold
    assert (low, high) == pytest.approx((0.6, 0.9), abs=0.01)
    values = full.store.session.frame.quality.values
    count = int(((values >= low) & (values <= high)).sum())
    assert f"{count:,} of {len(values):,} cells" in full.range_text.text()
    assert full.show_all.isEnabled()
    # One end is taken up again.
    drag(full, high, 0.7)
    qtbot.waitUntil(lambda: full.store.session.view.threshold[1] < 0.72)
    assert full.store.session.view.threshold[0] == pytest.approx(low)


def test_counts_are_made_once_for_a_frame_and_can_be_linear(full, qtbot, monkeypatch):
    assert full.canvas.figure.axes[0].get_yscale() == "log"
    with qtbot.waitSignal(full.canvas.drawn):
        full.log.setChecked(False)
    assert full.canvas.figure.axes[0].get_yscale() == "linear"
    from slideviz.plots import session_plots

    asked = []
    real = session_plots._values
    monkeypatch.setattr(session_plots, "_values", lambda *v: asked.append(v[0]) or real(*v))
    with qtbot.waitSignal(full.canvas.drawn):
        full.store.change(changes.show_frame, 1)
    assert asked == [full.store.session.frame]


def test_from_the_strip_of_the_inverted_the_range_begins_at_0(full, qtbot):
    quality = full.store.session.frame.quality
    assert quality.inverted
    drag(full, -0.05, 0.5)
    qtbot.waitUntil(lambda: full.store.session.view.threshold is not None)
    assert full.store.session.view.threshold[0] == 0.0
    full.clear_range()
    drag(full, -0.09, -0.01)
    qtbot.waitUntil(lambda: full.store.session.view.threshold is not None)
    assert full.store.session.view.threshold == ONLY_INVERTED
    assert f"inverted cells, {quality.inverted} of" in full.range_text.text()


def test_the_choice_ends(full, qtbot):
    for how in ("button", "click", "escape"):
        full.store.change(changes.set_view, threshold=(0.2, 0.4))
        assert full.canvas.band == (0.2, 0.4)
        if how == "button":
            QTest.mouseClick(full.show_all, Qt.MouseButton.LeftButton)
        elif how == "click":
            QTest.mouseClick(
                full.canvas,
                Qt.MouseButton.LeftButton,
                pos=QPoint(round(full.canvas.pixel_of(0.8)), 90),
            )
        else:
            full.activateWindow()
            qtbot.waitUntil(full.isActiveWindow)
            full.canvas.setFocus()
            QTest.keyClick(full.canvas, Qt.Key.Key_Escape)
        assert full.store.session.view.threshold is None
        assert full.canvas.band is None
        assert not full.show_all.isEnabled()


def test_a_range_set_elsewhere_is_shown_also_in_a_stretched_image(full):
    full.store.change(changes.set_view, threshold=(0.25, 0.5))
    assert full.canvas.band == (0.25, 0.5)
    assert full.range_text.isVisible()
    assert full.range_text.text().startswith("Shown: 0.25 to 0.5")
    before = full.canvas.grab().toImage()
    full.store.change(changes.set_view, threshold=None)
    after = full.canvas.grab().toImage()
    x, y = round(full.canvas.pixel_of(0.4)), round(full.canvas.height() * 0.7)
    assert before.pixelColor(x, y) != after.pixelColor(x, y)
    before = full.canvas.pixel_of(0.5) / full.canvas.width()
    full.canvas.resize(2 * full.canvas.width(), full.canvas.height())
    assert full.canvas.pixel_of(0.5) / full.canvas.width() == pytest.approx(before)
    assert full.canvas.value_at(full.canvas.pixel_of(0.25)) == pytest.approx(0.25)


def test_hidden_it_draws_nothing_and_catches_up(full, qtbot):
    qtbot.waitUntil(lambda: not full.canvas.busy)
    full.hide()
    told = []
    full.canvas.drawn.connect(lambda: told.append(1))
    for frame in (0, 2, 1):
        full.store.change(changes.show_frame, frame)
    qtbot.wait(60)
    assert not told
    with qtbot.waitSignal(full.canvas.drawn):
        full.show()
    assert f"{full.store.session.frame.quality.min:.4f}" in full.numbers.text()


def test_hidden_while_a_drawing_waits_for_its_turn_it_draws_nothing(full, qtbot, monkeypatch):
    qtbot.waitUntil(lambda: not full.canvas.busy)
    monkeypatch.setattr(plot_canvas, "REST_MS", 10_000)
    full.canvas._last = time.monotonic()  # also after it was resized
    full.store.change(changes.show_frame, 0)
    assert full.canvas._timer.isActive()
    asked = []
    full.canvas.drawing = lambda: asked.append(1)
    full.hide()
    full.canvas._timer.start(0)
    qtbot.waitUntil(lambda: not full.canvas.busy)
    assert not asked


def test_playing_draws_less_often_than_it_steps(full, qtbot, monkeypatch):
    monkeypatch.setattr(plot_canvas, "REST_MS", 10_000)
    with qtbot.waitSignal(full.canvas.drawn):
        full.canvas.fill()
    told = []
    full.canvas.drawn.connect(lambda: told.append(1))
    for frame in (0, 1, 2, 1, 0):
        full.store.change(changes.show_frame, frame)
        qtbot.wait(5)
    assert not told
    assert full.canvas._timer.isActive()


def test_of_many_states_the_newest_is_drawn_last(full, qtbot):
    for frame in (0, 1, 2, 1, 0):
        full.store.change(changes.show_frame, frame)
        full.canvas.fill()
    qtbot.waitUntil(lambda: not full.canvas.busy)
    assert sorted(labels(full)) == ["run 1", "undeformed"]
    bars = [bar.get_height() for bar in bars_of(full)]
    session = full.store.session
    wanted = distribution(session.first, "size-skew", (0.0, 1.0), session.mesh)
    assert bars == list(np.maximum(wanted.counts - 0.5, 0.0))


def test_what_goes_wrong_in_a_drawing_is_told_in_the_window(full, qtbot, monkeypatch):
    def broken(_figure, _style):
        raise ValueError("no such font")

    monkeypatch.setattr(full.canvas, "drawing", lambda: broken)
    with qtbot.captureExceptions() as caught:
        full.canvas.fill()
        qtbot.waitUntil(lambda: bool(caught))
    assert [str(error) for _, error, _ in caught] == ["no such font"]
    monkeypatch.undo()
    with qtbot.waitSignal(full.canvas.drawn):
        full.canvas.request_draw()


def test_it_is_dark_in_the_dark(full, qtbot):
    with qtbot.waitSignal(full.canvas.drawn):
        full.take_theme(DARK)
    assert full.canvas.grab().toImage().pixelColor(3, 3).name() == DARK.background


def test_it_is_saved_as_a_figure(full, tmp_path, answers):
    for name, start in (("h.png", b"\x89PNG"), ("h.svg", b"<?xml"), ("h.pdf", b"%PDF")):
        answers("ask_save", tmp_path / name)
        QTest.mouseClick(full.save, Qt.MouseButton.LeftButton)
        assert (tmp_path / name).read_bytes().startswith(start)


def test_another_kind_of_file_is_refused_and_nothing_written(full, tmp_path):
    with pytest.raises(SlidevizError, match=r"a plot is a \.png, \.svg or \.pdf file"):
        plot_canvas.write_plot(tmp_path / "h.xls", full.drawing())
    assert not list(tmp_path.iterdir())


def test_a_small_panel_still_shows_its_plot(full, qtbot):
    full.resize(290, 240)
    qtbot.waitUntil(lambda: full.canvas.figure.bbox.width == full.canvas.width())
    axes = full.canvas.figure.axes[0].get_window_extent()
    assert axes.width > 0.5 * full.canvas.width() * full.canvas.devicePixelRatioF()
    box = full.canvas.figure.axes[0].get_tightbbox()
    assert box.x0 >= -1
    assert np.isfinite(box.x1)
    assert box.x1 <= full.canvas.width() * full.canvas.devicePixelRatioF() + 1
