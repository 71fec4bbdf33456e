"""The handle of what has an axis in a 3D mesh: a frame around the cut, and a ball to pull it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from qtpy.QtCore import QPoint

from slideviz.color_scheme import Look
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.pull_mark import PullMark
from slideviz.gui.viewport.pulled import EDGE_PX, REACH_PX, Pulled
from slideviz.mesh.model import FloatArray
from slideviz.scene.cylinder_handle import frame_of, pull, pulled_size
from slideviz.scene.pick import to_display
from slideviz.sections.around_axis import Patch, Place, shape_of
from slideviz.sections.handles import rounded
from slideviz.sections.model import Section


class RoundHandle(Pulled[tuple[Section, Place]]):
    """A ball on a section about an axis that the mouse changes its size by, as its radius.

    It lies on what is cut of the mesh, where that is seen, and in front of everything.

    Parameters
    ----------
    view, *others
        As for `slideviz.gui.viewport.pulled.Pulled`.
    """

    def __init__(self, view: View3D, *others: Callable[..., Any]) -> None:
        super().__init__(view, *others)
        self._patch: Patch | None = None
        self.place: Place | None = None
        self._mark = PullMark(view)
        # Before each drawing, whatever moved the camera or changed the size of the view.
        self._watching = view.renderer.AddObserver("StartEvent", lambda *_: self.put())

    def show(self, section: Section, patch: Patch, look: Look) -> None:
        """Stand where the section is, around that part of it."""
        self.section, self._patch = section, patch
        self._mark.colour(look, self._part is not None)
        self._mark.draw_frame(frame_of(section, patch))
        self.put()

    def close(self) -> None:
        """Leave the view for ever."""
        self.view.renderer.RemoveObserver(self._watching)
        self._patch = None
        self._mark.remove()
        super().close()

    def seen(self, points: FloatArray) -> FloatArray:
        """Return where points (n, 3) are seen, (n, 2) in pixels from the lower left."""
        return to_display(self.view, points)

    def put(self) -> None:
        """Put the ball where it is in reach, and what points to where it can be pulled."""
        if self.section is None or self._patch is None:
            return
        self.place = self._start[0][1] if self._start is not None else self._in_reach(self._patch)
        at, way, _ = pull(self.seen, self.section, self.place, self.section.size)
        self._mark.draw_ball(at, way / np.linalg.norm(way))
        self._mark.highlight(self._part is not None)
        if self._part is not None and not self.dragging and self.part_at(self._mouse) is None:
            # It went from below the mouse, which stayed.
            self._point_at(None)

    def _in_reach(self, patch: Patch) -> Place:
        """Return where the ball lies: in the middle, or beside it in a detail of the view."""
        assert self.section is not None
        places = np.concatenate([np.array([patch.middle]), patch.places])
        pixels = self.seen(shape_of(self.section).surface(self.section, places, self.section.size))
        wide, high = self.view.window_size
        end = np.array([wide - self._strip() - EDGE_PX, high - EDGE_PX])
        within = np.all((pixels >= EDGE_PX) & (pixels <= end), axis=1)
        if within[0] or not within.any():
            return patch.middle
        off = np.linalg.norm(pixels - (EDGE_PX + end) / 2.0, axis=1)
        angle, along = places[int(np.argmin(np.where(within, off, np.inf)))].tolist()
        return angle, along

    # Mouse -----------------------------------------------------------------------------

    def place_of(self, where: QPoint) -> FloatArray:
        """Return a position of the widget in pixels from the lower left, (2,)."""
        return np.array(self.view.to_pixels(where))

    def part_at(self, where: QPoint) -> str | None:
        """Return whether the mouse would take the ball at a position of the widget."""
        if self.section is None or self.place is None:
            return None
        at, *_ = pull(self.seen, self.section, self.place, self.section.size)
        reach = REACH_PX * self.view.devicePixelRatioF()
        return "ball" if np.linalg.norm(at - self.place_of(where)) <= reach else None

    def grasp(self) -> tuple[Section, Place]:
        """Return the section, and where the ball lies."""
        assert self.section is not None
        assert self.place is not None
        return self.section, self.place

    def pulled(self, grasp: tuple[Section, Place], start: FloatArray, end: FloatArray) -> Section:
        """Return the section with another size."""
        section, place = grasp
        size = pulled_size(self.seen, section, place, (start, end))
        return section.sized(rounded(size, section.size))
