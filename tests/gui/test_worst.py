"""The list of the worst cells, by itself and with the view beside it."""

import csv
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from qtpy.QtCore import Qt, QTimer
from qtpy.QtGui import QGuiApplication
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

from slideviz.formats.files import write
from slideviz.gui.panels import worst
from slideviz.gui.panels.worst import (
    CELL,
    COLUMNS,
    QUALITY,
    SINCE,
    WorstModel,
    WorstPanel,
    distinguishing_digits,
    info_text,
    place_digits,
)
from slideviz.gui.widgets import panel as panels
from slideviz.gui.widgets import plot_canvas
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.session import changes
from slideviz.session.inspect import (
    WorstCells,
    cell_info,
    nearest_boundary,
    table_rows,
    worst_cells,
)
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from tests.builders import stage
from tests.windows import services

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


def shaken(mesh, size, seed):
    rng = np.random.default_rng(seed)
    points = mesh.points + size * mesh.extent * rng.uniform(-1, 1, mesh.points.shape)
    moved = mesh.with_points(points)
    return StepFrame(moved, quality(moved, mesh))


def with_runs(session):
    """Return a session with two runs of two steps; the last step of each has inverted cells."""
    for seed in (1, 2):
        frames = [shaken(session.mesh, size, seed) for size in (0.004, 0.08)]
        session = changes.add_frames(changes.start_run(session), frames)
        session = changes.end_run(session, "done")
    return changes.set_view(session, color_by="size-skew")


@cache
def session_with_runs():
    mesh = sample("square", size=12).mesh
    return with_runs(open_mesh(StepFrame(mesh, quality(mesh)), None))


@pytest.fixture
def flown():
    return []


@pytest.fixture
def panel(qtbot, monkeypatch, flown):
    for module in (panels, plot_canvas):
        monkeypatch.setattr(module, "REST_MS", 0)
    made = WorstPanel(services(flown))
    made.resize(300, 420)
    qtbot.addWidget(made)
    with qtbot.waitExposed(made):
        made.show()
    made.activateWindow()
    return made


@pytest.fixture
def full(panel):
    panel.store.put(session_with_runs())
    return panel


def cells(panel):
    return [panel.model.cell(row) for row in range(panel.model.rowCount())]


def column(panel, which):
    return [panel.model.index(row, which).data() for row in range(panel.model.rowCount())]


def click(panel, row, modifier=Qt.KeyboardModifier.NoModifier):
    where = panel.table.visualRect(panel.model.index(row, QUALITY)).center()
    button = Qt.MouseButton.LeftButton
    QTest.mouseClick(panel.table.viewport(), button, modifier, where)


def test_the_mark_goes_with_a_new_run(full):
    click(full, 3)
    assert full.store.session.view.marked_cell is not None
    assert full.info.isVisible()
    full.store.change(changes.start_run)
    assert full.store.session.view.marked_cell is None
    assert not full.info.isVisible()


def test_a_mesh_with_inverted_cells_can_be_repaired_at_once(driver, tmp_path, monkeypatch):
    mesh = sample("square", size=12).mesh
    write(tmp_path / "folded.su2", shaken(mesh, 0.08, 1).mesh)
    driver.open(tmp_path / "folded.su2")
    window = driver.window
    window.dock_manager.bring_to_front("worst")
    button = window.dock_manager.panels["worst"].repair
    asked = []
    monkeypatch.setattr(window.running, "repair", lambda: asked.append(True))
    driver.click(button)
    assert asked == [True]
    write(tmp_path / "good.su2", mesh)
    driver.open(tmp_path / "good.su2")
    assert not button.isVisible()


def test_without_a_mesh_it_says_what_to_do(panel):
    assert panel.stack.currentWidget() is panel.words
    assert "Open a mesh first" in panel.words.text()
    assert not panel.export.isVisible()


def test_it_lists_the_worst_hundred_of_the_step(full):
    session = full.store.session
    wanted = worst_cells(session.frames, 2, "size-skew")
    assert cells(full) == wanted.cells.tolist()
    assert len(cells(full)) == 100
    assert column(full, SINCE) == [str(step) for step in wanted.steps]
    assert column(full, QUALITY)[0] == "inverted"
    assert column(full, QUALITY)[-1] == f"{wanted.values[-1]:.4f}"


def test_it_follows_the_step_and_the_colors(full):
    full.store.change(changes.show_frame, 1)
    session = full.store.session
    assert cells(full) == worst_cells(session.frames, 1, "size-skew").cells.tolist()
    full.store.change(changes.set_view, color_by="size")
    assert cells(full) == worst_cells(session.frames, 1, "size").cells.tolist()


def test_hidden_it_lists_nothing_and_catches_up(full, qtbot, monkeypatch):
    full.hide()
    with monkeypatch.context() as patch:
        patch.setattr(worst, "worst_cells", None)
        full.store.change(changes.show_frame, 1)
    full.show()
    wanted = worst_cells(full.store.session.frames, 1, "size-skew").cells.tolist()
    qtbot.waitUntil(lambda: cells(full) == wanted)


def test_while_steps_are_played_the_list_comes_when_there_is_time(full, qtbot, monkeypatch):
    full.store.change(changes.show_frame, 0)
    before = cells(full)
    monkeypatch.setattr(panels, "REST_MS", 1000)
    full.store.change(changes.show_frame, 1)
    assert cells(full) == before
    wanted = worst_cells(full.store.session.frames, 1, "size-skew").cells.tolist()
    qtbot.waitUntil(lambda: cells(full) == wanted)


@pytest.mark.parametrize("by", [CELL, SINCE])
def test_it_can_be_sorted_both_ways(full, by):
    for order, down in ((Qt.SortOrder.AscendingOrder, False), (Qt.SortOrder.DescendingOrder, True)):
        full.table.sortByColumn(by, order)
        numbers = [int(text) for text in column(full, by)]
        assert numbers == sorted(numbers, reverse=down)
    assert sorted(cells(full)) == sorted(full.model.worst.cells)


def test_sorting_keeps_the_marked_cell_the_current_row(full):
    full.store.change(changes.mark_cell, cells(full)[5])
    full.table.sortByColumn(CELL, Qt.SortOrder.DescendingOrder)
    assert full.model.cell(full.table.currentIndex().row()) == full.store.session.view.marked_cell


def test_a_click_marks_and_flies_and_a_second_one_takes_the_mark_away(full, flown):
    cell = cells(full)[3]
    click(full, 3)
    assert full.store.session.view.marked_cell == cell
    assert flown == [cell]
    assert full.info.isVisible()
    assert f"Cell {cell}" in full.info.text()
    click(full, 3)
    assert full.store.session.view.marked_cell is None
    assert not full.info.isVisible()
    assert not full.table.currentIndex().isValid()
    click(full, 3)
    assert full.store.session.view.marked_cell == cell
    assert flown == [cell, cell]


def test_keys_go_from_cell_to_cell_and_escape_takes_the_mark_away(full, flown):
    click(full, 0)
    for _ in range(2):
        QTest.keyClick(full.table, Qt.Key.Key_Down)
    assert full.store.session.view.marked_cell == cells(full)[2]
    assert flown == cells(full)[:3]
    QTest.keyClick(full.table, Qt.Key.Key_Escape)
    assert full.store.session.view.marked_cell is None


def test_a_mark_made_elsewhere_is_shown_without_flying(full, flown):
    full.store.change(changes.mark_cell, cells(full)[7])
    assert full.table.currentIndex().row() == 7
    full.store.change(changes.show_frame, 0)
    inside = full.model.row_of(full.store.session.view.marked_cell)
    assert full.table.currentIndex().row() == inside
    full.store.change(changes.mark_cell, None)
    assert not full.table.currentIndex().isValid()
    assert flown == []


def test_back_returns_and_the_mark_stays(full, flown):
    click(full, 1)
    cell = full.store.session.view.marked_cell
    QTest.mouseClick(full.back, Qt.MouseButton.LeftButton)
    assert full.store.session.view.marked_cell == cell is not None
    assert flown[-1] == "back"


def test_rows_are_copied_with_every_digit(full):
    click(full, 1)
    click(full, 3, Qt.KeyboardModifier.ShiftModifier)
    QTest.keyClick(full.table, Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier)
    lines = [line.split("\t") for line in QGuiApplication.clipboard().text().splitlines()]
    assert lines[0][:2] == ["cell", "type"]
    assert [int(line[0]) for line in lines[1:]] == cells(full)[1:4]
    assert float(lines[3][2]) == full.model.worst.values[3]


def test_the_list_is_exported(full, tmp_path, answers):
    asked = answers("ask_save", tmp_path / "worst.csv")
    QTest.mouseClick(full.export, Qt.MouseButton.LeftButton)
    assert asked[0][1].name == "worst_cells.csv"
    with (tmp_path / "worst.csv").open() as file:
        assert [int(row["cell"]) for row in csv.DictReader(file)] == cells(full)


def test_what_is_told_of_a_cell(full):
    session = full.store.session
    cell = cells(full)[0]
    text = info_text(session, cell)
    assert f"<b>Cell {cell}</b>, quadrilateral" in text
    assert "inverted" in text
    assert " to " in text.split("corner Jacobians: ")[1]
    assert "x " in text.split("<br>")[2]
    name, far, _ = nearest_boundary(session.frame.mesh, cell_info(session.frame, cell).position)
    assert f"{far:.4g} from {name}" in text
    every = info_text(session, cell, every=True)
    assert every.split("corner Jacobians: ")[1].count(",") == 3
    assert full.model.headers == (*COLUMNS, "x", "y")


def test_a_cell_in_the_middle_of_the_mesh_is_at_zero(full):
    session = full.store.session
    cell = cells(full)[0]
    mesh = session.frame.mesh
    moved = mesh.points - cell_info(session.frame, cell).position + [3.06162e-17, 0.0]
    frames = (replace(session.runs[-1].last, mesh=mesh.with_points(moved)),)
    full.store.put(replace(session, runs=(replace(session.runs[-1], frames=frames),)))
    assert info_text(full.store.session, cell).split("<br>")[2] == "x 0&nbsp; y 0"
    index = full.model.index(full.model.row_of(cell), 0)
    tip = full.model.data(index, Qt.ItemDataRole.ToolTipRole)
    assert tip == "quadrilateral at x, y = 0, 0"


def test_places_of_a_wheel_are_told_about_its_axis(full):
    session = full.store.session
    first, second = session.mesh.marker_names[:2]
    pair = Pair(
        first, second, "rotational", np.zeros(2), 0.3, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0),
        np.zeros((0, 2), np.int64), 0.0,
    )  # fmt: skip
    case = replace(session.case, roles=dict.fromkeys((first, second), "periodic"))
    full.store.put(replace(session, case=case, pairs=(pair,)))
    assert full.model.headers == (*COLUMNS, "r", "\u03b8 [°]")
    at = full.model.worst.positions[full.model.order[0]]
    assert float(full.model.index(0, 3).data()) == pytest.approx(np.hypot(*at), abs=1e-3)
    text = info_text(full.store.session, cells(full)[0])
    assert text.split("<br>")[2].startswith("r ")


# With the window -----------------------------------------------------------------------


@pytest.fixture
def opened(driver, passage_file):
    driver.open(passage_file)
    driver.window.store.put(with_runs(driver.session))
    return driver


def middle(driver, cell):
    mesh = driver.session.frame.mesh
    begin, end = mesh.cells.offsets[cell : cell + 2]
    return mesh.points[mesh.cells.connectivity[begin:end]].mean(axis=0)


def test_a_click_in_the_list_brings_the_cell_into_the_middle_and_back(opened):
    window = opened.window
    window.dock_manager.bring_to_front("worst")
    panel = window.dock_manager.panels["worst"]
    session = opened.session
    wanted = worst_cells(session.frames, session.view.frame, "size-skew").cells.tolist()
    opened.qtbot.waitUntil(lambda: cells(panel) == wanted and panel.isVisible())
    before = window.scene.camera.place
    click(panel, 2)
    cell = opened.session.view.marked_cell
    assert cell == panel.model.cell(2)
    assert np.allclose(window.scene.plotter.camera.focal_point[:2], middle(opened, cell))
    QTest.mouseClick(panel.back, Qt.MouseButton.LeftButton)
    assert np.allclose(window.scene.camera.place, before)


def test_an_export_that_fails_is_told_in_the_window(opened, tmp_path, answers):
    window = opened.window
    window.dock_manager.bring_to_front("worst")
    panel = window.dock_manager.panels["worst"]
    answers("ask_save", tmp_path / "none" / "worst.csv")
    opened.click(panel.export)
    assert "the folder does not exist" in window.banner.text.text()


def double_click(driver, point):
    view = driver.window.view
    driver.click_view(point)
    from qtpy.QtCore import QPoint

    from slideviz.scene.pick import to_display

    x, y = to_display(view, [[*point, 0.0][:3]])[0] / view.devicePixelRatioF()
    QTest.mouseDClick(
        view, Qt.MouseButton.LeftButton, pos=QPoint(round(x), round(view.height() - 1 - y))
    )


def test_a_double_click_marks_a_cell_and_escape_takes_that_away(opened):
    cell = 40
    double_click(opened, middle(opened, cell))
    marked = opened.session.view.marked_cell
    assert marked is not None
    # Cells overlap where some are inverted; the worst of those that are there is meant.
    values = opened.session.frame.quality.values
    assert marked == cell or values[marked] <= values[cell]
    QTest.keyClick(opened.window.view, Qt.Key.Key_Escape)
    assert opened.session.view.marked_cell is None
    opened.window.store.change(changes.set_view, threshold=(0.0, 0.5))
    QTest.keyClick(opened.window.view, Qt.Key.Key_Escape)
    assert opened.session.view.threshold is None


def test_a_click_with_alt_marks_a_cell_and_selects_no_boundary(opened):
    opened.window.store.change(changes.show_frame, 0)
    opened.window.store.change(changes.select, (opened.session.mesh.marker_names[0],))
    selected = opened.session.view.selected
    opened.click_view(middle(opened, 40), modifier=Qt.KeyboardModifier.AltModifier)
    assert opened.session.view.marked_cell == 40
    assert opened.session.view.selected == selected


def test_the_mouse_at_rest_tells_of_the_cell(opened, monkeypatch):
    from qtpy.QtCore import QPoint
    from qtpy.QtGui import QHelpEvent
    from qtpy.QtWidgets import QApplication, QToolTip

    from slideviz.scene.pick import to_display

    view = opened.window.view
    opened.window.store.change(changes.show_frame, 0)
    view.snapshot()
    told = []
    monkeypatch.setattr(QToolTip, "showText", lambda *v: told.append(v[1]))
    x, y = to_display(view, [[*middle(opened, 40), 0.0]])[0] / view.devicePixelRatioF()
    where = QPoint(round(x), round(view.height() - 1 - y))
    QApplication.sendEvent(
        view, QHelpEvent(QHelpEvent.Type.ToolTip, where, view.mapToGlobal(where))
    )
    assert len(told) == 1
    assert "Cell 40" in told[0]


def test_panels_behind_another_tab_do_nothing_until_they_are_in_front(opened, monkeypatch):
    from slideviz.plots import session_plots

    window, asked = opened.window, []
    for module, name in ((worst, "worst_cells"), (session_plots, "distribution")):
        real = getattr(module, name)

        def told(*values, real=real, name=name, **named):
            asked.append(name)
            return real(*values, **named)

        monkeypatch.setattr(module, name, told)
    panel = window.dock_manager.panels["worst"]
    window.dock_manager.bring_to_front("curves")
    canvases = window.findChildren(plot_canvas.PlotCanvas)
    opened.qtbot.waitUntil(lambda: not any(canvas.busy for canvas in canvases))
    asked.clear()
    for frame in (0, 1):
        window.store.change(changes.show_frame, frame)
    opened.qtbot.wait(50)
    assert asked == []
    window.dock_manager.bring_to_front("worst")
    opened.qtbot.waitUntil(lambda: "worst_cells" in asked)
    wanted = worst_cells(opened.session.frames, 1, "size-skew").cells.tolist()
    assert cells(panel) == wanted
    window.dock_manager.bring_to_front("histogram")
    opened.qtbot.waitUntil(lambda: "distribution" in asked)
    words = window.dock_manager.panels["histogram"].numbers
    low = f"{opened.session.frame.quality.min:.4g}"
    opened.qtbot.waitUntil(lambda: low in words.text())


def test_a_list_that_is_hidden_before_its_turn_is_filled_when_it_is_seen(full, qtbot, monkeypatch):
    qtbot.waitUntil(lambda: full.model.worst is not None)
    monkeypatch.setattr(panels, "REST_MS", 10_000)
    full.store.change(changes.show_frame, 1)
    (later,) = (timer for timer in full.findChildren(QTimer) if timer.isActive())
    before = full.model.worst
    full.hide()
    monkeypatch.setattr(panels, "REST_MS", 0)
    later.start(0)
    qtbot.waitUntil(lambda: not later.isActive())
    assert full.model.worst is before
    full.show()
    qtbot.waitUntil(lambda: full.model.worst is not before)


def test_columns_share_the_width_unless_somebody_chose_others(full):
    table = full.table
    table.resize(600, 300)
    QApplication.processEvents()
    count = table.model().columnCount()
    widths = [table.columnWidth(column) for column in range(count)]
    assert sum(widths) >= table.viewport().width() - count
    spare = [width - needed for width, needed in zip(widths, table._needed, strict=True)]
    assert max(spare) - min(spare) <= count, "none is much wider than its numbers"
    table.setColumnWidth(1, 140)
    table.resize(700, 300)
    QApplication.processEvents()
    assert table.columnWidth(1) == 140


def test_the_sign_of_the_order_does_not_touch_the_word(full):
    header = full.table.horizontalHeader()
    words = full.model.headerData(QUALITY, Qt.Orientation.Horizontal)
    assert words == "Quality\N{NO-BREAK SPACE}"
    assert header.fontMetrics().horizontalAdvance(words) + 14 < full.table.columnWidth(QUALITY)
    full.table.sortByColumn(CELL, Qt.SortOrder.AscendingOrder)
    assert full.model.headerData(QUALITY, Qt.Orientation.Horizontal) == "Quality"


def test_qualities_have_as_many_digits_as_tell_them_apart():
    assert distinguishing_digits(np.array([0.1, 0.2, 0.3])) == 4
    assert distinguishing_digits(np.array([0.94915, 0.94916, 0.94917, 0.94918])) == 5
    assert distinguishing_digits(np.full(9, 0.5)) == 4
    assert distinguishing_digits(np.empty(0)) == 4


def worst_at(positions, numbers):
    count = len(positions)
    return WorstCells(
        np.array(numbers),
        np.linspace(0.1, 0.2, count),
        np.zeros(count, bool),
        np.array(positions),
        np.zeros(count, np.int64),
        ("quadrilateral",) * count,
        "size-skew",
        np.array(numbers),
    )


def test_cells_of_several_zones_have_their_zone(tmp_path):
    mesh = stage()
    frame = shaken(mesh, 0.02, 1)
    found = worst_cells([StepFrame(mesh, quality(mesh)), frame], 1, "size-skew")
    parts = mesh.parts
    zones = [
        next(k for k, part in enumerate(parts, 1) if part.cells.start <= cell < part.cells.stop)
        for cell in found.cells
    ]
    assert set(zones) == {1, 2}
    assert found.zones == tuple(zones)
    model = WorstModel()
    model.show(found)
    column = model.headers.index("Zone")
    assert model.headers == (*COLUMNS, "Zone", "x", "y", "z")[: len(model.headers)]
    rows = range(model.rowCount())
    assert [model.index(row, column).data() for row in rows] == [str(zone) for zone in zones]
    assert float(model.index(0, column + 1).data()) == pytest.approx(
        found.positions[0, 0], abs=1e-3
    )
    model.sort(column, Qt.SortOrder.DescendingOrder)
    assert [model.index(row, column).data() for row in rows] == sorted(
        map(str, zones), reverse=True
    )
    assert [row[1] for row in table_rows(found)] == ["zone", *map(str, zones)]
    session = open_mesh(frame, None)
    assert f" of zone {zones[0]}, " in info_text(session, int(found.cells[0]))
    alone = worst_cells([shaken(sample("square", size=12).mesh, 0.01, 1)], 0, "size-skew")
    assert alone.zones == ()


@pytest.mark.parametrize("scale", [1.0, 1e-7, 1e4])
def test_coordinates_have_as_many_digits_as_tell_cells_apart(scale):
    model = WorstModel()
    places = scale * np.array([[0.80001, 0.5], [0.80002, 0.5], [-20.0, 0.5]])
    model.show(worst_at(places, [1, 2, 3]))
    texts = [model.index(row, len(COLUMNS)).data() for row in range(3)]
    assert len(set(texts)) == 3
    assert float(texts[1]) - float(texts[0]) == pytest.approx(1e-5 * scale)
    # Where the usual ones do, there are no more.
    model.show(worst_at([[0.81, 0.5], [0.82, 0.5]], [1, 2]))
    assert model.index(0, len(COLUMNS)).data() == "0.8100"


def test_lengths_have_the_same_number_of_decimals():
    model = WorstModel()
    for places, texts in (
        ([[1.71, 0.5], [0.82, 0.25]], ("1.7100", "0.5000")),
        ([[171.0, 1e-9], [82.0, 2e-9]], ("171.00000", "0.00000")),
        ([[12345.0, 0.0], [0.5, 0.0]], ("12345", "0")),
    ):
        model.show(worst_at(places, [1, 2]))
        assert tuple(model.index(0, len(COLUMNS) + k).data() for k in (0, 1)) == texts
    assert place_digits(("r", "θ [°]", "z"), np.array([[1.5, 10.0, 0.02]])) == [5, 2, 5]


def test_columns_grow_with_the_numbers_of_another_mesh(full):
    table = full.table
    room = table.columnWidth(CELL)
    dim = full.model.worst.positions.shape[1]
    full.model.show(worst_at(np.zeros((1, dim)), [123_456_789]))
    wide = table.fontMetrics().horizontalAdvance("123456789")
    assert room < wide < table.columnWidth(CELL)
    # Nobody's own choice is changed by it.
    table.setColumnWidth(CELL, 33)
    full.model.show(worst_at(np.zeros((1, dim)), [12_345_678_901]))
    assert table.columnWidth(CELL) == 33
