"""The flat views of a section beside the 3D views: unrolled, along its normal, or as a curve."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure
from qtpy.QtCore import QPoint, QRectF, Qt, Signal
from qtpy.QtGui import QPainter, QPaintEvent, QPalette
from qtpy.QtWidgets import QGridLayout, QHBoxLayout, QSplitter, QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.panels.curves import CurveCanvas
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.viewing import CellMouse, TitleBar, Viewing
from slideviz.gui.widgets.build import ALIGN_RIGHT, ElidedLabel, in_column, set_policy
from slideviz.gui.widgets.plot_canvas import Draw, PlotArea
from slideviz.plots.section_curve import CurveRow, draw_curves, labels_of
from slideviz.plots.section_paint import Paint, shown_paint
from slideviz.plots.session_plots import SectionCurveMaker, facts_of
from slideviz.plots.style import Style
from slideviz.plots.ticks import ticks
from slideviz.scene.flat_scene import FlatScene
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.panes import second_session
from slideviz.session.placed import points_near
from slideviz.session.section_cuts import Cuts, can_cut
from slideviz.session.state import Session
from slideviz.session.store import Store


class Ruler(QWidget):
    """The ruler of one axis of a flat view.

    ``upright``: vertical, left of the view; otherwise horizontal, below it.
    """

    def __init__(self, upright: bool) -> None:
        super().__init__()
        self.upright = upright
        self.low = 0.0
        self.high = 1.0
        self.name = ""
        if upright:
            self.setFixedWidth(58)
        else:
            self.setFixedHeight(34)

    def show_range(self, low: float, high: float, name: str) -> None:
        """Set the ends of the axis and its name."""
        if (low, high, name) != (self.low, self.high, self.name):
            self.low = low
            self.high = high
            self.name = name
            self.update()

    def ticks(self) -> list[float]:
        length = self.height() if self.upright else self.width()
        room, least = (34, 15) if self.upright else (70, 50)
        most = max(length // room, 2)
        ticks = nice_ticks(self.low, self.high, most)
        for more in range(most + 1, most + 6):
            # One tick does not show the scale: try closer ones, if their numbers do not touch.
            if len(ticks) > 1:
                break
            closer = nice_ticks(self.low, self.high, more)
            apart = closer[1] - closer[0] if len(closer) > 1 else 0.0
            if apart * length >= least * (self.high - self.low):
                ticks = closer
        return ticks

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setPen(self.palette().color(QPalette.ColorRole.WindowText))
        font = painter.font()
        font.setPointSizeF(max(font.pointSizeF() - 1.0, 7.0))
        painter.setFont(font)
        ticks = self.ticks()
        step = ticks[1] - ticks[0] if len(ticks) > 1 else self.high - self.low
        for value in ticks:
            share = (value - self.low) / (self.high - self.low)
            self._draw_tick(painter, share, tick_text(value, step))
        self._draw_name(painter)
        painter.end()

    def _draw_tick(self, painter: QPainter, share: float, text: str) -> None:
        wide = self.width()
        high = self.height()
        if self.upright:
            y = high * (1.0 - share)
            painter.drawLine(wide - 4, round(y), wide - 1, round(y))
            top = min(max(y - 8.0, 0.0), high - 16.0)
            painter.drawText(QRectF(14, top, wide - 20, 16), ALIGN_RIGHT, text)
        else:
            x = wide * share
            painter.drawLine(round(x), 0, round(x), 3)
            # Near an end the number is shifted, so that it is not cut off.
            half = painter.fontMetrics().horizontalAdvance(text) / 2.0 + 1.0
            middle = min(max(x, half), wide - half)
            box = QRectF(middle - 35, 3, 70, 15)
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)

    def _draw_name(self, painter: QPainter) -> None:
        centre = Qt.AlignmentFlag.AlignCenter
        if not self.upright:
            painter.drawText(QRectF(0, 17, self.width(), 16), centre, self.name)
            return
        painter.translate(8, self.height() / 2.0)
        painter.rotate(-90)
        painter.drawText(QRectF(-self.height() / 2.0, -8, self.height(), 16), centre, self.name)


def nice_ticks(low: float, high: float, most: int) -> list[float]:
    """Return ascending round numbers in a range, at most ``most`` + 1; none if it is invalid."""
    if not (math.isfinite(low) and math.isfinite(high) and high > low):
        return []
    return ticks(low, high, most).tolist()


def tick_text(value: float, step: float) -> str:
    """Return a tick's number with as many decimals as the distance of the ticks needs."""
    if abs(value) < 1e-9 * step:
        return "0"
    size = max(abs(value), step)
    if not 1e-4 <= size < 1e5:
        return f"{value:.4g}"
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    # A step of 0.25 needs one decimal more than 0.1.
    exact = abs(round(step, digits) - step) < 1e-6 * step
    return f"{value:.{digits + (not exact)}f}"


FRAME_PX = 110  # height of the title, the ruler and the margins around a flat section, in pixels


class FlatViews(QWidget):
    """The flat views of one section: one per 3D view, linked; of a 2D mesh, the curves along it.

    ``viewing``: the 3D views, whose cuts are shown here too. ``multi_samples``: samples per pixel
    for antialiasing; 0 for none.
    """

    closed = Signal()

    def __init__(self, viewing: Viewing, scheme: ColorScheme, multi_samples: int) -> None:
        super().__init__()
        self.setObjectName("flats")
        self.viewing = viewing
        self.scheme = scheme
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
        other = second_session(session)
        first_pane = session, self.viewing.scene.sections.cuts
        second_pane = None if other is None else (other, self.viewing.second_cuts)
        if session.mesh.dim == 2:
            self._show_curve(
                [first_pane] if second_pane is None else [first_pane, second_pane], section
            )
            return
        if not isinstance(self.first, FlatView):
            self.first = self._make(first_pane[1])
        if second_pane is None:
            self._drop_second()
        elif self.second is None:
            self.second = self._make(second_pane[1])
            self.first.link(self.second)
        if second_pane is None or self.second is None:
            self.first.show_section(session, section)
            return
        self.first.show_section(session, section, pane_name(session))
        self.second.show_section(second_pane[0], section, pane_name(second_pane[0]))
        stacked = self.extent is not None and is_larger_stacked(
            self.extent, (self.width(), self.height())
        )
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
        view.view.reduce_effects()
        return view

    def _drop_second(self) -> None:
        second = self.second
        self.second = None
        if second is not None and isinstance(self.first, FlatView):
            self.first.link(None)
            second.close_view()
            self._row.removeWidget(second)
            second.setParent(None)
            second.deleteLater()

    def set_scheme(self, scheme: ColorScheme) -> None:
        self.scheme = scheme
        for view in (self.first, self.second):
            if view is not None:
                view.set_scheme(scheme)

    def close_views(self) -> None:
        """Release the graphics resources of the flat views."""
        self._drop_second()
        if self.first is not None:
            self.first.close_view()


def pane_name(session: Session) -> str:
    """Return the name of what a view shows: ``Run 3``, or ``Undeformed``."""
    return f"Run {session.shown}" if session.view.frame and session.shown else "Undeformed"


def is_larger_stacked(extent: tuple[float, float], available: tuple[int, int]) -> bool:
    """Return whether two equal flat sections are drawn larger one above the other than in a row.

    ``extent`` (float, float): width and height of one section, in the mesh's length unit.
    ``available`` (int, int): width and height of both views together, in pixels.
    """
    wide = max(extent[0], 1e-300)
    high = max(extent[1], 1e-300)
    width, height = available
    beside = min(0.5 * width / wide, (height - FRAME_PX) / high)
    above = min(width / wide, (0.5 * height - FRAME_PX) / high)
    return above > beside


def _direction(swapped: bool, stacked: bool) -> QHBoxLayout.Direction:
    directions = QHBoxLayout.Direction
    if stacked:
        return directions.BottomToTop if swapped else directions.TopToBottom
    return directions.RightToLeft if swapped else directions.LeftToRight


NOTHING = "The section cuts no cell."  # text shown instead of the plot


class _SectionView(QWidget):
    """A view of a section, with a title and a line of facts; ``name`` begins its parts' names."""

    closed = Signal()

    def __init__(self, name: str, tip: str) -> None:
        super().__init__()
        self.setObjectName(f"{name}_view")
        self.title = TitleBar(f"{name}_title", tip)
        self.title.closed.connect(self.closed)
        self.title.show()
        self.facts = ElidedLabel()
        self.facts.setObjectName(f"{name}_facts")

    def describe(self, title: str, facts: str) -> None:
        self.title.set_text(title)
        self.facts.setText(facts)
        self.facts.setToolTip(facts)


class CurveView(_SectionView):
    """The plot of the curves along a section of a 2D mesh, one per mesh that is compared."""

    def __init__(self, store: Store, scheme: ColorScheme) -> None:
        super().__init__("curve", "Close the curve")
        self.store = store
        canvas = CurveCanvas(self.drawing)
        self.save_button = self.title.add_button(
            "picture",
            "Save the curve as PNG, SVG or PDF…",
            lambda: canvas.save("along_section", "Save curve"),
        )
        self.area = PlotArea(canvas)
        canvas.picked = self._picked
        canvas.setToolTip("Click to mark the cell at a place.")
        in_column(self.title, self.facts, self.area, wide=[self.area], spacing=0, on=self)
        self._made = SectionCurveMaker()
        self.rows: tuple[CurveRow, ...] = ()
        self._draw: Draw = lambda _figure, _style: None
        self.set_scheme(scheme)

    def show_section(self, shown: Sequence[tuple[Session, Cuts]], section: Section) -> None:
        """Show the curves along a section, given each view's session and cuts, the first first."""
        session, cuts = shown[0]
        self.rows = self._made.of(shown, section)
        paint = shown_paint(session)
        self._draw = partial(_draw, self.rows, labels_of(section, paint), paint)
        self.describe(section.describe(2), facts_of(session, cuts, section))
        self.save_button.setEnabled(bool(self.rows))
        if self.rows:
            self.area.plot()
        else:
            self.area.show_text(NOTHING)

    def drawing(self) -> Draw:
        return self._draw

    def set_scheme(self, scheme: ColorScheme) -> None:
        self.area.canvas.set_scheme(scheme)

    def close_view(self) -> None:
        self.rows = ()

    def _picked(self, position: float) -> None:
        if self.rows and not self.area.shows_text:
            self.store.change(changes.mark_cell, self.rows[-1].curve.cell_at(position))


def _draw(
    rows: Sequence[CurveRow], labels: tuple[str, str], paint: Paint, figure: Figure, style: Style
) -> None:
    if rows:
        draw_curves(figure.add_subplot(), rows, labels, style, paint)


class FlatView(_SectionView):
    """The view of a section laid flat, with rulers, a line of facts, and buttons to fit and close.

    ``cuts``: the cuts of the 3D view, shared with it. ``multi_samples``: samples per pixel for
    antialiasing; 0 for none.
    """

    def __init__(self, store: Store, cuts: Cuts, scheme: ColorScheme, multi_samples: int) -> None:
        super().__init__("flat", "Close the flat view")
        self.fit_button = self.title.add_button("fit", "Make the section fill this view", self.fit)
        self.view = View3D(self, multi_samples=multi_samples)
        self.view.setMinimumSize(120, 80)
        set_policy(self.view, "Ignored", "Ignored")
        self.view.set_flat(True)
        self.scene = FlatScene(self.view, cuts, scheme)
        self.across = Ruler(False)
        self.upright = Ruler(True)
        self._partner: FlatView | None = None
        self._fitted: object = ()
        self._ranges: object = ()
        grid = QGridLayout()
        grid.setSpacing(0)
        grid.addWidget(self.upright, 0, 0)
        grid.addWidget(self.view, 0, 1)
        grid.addWidget(self.across, 1, 1)
        grid.setColumnStretch(1, 1)
        grid.setRowStretch(0, 1)
        in_column(self.title, self.facts, grid, wide=[grid], spacing=0, on=self)
        self.view.signals.zoomed.connect(self._zoomed)
        self.view.signals.resized.connect(self._resized)
        self._refit = single_shot(self, self.fit)
        CellMouse(self.view, self.scene, store)
        # The rulers follow the camera, whether the mouse or the program moves it.
        moved = self._camera_moved
        self._watching = self.view.camera.AddObserver("ModifiedEvent", lambda *_: moved())
        self.set_scheme(scheme)

    def link(self, other: FlatView | None) -> None:
        """Link the camera with that of another flat view; None ends the link."""
        for one, partner in ((self._partner, None), (self, other), (other, self)):
            if one is not None:
                one._partner = partner
                one.scene.beside = partner.scene if partner is not None else None

    def show_section(self, session: Session, section: Section, called: str = "") -> None:
        """Show a section of the session's shown frame, titled with ``called``.

        The camera stays for a section that was only moved; another section is fitted to the view.
        """
        self.scene.update(session, section)
        words = section.describe()
        self.describe(f"{called}: {words}" if called else words, self.scene.summary)
        about = section.origin if section.terms.point else ()
        kind = (session.mesh, section.kind, section.direction, about, session.view.passages)
        if kind != self._fitted:
            self._fitted = kind
            self._refit.start()
        elif self.scene.ranges() == self._ranges:
            # The camera was not moved since the last fit: a larger radius is fitted again.
            self._fit()
        self._sync_rulers()
        self.view.render_soon()

    def fit(self) -> None:
        """Make the section fill the view."""
        self._fit()
        self._sync_rulers()
        self.view.render()

    def refit(self) -> None:
        """Make the section fill the view, unless the camera was moved since the last fit."""
        if self.scene.ranges() == self._ranges:
            self.fit()

    def _fit(self) -> None:
        self.scene.fit()
        for one in (self, self._partner):
            if one is not None:
                one._ranges = one.scene.ranges()

    def _camera_moved(self) -> None:
        self._sync_rulers()
        partner = self._partner
        # Drawing sets the clipping planes, which modifies the camera but does not move it.
        if partner is not None and not partner.scene.camera.looks_like(self.scene.camera):
            partner.scene.camera.copy_from(self.scene.camera)
            partner.view.render_soon()

    def set_scheme(self, scheme: ColorScheme) -> None:
        self.scene.set_scheme(scheme)
        self.view.render()

    def close_view(self) -> None:
        self._refit.stop()
        self.view.camera.RemoveObserver(self._watching)
        self.view.close()

    def _resized(self) -> None:
        if self.scene.section is not None:
            self._refit.start()

    def _zoomed(self, where: QPoint, factor: float) -> None:
        x, y = self.view.to_pixels(where)
        self.scene.camera.zoom_at(x, y, factor)
        self.view.render()

    def _sync_rulers(self) -> None:
        if self.scene.section is None:
            return
        spans = self.scene.ranges()
        rulers = (self.across, self.upright)
        for ruler, reach, label in zip(rulers, spans, self.scene.labels, strict=True):
            length = ruler.height() if ruler.upright else ruler.width()
            fits = ruler.fontMetrics().horizontalAdvance(label.full) < length
            ruler.show_range(*reach, label.full if fits else label.short)


BESIDE_PX = 1000
"""Width of the splitter, in pixels, below which the flat view is always below the 3D view."""

_SHARE = 9 / 20  # largest part of the splitter's length that the flat view gets
_LONG = 1.5
"""Ratio of the drawn sizes, below to beside, from which the flat view goes below the 3D view."""


class SectionViews(QSplitter):
    """The 3D views, and beside or below them the flat views of the selected section."""

    def __init__(self, viewing: Viewing, multi_samples: int, parent: QWidget) -> None:
        super().__init__(Qt.Orientation.Vertical, parent, childrenCollapsible=False)
        self.viewing = viewing
        self.store = viewing.store
        self.addWidget(viewing)
        self._multi_samples = multi_samples
        self.flats: FlatViews | None = None
        """The flat views; None while no section is laid flat."""
        self._kind: object = ()
        self.scheme = viewing.scene.scheme
        """The colors of the flat views."""
        self.store.listen(self._session_changed)

    # What is wanted --------------------------------------------------------------------
    @property
    def section(self) -> Section | None:
        return self.store.session.view.section

    @property
    def flat(self) -> FlatView | CurveView | None:
        """Return the flat view of the first 3D view (of a 2D mesh the curve), or None."""
        return None if self.flats is None else self.flats.first

    @property
    def is_flat(self) -> bool:
        return self.section is not None and self.section.flat

    def want_flat(self, wanted: bool) -> None:
        """Lay the selected section flat beside the 3D view; False: lay none flat."""
        if wanted != self.is_flat or not wanted:
            at = self.store.session.view.section_index if wanted else None
            self.store.change(changes.lay_flat, at)

    def look_along(self) -> None:
        """Turn the camera to face the selected section, from outside if it is about an axis."""
        section = self.section
        session = self.store.session
        if section is None or session.frame is None or session.frame.mesh.dim == 2:
            return
        scene = self.viewing.scene
        points = points_near(section, session.frame.mesh, scene.sections.cuts)
        rows = section.facing(points)
        camera = scene.plotter.camera
        camera.position = np.asarray(camera.focal_point) + rows[2] * camera.distance
        camera.up = rows[1]
        self.viewing.fit()

    # What is shown ---------------------------------------------------------------------
    def _session_changed(self, old: Session, new: Session) -> None:
        another = old.mesh is not new.mesh
        if another:
            # A 2D mesh has a curve where a 3D one has flat views.
            self._drop_flats()
        if another or self.flats is not None or old.view.sections != new.view.sections:
            self._sync_flat(new)

    def redraw(self) -> None:
        """Draw the sections again, after their cells were read from the mesh's file."""
        session = self.store.session
        self.viewing.sync(session, session)
        self._sync_flat(session)

    def _sync_flat(self, session: Session) -> None:
        at = session.view.flat_index
        section = session.view.sections[at] if at is not None else None
        if section is None or session.frame is None or not can_cut(session.mesh, section):
            self._drop_flats()
            return
        made = self.flats is None
        if self.flats is None:
            self.flats = FlatViews(self.viewing, self.scheme, self._multi_samples)
            self.flats.closed.connect(lambda: self.want_flat(False))
        sees_all = self.viewing.scene.camera.sees_all()
        if made:
            self.addWidget(self.flats)
        self.flats.show_section(session, section)
        # A change of the radius must not rearrange the views.
        compared = second_session(session) is not None
        kind = (session.mesh, compared, section.kind, section.direction, session.view.passages)
        if made or kind != self._kind:
            self._kind = kind
            self._arrange(self.flats.extent, compared)
            if sees_all:
                self.viewing.fit()

    def _arrange(self, extent: tuple[float, float] | None, compared: bool) -> None:
        """Put the flat view beside or below the 3D view, whichever draws its section larger.

        It is always below if two views are compared, and for a curve (``extent`` None).
        """
        wide = False
        share = _SHARE
        if extent is not None and not compared:
            wide, share = arrangement_for(extent, (self.width(), self.height()))
        self.setOrientation(Qt.Orientation.Horizontal if wide else Qt.Orientation.Vertical)
        size = self.width() if wide else self.height()
        flat = round(share * size)
        self.setSizes([size - flat, flat])

    def _drop_flats(self) -> None:
        flats = self.flats
        self.flats = None
        if flats is None:
            return
        sees_all = self.viewing.scene.camera.sees_all()
        flats.close_views()
        flats.setParent(None)
        flats.deleteLater()
        if sees_all:
            self.viewing.fit()

    def set_scheme(self, scheme: ColorScheme) -> None:
        self.scheme = scheme
        if self.flats is not None:
            self.flats.set_scheme(scheme)

    def close_views(self) -> None:
        """Release the graphics resources; call this before the 3D views are closed."""
        if self.flats is not None:
            self.flats.close_views()
            self.flats = None


def arrangement_for(extent: tuple[float, float], available: tuple[int, int]) -> tuple[bool, float]:
    """Return whether a flat section goes beside the 3D view (else below), and its part of the room.

    ``extent`` (float, float): width and height of the section, in the mesh's length unit.
    ``available`` (int, int): width and height of the 3D view and the flat view together, in pixels.
    """
    wide, high = np.maximum(extent, 1e-300)
    width, height = np.maximum(available, 1)
    beside_scale = min(_SHARE * width / wide, height / high)
    below_scale = min(width / wide, _SHARE * height / high)
    if width >= BESIDE_PX and below_scale < _LONG * beside_scale:
        return True, _SHARE
    # A long, low section does not fill the share: the 3D view gets the rest.
    needed = (high / wide * width + FRAME_PX) / height
    return False, float(np.clip(needed, 0.6 * _SHARE, _SHARE))
