"""The middle of the window: the view of the mesh, a second one to compare runs, and the mouse."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from qtpy.QtCore import QEvent, QObject, QPoint, QSize, Qt, Signal
from qtpy.QtGui import QHelpEvent, QKeyEvent, QResizeEvent, QShowEvent
from qtpy.QtWidgets import (
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QMenu,
    QToolButton,
    QToolTip,
    QWidget,
)

from slideviz.color_scheme import ColorScheme
from slideviz.gui.commands import fill_pane
from slideviz.gui.panels.boundaries import boundary_menu
from slideviz.gui.panels.worst import info_text
from slideviz.gui.responsiveness.timers import SLOW_FRAME_S, STILL_MS, single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.handle_mouse import HandleMouse
from slideviz.gui.widgets.build import ElidedLabel, Fitted, set_policy, tool_button
from slideviz.scene.flat_scene import FlatScene
from slideviz.scene.scene import Scene
from slideviz.scene.stage import STRIP
from slideviz.session import changes, jobs
from slideviz.session.measure import add_pick, drop_pick
from slideviz.session.motions import Ghosts
from slideviz.session.panes import choices, close_pane, panes
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import UNDEFORMED, Session, second_view
from slideviz.session.store import Store


class CoarseWhileMoving(QObject):
    """Switches a slow scene to coarse boundaries while something is moved, and back afterwards.

    The mouse may move the camera or, for example, the handle of a section. ``scene``: the scene
    drawn in the view.
    """

    def __init__(self, view: View3D, scene: Scene) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self._timer = single_shot(self, self._draw_fully, STILL_MS)
        view.signals.moving.connect(self._draw_coarsely)
        view.signals.released.connect(self._draw_fully)

    def _draw_coarsely(self) -> None:
        """Draw coarse boundaries from now on, if the last frame in full detail was slow."""
        if self.view.veiled or not (self.scene.coarse or self.view.frame_s > SLOW_FRAME_S):
            return
        self.scene.draw_coarse(True)
        self._timer.start()

    def _draw_fully(self) -> None:
        self._timer.stop()
        if self.scene.draw_coarse(False):
            self.view.render_soon()


class CellMouse(QObject):
    """The mouse over the cells of one view: shows tooltips, and marks the cell that is clicked.

    ``scene``: what it draws.
    """

    def __init__(self, view: View3D, scene: Scene | FlatScene, store: Store) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self.store = store
        view.setMouseTracking(True)
        view.installEventFilter(self)
        view.signals.cell_clicked.connect(self.mark)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QHelpEvent) and event.type() == QEvent.Type.ToolTip:
            cell = self.scene.pick_cell(*self.view.to_pixels(event.pos()))
            if cell is None:
                QToolTip.hideText()
            else:
                QToolTip.showText(event.globalPos(), info_text(self.scene.session, cell), self.view)
            return True
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress:
            return event.key() == Qt.Key.Key_Escape and self._escape()
        return False

    def mark(self, where: QPoint) -> None:
        """Mark the cell at a position in the view; clear the mark if there is none, or the same."""
        cell = self.scene.pick_cell(*self.view.to_pixels(where))
        marked = self.store.session.view.marked_cell
        self.store.change(changes.mark_cell, None if cell == marked else cell)

    def _escape(self) -> bool:
        """Take back a measured point, else the mark of a cell, the threshold or the handle."""
        view = self.store.session.view
        if view.picks is not None:
            self.store.change(drop_pick)
        elif view.marked_cell is not None:
            self.store.change(changes.mark_cell, None)
        elif view.threshold is not None:
            self.store.change(changes.set_view, threshold=None)
        elif view.handle:
            self.store.change(changes.show_handle, "")
        else:
            return False
        return True


class BoundaryMouse(QObject):
    """The mouse over the boundaries of one view: a click selects one, a right click opens its menu.

    ``scene``: what it draws.
    """

    def __init__(self, view: View3D, scene: Scene, store: Store) -> None:
        super().__init__(view)
        self.view = view
        self.scene = scene
        self.store = store
        view.signals.clicked.connect(self._select)
        view.signals.menu_wanted.connect(self._show_menu)

    def _select(self, where: QPoint, modifiers: Qt.KeyboardModifier) -> None:
        if self.store.session.view.picks is not None:
            picked = self.scene.pick_point(*self.view.to_pixels(where))
            if picked is not None:
                self.store.change(add_pick, picked)
            return
        name = self.scene.pick(*self.view.to_pixels(where))
        selected = self.store.session.view.selected
        if modifiers & Qt.KeyboardModifier.ControlModifier and name:
            others = tuple(other for other in selected if other != name)
            self.store.change(changes.select, others if name in selected else (*selected, name))
        else:
            self.store.change(changes.select, (name,) if name else ())

    def _show_menu(self, where: QPoint) -> None:
        if self.store.session.mesh is None:
            return
        name = self.scene.pick(*self.view.to_pixels(where))
        if name is not None and name not in self.store.session.view.selected:
            self.store.change(changes.select, (name,))
        selected = self.store.session.view.selected
        if selected:
            menu = boundary_menu(self.view.window(), self.store, selected)
            menu.popup(self.view.mapToGlobal(where))


class TitleBar(Fitted, QFrame):
    """The title above a view, cut short where there is no room, with a button to close the view.

    ``name``: the widget's object name. ``closing``: the tooltip of the button that closes the view.
    ``fill``: fills a menu with what the view can show instead; the title is then a drop-down
    button.
    """

    closed = Signal()

    def __init__(
        self, name: str, closing: str, fill: Callable[[QMenu], None] | None = None
    ) -> None:
        super().__init__()
        self.setObjectName(name)
        self._text = ""
        # A long title may not make one view wider than the other.
        set_policy(self, "Ignored", "Fixed")
        self.setFixedHeight(26)
        self._row = row = QHBoxLayout(self)
        row.setContentsMargins(6, 0, 2, 0)
        self.label: ElidedLabel | QToolButton = self._drop_down(fill) if fill else ElidedLabel()
        set_policy(self.label, "Ignored", "Preferred")
        row.addWidget(self.label, 1)
        self.close_button = tool_button(closing, self.closed, text="✕")
        self.close_button.setAutoRaise(True)
        row.addWidget(self.close_button)
        self.hide()

    def add_button(self, image: str, tip: str, do: Callable[[], None]) -> QToolButton:
        """Return a new button, put to the left of the close button."""
        button = tool_button(tip, do, image=image)
        button.setAutoRaise(True)
        self._row.insertWidget(1, button)
        return button

    def _drop_down(self, fill: Callable[[QMenu], None]) -> QToolButton:
        self.menu = QMenu()
        self.menu.aboutToShow.connect(lambda: fill(self.menu))
        button = tool_button("", menu=self.menu)
        button.setAutoRaise(True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        return button

    @property
    def text(self) -> str:
        return self._text

    def set_text(self, text: str) -> None:
        self._text = text
        self.fit()

    def fit(self) -> None:
        if isinstance(self.label, ElidedLabel):
            self.label.setText(self._text)
            self.setToolTip(self._text)
            return
        width = max(self.label.width() - 28, 20)
        metrics = self.label.fontMetrics()
        self.label.setText(metrics.elidedText(self._text, Qt.TextElideMode.ElideRight, width))
        self.setToolTip(f"{self._text}\nClick to show something else here")

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.fit()


class CameraLink:
    """The link between the cameras of two views: moving one moves the other.

    The views do not share one camera: the near and far clipping planes differ between two meshes,
    and only one view leaves a strip free for the legend.
    """

    def __init__(self, views: tuple[View3D, View3D], scenes: tuple[Scene, Scene]) -> None:
        self._following = False
        self._tags = []
        scenes[0].camera.beside = scenes[1].camera
        scenes[1].camera.beside = scenes[0].camera
        self._scenes = scenes
        for leader, follower, view in (
            (scenes[0], scenes[1], views[1]),
            (scenes[1], scenes[0], views[0]),
        ):
            camera = leader.plotter.camera
            tag = camera.AddObserver("ModifiedEvent", self._follow(leader, follower, view))
            self._tags.append((camera, tag))

    def _follow(self, leader: Scene, follower: Scene, view: View3D) -> Callable[..., None]:
        def follow(*_: object) -> None:
            # Drawing sets the clipping planes, which modifies a camera but does not move it:
            # without the second condition the views would make each other draw for ever.
            if self._following or leader.camera.looks_like(follower.camera):
                return
            self._following = True
            try:
                follower.camera.copy_from(leader.camera)
            finally:
                self._following = False
            view.render_soon()

        return follow

    def end(self) -> None:
        """End the link."""
        for scene in self._scenes:
            scene.camera.beside = None
        for camera, tag in self._tags:
            camera.RemoveObserver(tag)
        self._tags = []


class Viewing(QWidget):
    """The 3D views: one, or two side by side with linked cameras and the same range of colors."""

    status_changed = Signal(str)  # what the handle does, in words

    def __init__(self, store: Store, multi_samples: int, parent: QWidget) -> None:
        super().__init__(parent)
        self.store = store
        self._multi_samples = multi_samples
        self.handles: dict[View3D, HandleMouse] = {}
        """The handle in each view."""
        self._ghosts: Ghosts | None = None
        self.surfaces: tuple = ()
        self.coarse: tuple = ()
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(2)
        self.titles = [self._title(column) for column in (0, 1)]
        """The title bar above each view, visible while there are two."""
        self.view = self._make_view()
        """`view`, `scene`: the first view and its scene."""
        self._grid.addWidget(self.view, 1, 0)
        self.scene = Scene(self.view)
        self._connect(self.view, self.scene)
        self.second: View3D | None = None
        """`second`, `second_scene`: the second view and its scene; None while there is one view."""
        self.second_scene: Scene | None = None
        # Shared with the second flat view.
        self.second_cuts = Cuts()
        self._before: tuple[float, ...] | None = None
        self._fitted_at: QSize | None = None
        self._link: CameraLink | None = None

    # Parts -----------------------------------------------------------------------------
    def _title(self, column: int) -> TitleBar:
        title = TitleBar(
            f"view_title_{column}",
            "End the comparison; the other view stays",
            lambda menu: fill_pane(menu, self.store, column),
        )
        title.closed.connect(lambda: self.store.change(close_pane, column))
        self._grid.addWidget(title, 0, column)
        self._grid.setColumnStretch(column, 0 if column else 1)
        return title

    def _make_view(self) -> View3D:
        view = View3D(self, multi_samples=self._multi_samples)
        view.setMinimumSize(160, 120)
        # Two views get the same width, whatever their size hints are.
        set_policy(view, "Ignored", "Ignored")
        return view

    def _connect(self, view: View3D, scene: Scene) -> None:
        view.signals.resized.connect(lambda: self._resized(scene))
        view.signals.unveiled.connect(lambda: scene.update(scene.session))
        CoarseWhileMoving(view, scene)
        CellMouse(view, scene, self.store)
        BoundaryMouse(view, scene, self.store)
        # The last to watch the view is the first to get its events.
        self.handles[view] = HandleMouse(view, scene, self.store, self.status_changed.emit)
        view.signals.zoomed.connect(lambda where, factor: self._zoomed(view, scene, where, factor))

    def _make_second(self, session: Session) -> None:
        detail = self._before is not None or self.scene.camera.sees_detail()
        self.second = self._make_view()
        self._place(session.view.swapped)
        self.second.setVisible(True)
        self.second_scene = Scene(self.second, self.scene.scheme)
        self.second_scene.sections.cuts = self.second_cuts
        self._connect(self.second, self.second_scene)
        self.second.reduce_effects()
        self.second.set_flat(session.mesh.dim == 2)
        self.second_scene.set_coarse_boundaries(self.coarse)
        self.second_scene.open(second_view(session), self.surfaces)
        self.second_scene.set_motion_ghosts(self.scene.motion_ghosts)
        self.second_scene.camera.copy_from(self.scene.camera)
        self._share_legend(session.view.swapped)
        self._link = CameraLink((self.view, self.second), (self.scene, self.second_scene))
        self._rearranged(not detail)
        self.second.unveil()

    def _swap(self, swapped: bool) -> None:
        if (self._grid.itemAtPosition(1, 0).widget() is self.second) == swapped:
            return
        fitted = self._leader.camera.fitted
        self._place(swapped)
        self._share_legend(swapped)
        if fitted:
            self.fit()

    def _share_legend(self, swapped: bool) -> None:
        """Draw the legend in the right view only, which is wider by the legend's strip."""
        self.scene.set_legend(swapped)
        self.second_scene.set_legend(not swapped)
        self._share_width()

    def _share_width(self) -> None:
        """Set the columns' widths so that both meshes get the same room beside the legend."""
        if self.second is None:
            return
        width_left = max(self.width() - self._grid.spacing() - STRIP, 2)
        for column, width in enumerate((width_left // 2, width_left - width_left // 2 + STRIP)):
            self._grid.setColumnStretch(column, width)

    def _place(self, swapped: bool) -> None:
        assert self.second is not None
        pair = (self.second, self.view) if swapped else (self.view, self.second)
        for view in pair:
            self._grid.removeWidget(view)
        for column, view in enumerate(pair):
            self._grid.addWidget(view, 1, column)

    def _resized(self, scene: Scene) -> None:
        """Draw a view after its size changed; fit the mesh, or show a saved view, again."""
        camera = self._leader.camera
        fitted = camera.fitted
        restored = camera.restored
        scene.resized()
        if fitted:
            camera.fit()
        elif restored:
            camera.move_to(restored)

    @property
    def _leader(self) -> Scene:
        """Return the scene whose camera is fitted: of two, the one with the legend."""
        having = (scene for scene in reversed(self._scenes()) if scene.stage.has_legend)
        return next(having, self.scene)

    def _rearranged(self, refit: bool) -> None:
        """Draw the views after their number changed; fit the mesh if it was seen whole before."""
        self._grid.activate()
        if refit:
            self.fit()
        self.render()

    def _drop_second(self) -> None:
        if self.second is None:
            return
        second = self.second
        self.second = None
        self.second_scene = None
        sees_all = self.scene.camera.sees_all()
        self._link.end()
        self._link = None
        for view in (second, self.view):
            self._grid.removeWidget(view)
        self._grid.addWidget(self.view, 1, 0)
        for column, stretch in enumerate((1, 0)):
            self._grid.setColumnStretch(column, stretch)
        del self.handles[second]
        second.close()
        second.deleteLater()
        for title in self.titles:
            title.hide()
        self.scene.set_legend(True)
        self._rearranged(sees_all)

    # The session -----------------------------------------------------------------------
    def open(self, opened: jobs.Opened, session: Session) -> None:
        """Show a mesh that was opened, with the camera stored for its case if there is one."""
        self._drop_second()
        self._before = None
        self.surfaces = opened.surfaces
        self._ghosts = opened.ghosts
        self.view.reduce_effects()
        self.view.set_flat(session.mesh.dim == 2)
        self.coarse = opened.coarse
        self.scene.set_coarse_boundaries(opened.coarse)
        self.scene.open(session, opened.surfaces)
        if opened.camera is not None:
            self.scene.camera.move_to(opened.camera)
            if self.scene.camera.is_fit(opened.camera):
                self.scene.camera.fit()
        self.scene.set_motion_ghosts(self._ghosts.moved(session.case))
        self.view.unveil()

    def sync(self, old: Session, new: Session) -> None:
        """Update the views to a changed session; another mesh is shown by `open` instead."""
        changed = (old.case, old.laid) != (new.case, new.laid)
        if changed and self._ghosts is not None and self._ghosts.mesh is new.mesh:
            moved = self._ghosts.moved(new.case)
            for scene in self._scenes():
                scene.set_motion_ghosts(moved)
        for view, _ in self.views_and_scenes():
            if new.view.picks is not None:
                view.setCursor(Qt.CursorShape.CrossCursor)
            elif old.view.picks is not None:
                view.unsetCursor()
        if old.mesh is not new.mesh:
            return
        if self.store.dragging:  # the mouse drags a section, for example
            for view, _ in self.views_and_scenes():
                view.signals.moving.emit()
        try:
            self.scene.update(new)
        finally:
            # An error in one view must not keep the rest from being drawn.
            self.view.render_soon()
            self._sync_beside(new)
        if old.view.passages != new.view.passages:
            # Periodic copies that come or go change the extent of the scene.
            self.fit()

    def _sync_beside(self, session: Session) -> None:
        beside = session.view.beside
        other = session.run(beside)
        if other is None and beside != UNDEFORMED:
            self._drop_second()
            return
        names = choices(session)
        for title, number in zip(self.titles, panes(session), strict=True):
            title.setVisible(True)
            title.set_text("" if number is None else names.get(number, f"Run {number}"))
        if self.second is None:
            self._make_second(session)
        else:
            self._swap(session.view.swapped)
            self.second_scene.update(second_view(session))
            self.second.render_soon()

    def views_and_scenes(self) -> list[tuple[View3D, Scene]]:
        """Return the views, one or two, each with its scene."""
        views = (self.view,) if self.second is None else (self.view, self.second)
        return list(zip(views, self._scenes(), strict=True))

    def _scenes(self) -> tuple[Scene, ...]:
        return (self.scene,) if self.second_scene is None else (self.scene, self.second_scene)

    # Mouse -----------------------------------------------------------------------------
    def _zoomed(self, view: View3D, scene: Scene, where: QPoint, factor: float) -> None:
        scene.camera.zoom_at(*view.to_pixels(where), factor)
        self.render()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._share_width()

    # Camera and pictures ---------------------------------------------------------------
    def render(self) -> None:  # type: ignore[override]  # as the views do
        self.view.render()
        if self.second is not None:
            self.second.render()

    def fit(self, names: Sequence[str] = ()) -> None:
        """Make the whole mesh fill the view, or the boundaries with these names."""
        self._before = None
        self._leader.fit(names)
        self.render()

    def refit(self) -> None:
        """Fit all steps of a run to the view if the mesh moved out of it.

        A camera that is still fitted is fitted again as soon as a part of any step is out of view,
        another one only if all of the shown step is. Otherwise the camera stays: a jump would look
        like a motion of the mesh.
        """
        meshes = [frame.mesh for frame in self.store.session.frames]
        leader = self._leader
        fitted = leader.camera.fitted
        cameras = [scene.camera for scene in self._scenes()]
        if any(
            one.loses_some(leader.clouds(meshes)) if fitted else one.loses_all() for one in cameras
        ):
            self._before = None
            leader.camera.fit(leader.clouds(meshes))
            self.render()

    def fly_to(self, cell: int) -> None:
        """Fly the camera to a cell of the shown mesh; `fly_back` returns."""
        if self._before is None:
            self._before = self.scene.camera.place
            self._fitted_at = self.size() if self._leader.camera.fitted else None
        self.scene.fly_to(cell)
        self.render()

    def fly_back(self) -> None:
        """Fly the camera back to its place before `fly_to`, or show the whole mesh."""
        before = self._before
        self._before = None
        # A fitted view is fitted again where the window has another size now.
        if before is None or self._fitted_at not in (None, self.size()):
            self.fit()
        else:
            self.scene.camera.move_to(before)
            self.render()

    def look_from(self, side: str) -> None:
        """Look at the mesh from a side, as `slideviz.scene.scene.Scene.look_from` names it."""
        self._leader.look_from(side)
        self.render()

    def set_scheme(self, scheme: ColorScheme) -> None:
        for scene in self._scenes():
            scene.set_scheme(scheme)
        self.render()

    def close_views(self) -> None:
        self._drop_second()
        self.view.close()
