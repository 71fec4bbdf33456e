"""The main window: the view in the middle, panels around it, and what connects them."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from qtpy.QtCore import QSettings, Qt, QTimer
from qtpy.QtWidgets import (
    QDockWidget,
    QGridLayout,
    QLabel,
    QMainWindow,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from slideviz.gui import theme
from slideviz.gui.actions import Actions
from slideviz.gui.boundaries import BoundariesPanel, boundary_menu
from slideviz.gui.canvas import View3D
from slideviz.gui.clash import ClashWatch
from slideviz.gui.dialogs import Banner
from slideviz.gui.files import Files
from slideviz.gui.log import LogPanel
from slideviz.gui.method import MethodPanel
from slideviz.gui.motions import MotionPanel
from slideviz.gui.player import Player
from slideviz.gui.run import RunPanel
from slideviz.gui.start import StartPage
from slideviz.gui.warm import WarmUp
from slideviz.gui.worker import JobRunner
from slideviz.view import changes, jobs
from slideviz.view.ghosts import Ghosts
from slideviz.view.scene import Scene
from slideviz.view.state import Frame, Session
from slideviz.view.store import Store

log = logging.getLogger("slideviz")

LEFT_WIDTH = 350
"""Pixels that the panels on the left need at least."""


class MainWindow(QMainWindow):
    """The window of slideviz.

    Parameters
    ----------
    settings : QSettings, optional
        Where recent files, theme and layout are kept.
    multi_samples : int
        Anti-aliasing of the view; 0 is the fastest.
    """

    def __init__(self, settings: QSettings | None = None, multi_samples: int = 4) -> None:
        super().__init__()
        self.settings = settings or QSettings("slideviz", "slideviz")
        self.setObjectName("slideviz")
        self.setMinimumSize(900, 620)
        self.resize(1280, 800)
        self.setAcceptDrops(True)
        self.store = Store()
        self.runner = JobRunner(self)
        self._finish: Callable[[Any], None] | None = None
        self._next: Callable[[], None] | None = None
        self._ghosts: Ghosts | None = None
        self._surfaces = ()
        self._closed = False
        self.files = Files(self, self.settings)
        self._make_centre(multi_samples)
        self._make_docks()
        self._make_status()
        self.actions_ = Actions(self)
        self.actions_.add_panels(self.findChildren(QDockWidget))
        self._connect()
        self.set_theme(str(self.settings.value("theme", "system")))
        self._restore()
        self.store.listen(self._session_changed)
        self.clash_watch = ClashWatch(self.store, self)
        self.warm_up = WarmUp(self)
        self.warm_up.compiling.connect(self.preparing.setVisible)
        self.sync_actions()

    # Parts -----------------------------------------------------------------------------

    def _make_centre(self, multi_samples: int) -> None:
        centre = QWidget()
        column = QVBoxLayout(centre)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        self.banner = Banner()
        column.addWidget(self.banner)
        stack = QWidget()
        grid = QGridLayout(stack)
        grid.setContentsMargins(0, 0, 0, 0)
        # The start page lies over the view: a view that is never shown has no size.
        self.view = View3D(stack, multi_samples=multi_samples)
        self.scene = Scene(self.view)
        self.start = StartPage(self.files.samples, stack)
        self.start.setAutoFillBackground(True)
        grid.addWidget(self.view, 0, 0)
        grid.addWidget(self.start, 0, 0)
        self.start.raise_()
        self.start.show_recent(self.files.recent())
        column.addWidget(stack, 1)
        self.player = Player(self.store)
        column.addWidget(self.player)
        self.setCentralWidget(centre)

    def _make_docks(self) -> None:
        self.setDockOptions(
            QMainWindow.DockOption.AnimatedDocks | QMainWindow.DockOption.AllowTabbedDocks
        )
        self.setTabPosition(Qt.DockWidgetArea.AllDockWidgetAreas, QTabWidget.TabPosition.North)
        self.boundaries = BoundariesPanel(self.store)
        self.motions = MotionPanel(self.store)
        self.method = MethodPanel(self.store)
        self.run_panel = RunPanel(self.store)
        self.log = LogPanel()
        left, bottom = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.BottomDockWidgetArea
        self.docks = {
            "boundaries": self._dock("Boundaries", self.boundaries, left),
            "motion": self._dock("Motion", self.motions, left),
            "method": self._dock("Method", self.method, left),
            "run": self._dock("Run", self.run_panel, left),
            "log": self._dock("Log", self.log, bottom),
        }
        self.tabifyDockWidget(self.docks["motion"], self.docks["method"])
        self.docks["motion"].raise_()
        for name in ("motion", "method", "run"):
            # The tabs, and the button, name them already; the height is needed.
            self.docks[name].setTitleBarWidget(QWidget())
        self.docks["log"].hide()
        self.setCorner(Qt.Corner.BottomLeftCorner, left)

    def _dock(self, title: str, widget: QWidget, area: Qt.DockWidgetArea) -> QDockWidget:
        dock = QDockWidget(title, self)
        dock.setObjectName(title.lower())
        dock.setWidget(widget)
        if area == Qt.DockWidgetArea.LeftDockWidgetArea:
            # A window once made small must not leave names and fields cut off for ever.
            dock.setMinimumWidth(LEFT_WIDTH)
        self.addDockWidget(area, dock)
        return dock

    def _make_status(self) -> None:
        self.mesh_text = QLabel()
        self.preparing = QLabel("Preparing… ")
        self.preparing.setToolTip("The numerics are compiled, once after each installation.")
        self.preparing.hide()
        self.statusBar().addPermanentWidget(self.preparing)
        self.statusBar().addPermanentWidget(self.mesh_text)
        self.statusBar().setSizeGripEnabled(False)

    def _connect(self) -> None:
        self.runner.doing.connect(self._doing)
        self.runner.kept.connect(lambda frames: self.store.change(changes.add_frames, frames))
        self.runner.finished.connect(self._finished)
        self.runner.cancelled.connect(self._cancelled)
        self.runner.failed.connect(self._failed)
        self.run_panel.run_wanted.connect(self.start_run)
        self.run_panel.cancel_wanted.connect(self.cancel)
        self.run_panel.place_wanted.connect(self.lead_to)
        self.view.told.clicked.connect(self._view_clicked)
        self.view.told.menu_wanted.connect(self._view_menu)
        self.view.told.resized.connect(self.scene.resized)
        self.view.told.zoomed.connect(self._view_zoomed)
        self.start.open_wanted.connect(self.files.ask_and_open)
        self.start.file_wanted.connect(self.files.open_path)
        self.start.sample_wanted.connect(self.files.open_sample)

    def _restore(self) -> None:
        state, geometry = self.settings.value("state"), self.settings.value("geometry")
        if geometry is not None:
            self.restoreGeometry(geometry)
        if state is not None:
            self.restoreState(state)
        else:
            self._share_room()

    def _share_room(self) -> None:
        docks = [self.docks[name] for name in ("boundaries", "motion", "run")]
        self.resizeDocks(docks[:1], [372], Qt.Orientation.Horizontal)
        self.resizeDocks(docks, [240, 330, 90], Qt.Orientation.Vertical)

    # The session -----------------------------------------------------------------------

    def _session_changed(self, old: Session, new: Session) -> None:
        if old.case != new.case or old.mesh is not new.mesh:
            self._move_ghosts(new)
        if old.mesh is new.mesh:
            self.scene.update(new)
            self.view.render_soon()
        self.sync_actions()

    def sync_actions(self) -> None:
        """Show in menus, tool bar and title what is and what can be done."""
        session = self.store.session
        ready = self.run_panel.run.isEnabled()
        self.actions_.sync(session, self.runner.busy, ready)
        name = session.case.source or session.path
        changed = "*" if session.unsaved_case or session.unsaved_mesh else ""
        self.setWindowTitle(f"{changed}{name.name} – slideviz" if name else "slideviz")
        mesh = session.mesh
        if mesh is not None:
            self.mesh_text.setText(
                f"{mesh.dim}D   {len(mesh.cells):,} cells   {len(mesh.points):,} points "
            )

    def _move_ghosts(self, session: Session) -> None:
        if self._ghosts is None or self._ghosts.mesh is not session.mesh:
            return
        self.scene.set_motion_ghosts(self._ghosts.moved(session.case))

    def show_opened(self, opened: jobs.Opened) -> None:
        """Show a mesh that was just opened."""
        session = changes.fresh_view(opened.session, self.store.session.view)
        self._ghosts = Ghosts(session.mesh)
        self._surfaces = opened.surfaces
        self.banner.hide()
        self.start.hide()
        self.player.stop()
        self.view.spare_software()
        self.view.set_flat(session.mesh.dim == 2)
        self.scene.open(session, opened.surfaces)
        self.scene.set_motion_ghosts(self._ghosts.moved(session.case))
        self.store.put(session)
        self.view.render_soon()
        if session.reduction_guess:
            log.info("%s", session.reduction_guess)
        note = f". {session.reduction_guess}" if session.reduction_guess else ""
        self.say(f"Opened {(session.case.source or session.path).name}{note}")

    # Jobs ------------------------------------------------------------------------------

    def start_job(self, text: str, finish: Callable[[Any], None], function, *values) -> None:
        """Start a job beside the window; one that still runs is cancelled first."""
        if self.runner.busy:
            self._next = partial(self.start_job, text, finish, function, *values)
            self.cancel()
            return
        self._finish = finish
        self.runner.start(function, *values)
        self.run_panel.set_busy(text)
        self.say(text)
        self.sync_actions()

    def start_run(self) -> None:
        """Deform the mesh with the settings there are."""
        session = self.store.session
        if self.runner.busy or changes.is_missing(session):
            return
        self.banner.hide()
        self.store.change(changes.start_run)
        if session.view.colour_by == "role":
            self.store.change(changes.set_view, colour_by="size_skew")
        log.info("run: sliding %s, periodic %s, %s steps", *_settings(session))
        self.start_job("Starting", self._run_done, jobs.compute, session.case, session.mesh)

    def cancel(self) -> None:
        """Ask the job that runs to stop."""
        if self.runner.busy:
            self.run_panel.show_cancelling()
            self.runner.cancel()

    def _doing(self, doing: jobs.Doing) -> None:
        self.run_panel.show_doing(doing)

    def _job_ended(self) -> None:
        self._finish = None
        self.run_panel.set_busy("")
        self.sync_actions()
        follow, self._next = self._next, None
        if follow is not None:
            follow()

    def _finished(self, value: Any) -> None:
        finish = self._finish
        self._job_ended()
        if finish is not None:
            finish(value)
        self.sync_actions()

    def _cancelled(self) -> None:
        steps = len(self.store.session.frames) - 1
        kept = f"; {steps} step{'s' if steps != 1 else ''} kept" if steps > 0 else ""
        self.say(f"Cancelled{kept}")
        log.info("cancelled%s", kept)
        self._job_ended()

    def _failed(self, error: Exception) -> None:
        self.banner.tell_error(error)
        log.error("%s", error)
        self.statusBar().clearMessage()
        self._job_ended()

    def _run_done(self, _: Any) -> None:
        frame = self.store.session.deformed
        if frame is None:
            return
        quality = frame.quality
        text = (
            f"{_steps_text(frame)}min {quality.min:.4f}, mean {quality.mean:.4f}, "
            f"{quality.inverted} inverted"
        )
        log.info("done: %s", text)
        warnings = frame.step.warnings
        for warning in warnings:
            log.warning("%s", warning)
        if warnings:
            self.banner.tell("\n".join(warnings))
        self.say(f"Done: {text}")

    def say(self, text: str) -> None:
        """Show a short message in the status bar."""
        self.statusBar().showMessage(text, 8000)

    # The view --------------------------------------------------------------------------

    def _view_clicked(self, where, modifiers) -> None:
        name = self.scene.pick(*self.view.to_pixels(where))
        chosen = self.store.session.view.selected
        if modifiers & Qt.KeyboardModifier.ControlModifier and name:
            rest = tuple(other for other in chosen if other != name)
            self.store.change(changes.select, rest if name in chosen else (*chosen, name))
        else:
            self.store.change(changes.select, (name,) if name else ())

    def _view_menu(self, where) -> None:
        if self.store.session.mesh is None:
            return
        name = self.scene.pick(*self.view.to_pixels(where))
        chosen = self.store.session.view.selected
        if name is not None and name not in chosen:
            self.store.change(changes.select, (name,))
            chosen = (name,)
        if chosen:
            menu = boundary_menu(self, self.store, chosen)
            menu.popup(self.view.mapToGlobal(where))

    def _view_zoomed(self, where, factor: float) -> None:
        self.scene.zoom_at(*self.view.to_pixels(where), factor)
        self.view.render()

    def fit(self) -> None:
        """Make everything fill the view."""
        self.scene.fit()
        self.view.render()

    def look_from(self, side: str) -> None:
        """Look from a side."""
        self.scene.look_from(side)
        self.view.render()

    def show_all(self) -> None:
        """Show every boundary."""
        mesh = self.store.session.mesh
        if mesh is not None:
            self.store.change(changes.show, mesh.marker_names)

    def write_picture(self, path: Path, size: tuple[int, int], transparent: bool) -> None:
        """Write a picture of what the view shows, drawn anew at that size."""
        from slideviz.view.picture import picture_of

        picture_of(
            self.store.session,
            self._surfaces,
            path,
            size=size,
            transparent=transparent,
            like=self.scene,
        )

    def lead_to(self, place: str) -> None:
        """Bring a panel to the front."""
        if place == "open":
            self.files.ask_and_open()
            return
        dock = self.docks[place]
        dock.show()
        dock.raise_()
        dock.widget().setFocus()

    def set_theme(self, name: str) -> None:
        """Change to the light or dark theme, or to that of the desktop."""
        name = name if name in theme.THEMES else "system"
        self.settings.setValue("theme", name)
        look = theme.apply(name)
        colour = theme.icon_colour(look)
        self.actions_.set_icon_colour(colour)
        self.actions_.by_name[f"theme_{name}"].setChecked(True)
        self.player.set_icon_colour(colour)
        self.motions.set_icon_colour(colour)
        self.run_panel.take_theme()
        self.scene.set_look(look)
        self.view.render()

    # Qt --------------------------------------------------------------------------------

    def dragEnterEvent(self, event) -> None:
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event) -> None:
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            # After the drop is over: a question now would hold the other program.
            QTimer.singleShot(0, lambda: self.files.open_path(paths[0]))

    def closeEvent(self, event) -> None:
        if not self._closed:
            if not self.files.may_go_on():
                event.ignore()
                return
            self._closed = True
            self.settings.setValue("geometry", self.saveGeometry())
            self.settings.setValue("state", self.saveState())
            # First the work, then the view: a job may still hand over a step.
            self.player.stop()
            self.warm_up.close()
            self.clash_watch.close()
            self.runner.close()
            self.log.detach()
            self.view.close()
        super().closeEvent(event)


def _settings(session: Session) -> tuple[str, str, object]:
    return session.case.sliding, session.case.periodic, session.case.steps or "automatic"


def _steps_text(frame: Frame) -> str:
    """Return how many steps an automatic run took, and what else it tried; else nothing."""
    if frame.step is None or not frame.step.tried:
        return ""
    count = frame.step.total
    tried = ", ".join(str(trial.steps) for trial in frame.step.tried)
    return f"{count} step{'s' if count > 1 else ''} (automatic, tried {tried}); "
