import gc
import os
import shutil
import threading
import weakref
from functools import partial
from html import unescape

import pytest

if not (os.environ.get("DISPLAY") or shutil.which("Xvfb")):
    collect_ignore_glob = ["test_*.py"]
else:
    from qtpy.QtCore import QCoreApplication, QEvent, QSettings, Qt
    from qtpy.QtTest import QTest
    from qtpy.QtWidgets import QApplication, QDialog

    from slideviz.gui.viewport.canvas import View3D
    from slideviz.gui.widgets import plot_canvas, questions
    from slideviz.gui.window import MainWindow
    from slideviz.mesh.zones import marker_zones
    from slideviz.samples.table import write_sample
    from slideviz.scene.pick import to_display
    from slideviz.session import changes, jobs
    from slideviz.session.state import Session, StepFrame
    from tests.windows import services

PATIENCE_MS = 100_000

DIALOGS = (
    "ask_open",
    "ask_table",
    "ask_save",
    "ask_session",
    "ask_numbered",
    "ask_folder",
    "ask_replace",
    "ask_sample",
    "ask_unsaved",
    "ask_overwrite_input",
)


@pytest.fixture(scope="module", autouse=True)
def no_collection_in_threads():
    """Let no thread of a job or a plot look for garbage, not even between two tests.

    What belongs to Qt and VTK would end there. The program does the same
    (`slideviz.gui.responsiveness.threads`).
    """
    gc.disable()
    yield
    gc.collect()
    gc.enable()


@pytest.fixture(autouse=True)
def nothing_of_closed_windows():
    """Collect what closed windows left, as PySide would give their wrappers to new objects.

    The view keeps a QSurface; where Qt puts an action at its address later, Python gets the
    surface for it.

    Qt deletes closed windows in the next event loop only, and those that nobody gave to `qtbot`
    never: the next window would polish them, too, which takes longer than to make it.
    What is there before the test, as modules are, no later look finds: each would take longer.
    """
    gc.disable()  # a test may have switched it on
    for top in QApplication.topLevelWidgets():
        if isinstance(top, MainWindow) and not top.isVisible():
            top.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def no_questions(monkeypatch):
    """A question nobody expects fails the test instead of waiting for ever."""

    def unexpected(*values):
        raise AssertionError(f"unexpected question: {values[1:]}")

    for name in DIALOGS:
        monkeypatch.setattr(questions, name, unexpected)


@pytest.fixture
def answers(monkeypatch):
    """Answer a question: ``answers("ask_save", path)``."""

    def answer(name, value):
        asked = []

        def reply(*values):
            asked.append(values[1:])
            return value

        monkeypatch.setattr(questions, name, reply)
        return asked

    return answer


@pytest.fixture
def qtbot(qtbot):
    """Wait as long as a test may take: no test fails because a machine was busy for a while."""
    for name in ("waitUntil", "waitSignal", "waitExposed"):
        setattr(qtbot, name, partial(getattr(qtbot, name), timeout=PATIENCE_MS))
    return qtbot


@pytest.fixture
def settings(tmp_path):
    return QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def painted():
    """Paint the 3D views of a test whose module has them unpainted."""


@pytest.fixture
def unpainted(request, monkeypatch):
    """Leave 3D views unpainted where a test does not look at them: it took a fourth of its time.

    What is in the scene is as ever, and a snapshot draws it.
    """
    if "painted" not in request.fixturenames:
        monkeypatch.setattr(Painting, "is_on", False)


class Painting:
    """Whether 3D views are painted.

    `View3D.paintGL` is replaced once, and not for a test: of a view that lives on, PySide keeps the
    function that it has called before.
    """

    is_on = True

    @staticmethod
    def replace():
        paint = View3D.paintGL
        View3D.paintGL = lambda view: paint(view) if Painting.is_on else None


@pytest.fixture(scope="session", autouse=True)
def painting():
    Painting.replace()
    return Painting


@pytest.fixture
def window(request, qtbot, settings, monkeypatch):
    """A window without a mesh; that of the module if it has ``pytest.mark.window("shared")``.

    `reset` clears a shared one after each test. Tests that close or resize it, or change the theme,
    have ``pytest.mark.window("own")``.
    """
    mark = request.node.get_closest_marker("window")
    if mark is not None and mark.args == ("shared",):
        [made] = request.getfixturevalue("shared_windows")
        monkeypatch.setattr(made, "settings", settings)
        monkeypatch.setattr(made.files, "settings", settings)
        activate(made)
    else:
        made = MainWindow(settings, multi_samples=0)
        qtbot.addWidget(made, before_close_func=close_unsaved)
        show(made)
    yield made
    # A listener that raises is told in the banner, and the window goes on: not so a test.
    assert made.error_reporter.count == 0, made.banner.text.text()
    if made.property("first_layout"):
        reset(made, qtbot)
        request.node.funcargs.clear()  # those of the last test would keep the window


@pytest.fixture(scope="module")
def shared_windows(qapp, tmp_path_factory):
    """A list with the window of a module, which leaves nothing behind at its end."""
    path = tmp_path_factory.mktemp("settings") / "settings.ini"
    windows = [MainWindow(QSettings(str(path), QSettings.Format.IniFormat), multi_samples=0)]
    show(windows[0])
    windows[0].setProperty("first_layout", windows[0].saveState())
    yield windows
    made = windows.pop()
    close_unsaved(made)
    assert not made.left_behind
    parts = (made, made.view, made.scene, made.store)
    gone = {type(part).__name__: weakref.ref(part) for part in parts}
    made.deleteLater()
    del made, parts
    gc.unfreeze()
    for thread in threading.enumerate():
        if thread.name == plot_canvas.THREAD:
            thread.join()  # a plot that was on its way
    for _ in range(3):
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
        QCoreApplication.processEvents()
        gc.collect()
    assert [name for name, part in gone.items() if part() is not None] == []


def show(window):
    """Show a window, and make it the active one: shortcuts belong to it."""
    window.show()
    assert QTest.qWaitForWindowExposed(window, PATIENCE_MS)
    activate(window)


def activate(window):
    window.activateWindow()
    assert QTest.qWaitForWindowActive(window, PATIENCE_MS)


def close_unsaved(window):
    """Close a window; whatever a test leaves unsaved is of no interest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(questions, "ask_unsaved", lambda *_: "discard")
        window.close()


def reset(window, qtbot):
    """Bring a window to the state of a new one: no mesh, no dialog, no job, the first layout."""
    # Of one that waits for its deletion, `findChildren` would keep the Python object, with all that
    # it has, for good.
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    for dialog in window.findChildren(QDialog):
        dialog.close()
    window.running.cancel()
    qtbot.waitUntil(lambda: not window.runner.busy)
    window.player.stop()
    window.exports.end()
    window.store.put(Session())
    window.start.show()
    window.restoreState(window.property("first_layout"))
    window.banner.hide()
    window.statusBar().clearMessage()
    window.view.setFocus()


@pytest.fixture
def plot_panel(qtbot, monkeypatch):
    """Show a panel with a plot alone: ``plot_panel(HistogramPanel)``; it draws without delay."""
    monkeypatch.setattr(plot_canvas, "REST_MS", 0)

    def show(kind):
        made = kind(services([]))
        made.resize(300, 400)
        qtbot.addWidget(made)
        with qtbot.waitExposed(made):
            made.show()
        return made

    return show


@pytest.fixture(scope="session")
def sample_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("samples")
    write_sample("passage", folder / "passage", size=12)
    write_sample("hexahedron", folder / "hexahedron", size=6)
    return folder


@pytest.fixture(scope="session")
def computed(sample_folder):
    """The case of the passage, opened, and what returns the steps of a case: read only."""
    path = sample_folder / "passage" / "passage.cfg"
    opened = jobs.open_file(path, None, jobs.Job())
    mesh = opened.session.mesh
    mesh.points.flags.writeable = False

    known = {}

    def frames(case):
        if (key := repr(case)) in known:
            return known[key]
        found = []
        jobs.compute(case, mesh, jobs.Job(found.append))
        known[key] = [one for one in found if isinstance(one, StepFrame)]
        for step in known[key]:
            step.mesh.points.flags.writeable = False
        return known[key]

    return opened, frames


@pytest.fixture
def with_runs(driver, computed):
    """Open the case of the passage with runs that are done: ``with_runs({"steps": 2})``.

    Each has the settings of the one before, but for those given. What a run looks like while it
    goes on takes the window much longer than these steps took to compute.
    """

    def show(*runs):
        opened, frames = computed

        def run(session, settings):
            session = changes.start_run(changes.set_case(session, **settings))
            session = changes.set_view(session, color_by="size-skew")
            return changes.end_run(changes.add_frames(session, frames(session.case)), "done")

        driver.window.show_opened(opened)
        for settings in runs:
            driver.window.store.change(run, settings)
        return driver

    return show


@pytest.fixture
def passage_file(sample_folder, tmp_path):
    """A mesh of its own for each test, in a folder that may be written to."""
    return shutil.copy(sample_folder / "passage" / "mesh.su2", tmp_path / "passage.su2")


class Driver:
    """Does with a window what a user does."""

    def __init__(self, window, qtbot):
        self.window, self.qtbot = window, qtbot

    @property
    def session(self):
        return self.window.store.session

    @property
    def told(self):
        """The messages listed in the strip over the view, a line for each."""
        rows = self.window.run_panel.strip.rows
        return "\n".join(unescape(row.text.text()) for row in rows)

    def answer(self, text):
        """Click the button of a message in the strip over the view."""
        rows = self.window.run_panel.strip.rows
        next(row.answers[text] for row in rows if text in row.answers).click()

    def activate(self):
        """Make the window the active one, as a window manager does when a dialog closes."""
        self.window.activateWindow()
        self.qtbot.waitUntil(self.window.isActiveWindow)

    def settle(self):
        """Wait until no job runs."""
        self.qtbot.waitUntil(lambda: not self.window.runner.busy)

    def open(self, path):
        self.window.files.open_path(path)
        self.settle()
        return self.session

    def click_view(self, point, button=None, modifier=None):
        """Click where a point of the mesh is seen."""
        view = self.window.view
        view.snapshot()
        at = list(point) + [0.0] * (3 - len(point))
        x, y = to_display(view, [at])[0] / view.devicePixelRatioF()
        where = view.rect().topLeft()
        where.setX(round(x))
        where.setY(round(view.height() - 1 - y))
        QTest.mouseClick(
            view,
            button or Qt.MouseButton.LeftButton,
            modifier or Qt.KeyboardModifier.NoModifier,
            where,
        )

    def click(self, widget):
        QTest.mouseClick(widget, Qt.MouseButton.LeftButton)

    def row(self, name):
        mesh = self.session.mesh
        place = mesh.marker_names.index(name)
        return place + (marker_zones(mesh)[place] if len(mesh.parts) > 1 else 0)

    def click_row(self, name, modifier=None):
        table = self.window.boundaries.table
        where = table.visualItemRect(table.item(self.row(name), 1)).center()
        QTest.mouseClick(
            table.viewport(),
            Qt.MouseButton.LeftButton,
            modifier or Qt.KeyboardModifier.NoModifier,
            where,
        )

    def choose(self, choice, value):
        """Choose from a drop-down as with the keyboard: open it, go there, Enter."""
        index = choice.findData(value)
        assert index >= 0, value
        choice.showPopup()
        self.qtbot.waitUntil(lambda: choice.view().isVisible())
        choice.view().setCurrentIndex(choice.model().index(index, choice.modelColumn()))
        QTest.keyClick(choice.view(), Qt.Key.Key_Return)

    def role(self, name, role):
        self.choose(self.window.boundaries.table.cellWidget(self.row(name), 2), role)

    def type(self, field, text):
        """Replace the text of a field by typing."""
        QTest.mouseDClick(field, Qt.MouseButton.LeftButton)
        field.selectAll()
        QTest.keyClicks(field, text)
        QTest.keyClick(field, Qt.Key.Key_Tab)

    def add_motion(self, kind):
        """Choose from the menu of the button “Add motion”, with the keyboard."""
        panel = self.window.motions
        action = panel.add_actions[kind]
        menu = panel.add.menu()
        menu.popup(panel.add.mapToGlobal(panel.add.rect().bottomLeft()))
        self.qtbot.waitUntil(menu.isVisible)
        menu.setActiveAction(action)
        QTest.keyClick(menu, Qt.Key.Key_Return)


@pytest.fixture
def driver(window, qtbot):
    return Driver(window, qtbot)
