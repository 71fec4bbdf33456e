"""Coarse boundaries while the mouse moves something, if a whole frame takes too long to draw."""

from __future__ import annotations

from qtpy.QtCore import QObject

from slideviz.gui.responsiveness.settings import SLOW_FRAME_S, STILL_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.viewport.canvas import View3D
from slideviz.scene.scene import Scene


class CoarseWhileMoving(QObject):
    """Switches a slow scene to coarse boundaries while something is moved, and back afterwards.

    The mouse may move the camera or, for example, the handle of a section.

    Parameters
    ----------
    view : View3D
    scene : Scene
        The scene drawn in the view.
    """

    def __init__(self, view: View3D, scene: Scene) -> None:
        super().__init__(view)
        self.view, self.scene = view, scene
        self._timer = later(self, self._rest, STILL_MS)
        view.signals.moving.connect(self._moving)
        view.signals.released.connect(self._rest)

    def _moving(self) -> None:
        """Draw coarse boundaries from now on, if the last frame in full detail was slow."""
        if self.view.veiled or not (self.scene.coarse or self.view.frame_s > SLOW_FRAME_S):
            return
        self.scene.draw_coarse(True)
        self._timer.start()

    def _rest(self) -> None:
        """Draw the boundaries in full detail again."""
        self._timer.stop()
        if self.scene.draw_coarse(False):
            self.view.render_soon()
