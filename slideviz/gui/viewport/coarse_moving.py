"""A coarser picture while the mouse moves something, where all facets would take too long."""

from __future__ import annotations

from qtpy.QtCore import QObject

from slideviz.gui.responsiveness.settings import SLOW_FRAME_S, STILL_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.viewport.canvas import View3D
from slideviz.scene.scene import Scene


class CoarseWhileMoving(QObject):
    """Switches a scene to coarse boundaries while something is moved, and back when it rests.

    That is the camera, or whatever else the mouse drags: a section, for example.

    Parameters
    ----------
    view : View3D
    scene : Scene
        What it draws.
    """

    def __init__(self, view: View3D, scene: Scene) -> None:
        super().__init__(view)
        self.view, self.scene = view, scene
        self._timer = later(self, self._rest, STILL_MS)
        view.signals.moving.connect(self._moving)
        view.signals.released.connect(self._rest)

    def _moving(self) -> None:
        """Draw less from now on, if the last whole picture took long."""
        if self.view.veiled or not (self.scene.coarse or self.view.frame_s > SLOW_FRAME_S):
            return
        self.scene.draw_coarse(True)
        self._timer.start()

    def _rest(self) -> None:
        """Draw everything again."""
        self._timer.stop()
        if self.scene.draw_coarse(False):
            self.view.render_soon()
