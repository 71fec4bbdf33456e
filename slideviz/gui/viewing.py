"""The middle of the window: the view of the mesh, and a second one beside it to compare runs."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import QPoint, Qt
from qtpy.QtWidgets import QGridLayout, QLabel, QWidget

from slideviz.gui.boundaries import boundary_menu
from slideviz.gui.canvas import View3D
from slideviz.view import changes, jobs
from slideviz.view.ghosts import Ghosts
from slideviz.view.look import Look
from slideviz.view.scene import Scene
from slideviz.view.state import Run, Session
from slideviz.view.store import Store


class Viewing(QWidget):
    """One view, or two side by side with one camera and one range of colours.

    Attributes
    ----------
    view, scene
        The first view and what it draws.
    second, second_scene
        The other, None until it was needed.
    """

    def __init__(self, store: Store, multi_samples: int = 4, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        self._multi_samples = multi_samples
        self._ghosts: Ghosts | None = None
        self.surfaces: tuple = ()
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(2)
        self.titles = [self._title(0), self._title(1)]
        self.view = self._make_view()
        self._grid.addWidget(self.view, 1, 0)
        self.scene = Scene(self.view)
        self._connect(self.view, self.scene)
        self.second: View3D | None = None
        self.second_scene: Scene | None = None

    # Parts -----------------------------------------------------------------------------

    def _title(self, column: int) -> QLabel:
        label = QLabel()
        label.setObjectName(f"view_title_{column}")
        label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        label.setContentsMargins(4, 3, 4, 3)
        label.hide()
        self._grid.addWidget(label, 0, column)
        self._grid.setColumnStretch(column, 0 if column else 1)
        return label

    def _make_view(self) -> View3D:
        view = View3D(self, multi_samples=self._multi_samples)
        view.setMinimumSize(160, 120)
        return view

    def _connect(self, view: View3D, scene: Scene) -> None:
        view.told.clicked.connect(lambda where, keys: self._clicked(view, scene, where, keys))
        view.told.menu_wanted.connect(lambda where: self._menu(view, scene, where))
        view.told.resized.connect(scene.resized)
        view.told.zoomed.connect(lambda where, factor: self._zoomed(view, scene, where, factor))

    def _make_second(self) -> None:
        """Make the second view; from now on it has the camera of the first."""
        self.second = self._make_view()
        self._grid.addWidget(self.second, 1, 1)
        self._grid.setColumnStretch(1, 1)
        self.second.setVisible(True)
        self.second_scene = Scene(self.second, self.scene.look)
        self._connect(self.second, self.second_scene)
        self.second.spare_software()
        session = self.store.session
        self.second.set_flat(session.mesh.dim == 2)
        self.second_scene.open(changes.seen_beside(session), self.surfaces)
        self.second.renderer.camera = self.view.renderer.camera
        self.view.renderer.camera.AddObserver("ModifiedEvent", lambda *_: self._camera_moved())

    def _camera_moved(self) -> None:
        for view in (self.view, self.second):
            if view is not None and view.isVisible():
                view.render_soon()

    def _drop_second(self) -> None:
        second, self.second, self.second_scene = self.second, None, None
        if second is None:
            return
        self._grid.removeWidget(second)
        self._grid.setColumnStretch(1, 0)
        second.close()
        second.deleteLater()

    # The session -----------------------------------------------------------------------

    def open(self, opened: jobs.Opened, session: Session) -> None:
        """Show another mesh, from where its case was looked at if that is known."""
        self._drop_second()
        self.surfaces = opened.surfaces
        self._ghosts = Ghosts(session.mesh)
        self.view.spare_software()
        self.view.set_flat(session.mesh.dim == 2)
        self.scene.open(session, opened.surfaces)
        if opened.camera is not None:
            self.scene.eye.go(opened.camera)
        self.scene.set_motion_ghosts(self._ghosts.moved(session.case))
        self.view.render_soon()

    def sync(self, old: Session, new: Session) -> None:
        """Show what changed."""
        if old.case != new.case and self._ghosts is not None and self._ghosts.mesh is new.mesh:
            self.scene.set_motion_ghosts(self._ghosts.moved(new.case))
        if old.mesh is not new.mesh:
            return
        self.scene.update(new)
        self.view.render_soon()
        self._sync_beside(new)

    def _sync_beside(self, session: Session) -> None:
        other = session.run(session.view.beside)
        if other is None:
            self._drop_second()
        elif self.second is None:
            self._make_second()
        else:
            self.second_scene.update(changes.seen_beside(session))
            self.second.render_soon()
        for label, run in zip(self.titles, (session.run_shown, other), strict=True):
            label.setVisible(other is not None)
            label.setText(run_title(run) if run is not None else "Undeformed")

    # Mouse -----------------------------------------------------------------------------

    def _clicked(self, view: View3D, scene: Scene, where: QPoint, modifiers) -> None:
        name = scene.pick(*view.to_pixels(where))
        chosen = self.store.session.view.selected
        if modifiers & Qt.KeyboardModifier.ControlModifier and name:
            rest = tuple(other for other in chosen if other != name)
            self.store.change(changes.select, rest if name in chosen else (*chosen, name))
        else:
            self.store.change(changes.select, (name,) if name else ())

    def _menu(self, view: View3D, scene: Scene, where: QPoint) -> None:
        if self.store.session.mesh is None:
            return
        name = scene.pick(*view.to_pixels(where))
        chosen = self.store.session.view.selected
        if name is not None and name not in chosen:
            self.store.change(changes.select, (name,))
            chosen = (name,)
        if chosen:
            boundary_menu(self.window(), self.store, chosen).popup(view.mapToGlobal(where))

    def _zoomed(self, view: View3D, scene: Scene, where: QPoint, factor: float) -> None:
        scene.zoom_at(*view.to_pixels(where), factor)
        self.render()

    # Camera and pictures ---------------------------------------------------------------

    def render(self) -> None:
        """Draw again what is shown."""
        self.view.render()
        if self.second is not None:
            self.second.render()

    def fit(self) -> None:
        """Make everything fill the view."""
        self.scene.fit()
        self.render()

    def look_from(self, side: str) -> None:
        """Look from a side."""
        self.scene.look_from(side)
        self.render()

    def set_look(self, look: Look) -> None:
        """Take other colours."""
        self.scene.set_look(look)
        if self.second_scene is not None:
            self.second_scene.set_look(look)
        self.render()

    def write_picture(self, path: Path, size: tuple[int, int], transparent: bool) -> None:
        """Write a picture of what the first view shows, drawn anew at that size."""
        from slideviz.view.picture import picture_of

        picture_of(
            self.store.session,
            self.surfaces,
            path,
            size=size,
            transparent=transparent,
            like=self.scene,
        )

    def close_views(self) -> None:
        """Give the views' graphics back."""
        self._drop_second()
        self.view.close()


def run_title(run: Run) -> str:
    """Return what a run is called: its number and what sets it apart."""
    case = run.case
    words = {"none": "no sliding", "ps": "pseudo sliding", "ds": "direct sliding"}
    count = len(run.frames)
    steps = f"{count} step{'' if count == 1 else 's'}"
    periodic = f", periodic {case.periodic}" if case.periodic != "none" else ""
    return f"Run {run.number}: {words[case.sliding]}{periodic}, {steps}"
