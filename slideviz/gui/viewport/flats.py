"""The flat views beside the 3D views: one section, of one run or of two that are compared."""

from __future__ import annotations

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QHBoxLayout, QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.viewport.section_curve import CurveView
from slideviz.gui.viewport.flat_views import FlatView
from slideviz.gui.viewport.viewing import Viewing
from slideviz.sections.model import Section
from slideviz.session.changes import UNDEFORMED, second_view
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import Session

FRAME_PX = 110
"""Height of the title, the ruler and the margins around a flat section, in pixels."""


class FlatViews(QWidget):
    """The flat views of one section: one per 3D view, linked; of a 2D mesh, the curves along it.

    Parameters
    ----------
    viewing : Viewing
        The 3D views, whose cuts are shown here too.
    scheme : ColorScheme
    multi_samples : int
        Samples per pixel for antialiasing; 0 for none.
    """

    closed = Signal()

    def __init__(self, viewing: Viewing, scheme: ColorScheme, multi_samples: int) -> None:
        super().__init__()
        self.setObjectName("flats")
        self.viewing, self.scheme = viewing, scheme
        self._multi_samples = multi_samples
        self.first: FlatView | CurveView | None = None
        """`first`, `second`: the flat views of the first and the second 3D view, each None if there
        is none. The curves of a 2D mesh are one view, ``first``."""
        self.second: FlatView | None = None
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(2)

    def show_section(self, session: Session, section: Section) -> None:
        """Show a section of the mesh of each 3D view, the views made or dropped as needed."""
        assert session.mesh is not None
        other = second_session(session)
        own = session, self.viewing.scene.sections.cuts
        theirs = None if other is None else (other, self.viewing.second_cuts)
        if session.mesh.dim == 2:
            self._show_curve([own] if theirs is None else [own, theirs], section)
            return
        if not isinstance(self.first, FlatView):
            self.first = self._make(own[1])
        if theirs is None:
            self._drop_second()
        elif self.second is None:
            self.second = self._make(theirs[1])
            self.first.link(self.second)
        if theirs is None or self.second is None:
            self.first.show_section(session, section)
            return
        self.first.show_section(session, section, pane_name(session))
        self.second.show_section(theirs[0], section, pane_name(theirs[0]))
        stacked = self.extent is not None and is_larger_stacked(self.extent, (self.width(), self.height()))
        self._row.setDirection(_direction(session.view.swapped, stacked))
        self.first.refit()

    @property
    def extent(self) -> tuple[float, float] | None:
        """Return width and height of the flat section, in the mesh's length unit.

        None for a curve, and where the section cuts no cell.
        """
        box = self.first.scene.bounds() if isinstance(self.first, FlatView) else None
        if box is None:
            return None
        width, height = (box[1] - box[0]).tolist()
        return width, height

    def _show_curve(self, shown: list, section: Section) -> None:
        if not isinstance(self.first, CurveView):
            self.first = CurveView(self.viewing.store, self.scheme)
            self.first.closed.connect(self.closed)
            self._row.addWidget(self.first, 1)
        self.first.show_section(shown, section)

    def _make(self, cuts: Cuts) -> FlatView:
        view = FlatView(self.viewing.store, cuts, self.scheme, self._multi_samples)
        view.closed.connect(self.closed)
        self._row.addWidget(view, 1)
        view.show()
        view.view.spare_software()
        return view

    def _drop_second(self) -> None:
        second, self.second = self.second, None
        if second is not None and isinstance(self.first, FlatView):
            self.first.link(None)
            second.close_view()
            self._row.removeWidget(second)
            second.setParent(None)
            second.deleteLater()

    def set_scheme(self, scheme: ColorScheme) -> None:
        """Draw in another color scheme."""
        self.scheme = scheme
        for view in (self.first, self.second):
            if view is not None:
                view.set_scheme(scheme)

    def close_views(self) -> None:
        """Release the graphics resources of the flat views."""
        self._drop_second()
        if self.first is not None:
            self.first.close_view()


def second_session(session: Session) -> Session | None:
    """Return the session as the second 3D view shows it; None while there is only one view."""
    other = session.view.beside
    if other is None or (other != UNDEFORMED and session.run(other) is None):
        return None
    return second_view(session)


def pane_name(session: Session) -> str:
    """Return the name of what a view shows: ``Run 3``, or ``Undeformed``."""
    return f"Run {session.shown}" if session.view.frame and session.shown else "Undeformed"


def is_larger_stacked(extent: tuple[float, float], room: tuple[int, int]) -> bool:
    """Return whether two equal flat sections are drawn larger one above the other than in a row.

    Parameters
    ----------
    extent : (float, float)
        Width and height of one section, in the mesh's length unit.
    room : (int, int)
        Width and height of both views together, in pixels.
    """
    wide, high = (max(length, 1e-300) for length in extent)
    width, height = room
    beside = min(0.5 * width / wide, (height - FRAME_PX) / high)
    above = min(width / wide, (0.5 * height - FRAME_PX) / high)
    return above > beside


def _direction(swapped: bool, stacked: bool) -> QHBoxLayout.Direction:
    """Return the layout direction from the first flat view to the second."""
    ways = QHBoxLayout.Direction
    if stacked:
        return ways.BottomToTop if swapped else ways.TopToBottom
    return ways.RightToLeft if swapped else ways.LeftToRight
