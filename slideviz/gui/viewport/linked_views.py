"""Two views side by side: their titles, and the link between their cameras."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QResizeEvent, QShowEvent
from qtpy.QtWidgets import QFrame, QHBoxLayout, QMenu, QSizePolicy, QToolButton

from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.widgets.build import tool_button
from slideviz.gui.widgets.labels import ElidedLabel
from slideviz.scene.scene import Scene


class TitleBar(QFrame):
    """The title above a view, cut short where there is no room, with a button to close the view.

    Parameters
    ----------
    name : str
        The widget's object name.
    closing : str
        The tooltip of the button that closes the view.
    fill : callable, optional
        Fills a menu with what the view can show instead; the title is then a drop-down button.
    """

    closed = Signal()

    def __init__(
        self, name: str, closing: str, fill: Callable[[QMenu], None] | None = None
    ) -> None:
        super().__init__()
        self.setObjectName(name)
        self._text = ""
        # A long title may not make one view wider than the other.
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.setFixedHeight(26)
        self._row = row = QHBoxLayout(self)
        row.setContentsMargins(6, 0, 2, 0)
        self.label: ElidedLabel | QToolButton = self._drop_down(fill) if fill else ElidedLabel()
        self.label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
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
        """Return the whole title."""
        return self._text

    def set_text(self, text: str) -> None:
        """Show another title."""
        self._text = text
        self._fit()

    def _fit(self) -> None:
        if isinstance(self.label, ElidedLabel):
            self.label.setText(self._text)
            self.setToolTip(self._text)
            return
        width = max(self.label.width() - 28, 20)
        metrics = self.label.fontMetrics()
        self.label.setText(metrics.elidedText(self._text, Qt.TextElideMode.ElideRight, width))
        self.setToolTip(f"{self._text}\nClick to show something else here")

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._fit()


class CameraLink:
    """The link between the cameras of two views: moving one moves the other.

    The views do not share one camera: the near and far clipping planes differ between two meshes,
    and only one view leaves a strip free for the legend.
    """

    def __init__(self, views: tuple[View3D, View3D], scenes: tuple[Scene, Scene]) -> None:
        self._following = False
        self._tags = []
        scenes[0].camera.beside, scenes[1].camera.beside = scenes[1].camera, scenes[0].camera
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
