"""The curves: quality by step, by fraction of the motion and by span, convergence, gaps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from math import floor
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from qtpy.QtCore import QPointF, Qt
from qtpy.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen

from slideviz.color_scheme import INVERTED_COLOR, SELECTED_COLOR
from slideviz.errors import SlidevizError
from slideviz.gui.widgets.build import Choice, as_widget, check_box, in_column, in_row, push_button
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.plot_canvas import Draw, PlotArea, PlotCanvas
from slideviz.mesh.model import FloatArray
from slideviz.plots import session_plots as curves
from slideviz.plots.draw import convergence, quality_by_step
from slideviz.plots.gap_curves import draw_gaps
from slideviz.plots.spanwise import Profile, spanwise
from slideviz.plots.style import Style, add_legend, style_axes
from slideviz.plots.ticks import rounded_out
from slideviz.session import changes
from slideviz.session.reach import can_scale, factor_of, reach_of, reach_run
from slideviz.session.run_messages import Requirement
from slideviz.session.state import Session

KINDS = {
    "steps": "Quality by step",
    "reach": "How far may I go",
    "greedy": "Convergence",
    "span": "Along the span",
    "meridional": "Meridional view",
    "gaps": "Throat and gaps",
}
"""The plots that can be chosen."""

TIPS = {
    "steps": "Minimum and mean quality against the step; click at a step to go there.",
    "reach": "Lowest quality against the fraction of the run's motion, and up to where all cells "
    "are proved valid. Drag to scale the motion.",
    "greedy": "Largest error against control nodes, as the greedy selection adds them.",
    "span": "Quality in layers over the span, or along an axis.",
    "meridional": "Mean of the cells around the axis, by their place in the plane of z and r.",
    "gaps": "Smallest distance between neighbouring blades by span, and between blades and walls.",
}
WHAT = {"minimum": "minimum", "mean": "mean"}


class CurveCanvas(PlotCanvas):
    """A plot that calls ``picked`` with the value of the horizontal axis where it is clicked.

    While ``draggable``, a line with this value, in percent, follows the mouse until then.
    """

    picked: Callable[[float], None]
    draggable = False
    _line: float | None = None

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self.draggable and event.buttons() & Qt.MouseButton.LeftButton and self._has_axes:
            self._line = event.position().x()
            self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        was_dragged = self._line is not None
        self._line = None
        self.update()
        left = event.button() == Qt.MouseButton.LeftButton
        if left and self._has_axes and was_dragged >= self.draggable:
            self.picked(self.to_value(event.position().x()))

    @property
    def _has_axes(self) -> bool:
        return not self.wiped and bool(self.figure.axes)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self._line is None or not self._has_axes:
            return
        painter = QPainter(self)
        top, height = self.axes_rows()
        painter.setPen(QPen(QColor(SELECTED_COLOR), 2.0))
        painter.drawLine(QPointF(self._line, top), QPointF(self._line, top + height))
        words = f" {self.to_value(self._line):.0f} % "
        painter.setPen(QColor(self.scheme.text))
        wide = painter.fontMetrics().horizontalAdvance(words)
        at = QPointF(min(self._line, self.width() - wide), top + 0.5 * height)
        painter.drawText(at, words)
        painter.end()


class CurvesPanel(Panel):
    """The panel with one of the plots of `KINDS`."""

    def make(self) -> None:
        self.canvas = CurveCanvas(self.drawing)
        self.area = PlotArea(self.canvas)
        self.canvas.picked = self._picked
        self.kind = Choice(KINDS, name="curve_kind", tips=TIPS)
        self.kind.setMinimumContentsLength(4)
        self.kind.chosen.connect(lambda _: self._other_plot())
        self.save = push_button("Save…", "Save the plot as PNG, SVG or PDF.", self._save)
        self.whole = check_box(
            "0–1",
            "Show all possible qualities instead of the qualities of the curves.",
            lambda _: self.canvas.request_draw(),
            "whole_quality",
        )
        head = in_row(self.kind, self.whole, self.save, wide=[self.kind])
        self.what = Choice(WHAT, "The lowest or the mean quality of each layer.")
        self.coordinate = Choice(
            {},
            "What the layers of the undeformed mesh are counted along; the radius is measured from "
            "the axis of the case.",
        )
        both = (self.what, self.coordinate)
        for choice in both:
            choice.chosen.connect(lambda _: self._other_plot())
        self.span_row = as_widget(in_row(*both, wide=both))
        parts = (head, self.area, self.span_row)
        in_column(*parts, wide=[self.area], spacing=3, on=self, margins=4)
        self.follow(lambda session: session.mesh, self._offer_coordinates)
        self.follow(_shown)

    def focus_requirement(self, _missing: Requirement) -> None:
        """Show how far the motion of the shown run may go."""
        self.kind.show_value("reach")
        self._other_plot()

    # State to widgets ------------------------------------------------------------------
    def sync(self, session: Session) -> None:
        kind = self.kind.currentData()
        missing = self._missing(session, kind)
        self.kind.setToolTip(TIPS[kind])
        self.span_row.setVisible(kind == "span" and not missing)
        self.whole.setVisible(kind in ("steps", "reach", "span") and not missing)
        self.save.setEnabled(not missing)
        run = session.run_shown
        self.canvas.draggable = kind == "reach" and run is not None and can_scale(run.case.motions)
        shapes = {"steps": Qt.CursorShape.PointingHandCursor}
        if self.canvas.draggable:
            shapes["reach"] = Qt.CursorShape.SplitHCursor
        self.canvas.setCursor(shapes.get(kind, Qt.CursorShape.ArrowCursor))
        self.canvas.setToolTip(TIPS[kind] if kind in shapes else "")
        if missing:
            self.area.show_text(missing)
        else:
            self.area.plot()

    def _offer_coordinates(self, session: Session) -> None:
        self.coordinate.offer(curves.coordinates(session))
        self.coordinate.show_value(curves.usual_coordinate(session))

    def _missing(self, session: Session, kind: str) -> str:
        """Return why the session has no plot of a kind; an empty text if it has one."""
        if session.mesh is None:
            return "Open a mesh first. Then this panel shows the curves of its runs."
        if kind in ("span", "reach", "meridional", "gaps") and session.lacks_cells:
            return session.lacks_cells
        if kind == "reach" and reach_run(session) is None:
            return "Run the case to see how far its motion may go."
        if kind == "steps" and not curves.step_runs(session):
            return "Run the case to see minimum and mean quality of each step."
        if kind == "greedy" and curves.greedy_run(session) is None:
            if session.run_shown is None or not session.run_shown.frames:
                return "Run the case with data reduction to see how its error falls."
            if session.view.frame == 0:
                return "The undeformed mesh is shown: go to a step to see how its error fell."
            return (
                "This step used all boundary nodes. With data reduction (panel Method) "
                "you see here how the error falls as control nodes are added."
            )
        return ""

    # Drawing ---------------------------------------------------------------------------
    def drawing(self) -> Draw:
        session = self.session
        kind = self.kind.currentData()
        if self._missing(session, kind):
            return lambda _figure, _style: None
        whole = self.whole.isChecked()
        if kind == "greedy":
            return partial(draw_greedy, session)
        if kind == "steps":
            return partial(draw_steps, session, whole)
        if kind == "reach":
            return partial(draw_reach, session, whole)
        if kind == "meridional":
            return partial(draw_or_say, partial(curves.draw_meridional_view, session))
        if kind == "gaps":
            return partial(draw_or_say, partial(draw_measured, session))
        coordinate = self.coordinate.currentData()
        what = self.what.currentData()
        find = partial(curves.profiles, session, coordinate)
        return partial(draw_or_say, partial(draw_span, find, coordinate, what, whole))

    def show_kind(self, kind: str) -> None:
        """Show a plot of `KINDS`."""
        self.kind.show_value(kind)
        self._other_plot()

    # What the user does ----------------------------------------------------------------
    def _other_plot(self) -> None:
        """Draw the newly selected plot; wipe the old one first, as its axes are other ones."""
        self.canvas.wipe()
        self.sync(self.session)

    def _picked(self, value: float) -> None:
        if self.kind.currentData() == "steps" and not self.area.shows_text:
            self.change(changes.show_frame, round(value))
        elif self.canvas.draggable and round(value) > 0:
            self.change(changes.scale_motions, part=round(value) / 100)

    def _save(self) -> None:
        self.canvas.save(self.kind.currentText().lower().replace(" ", "_"))


def _shown(session: Session) -> object:
    case = session.case
    view = session.view.color_by, session.view.color_map, session.view.color_range
    of_case = case.around_span, case.motions
    return session.frame, session.runs, session.shown, view, of_case


def close_limits(values: Iterable[FloatArray]) -> tuple[float, float]:
    """Return the limits of an axis that fits the values: round numbers, and 4 % of margin."""
    good = np.concatenate(list(values))
    low, high = rounded_out(float(np.nanmin(good)), float(np.nanmax(good)))
    room = 0.04 * (high - low)
    return low - room, high + room


def draw_steps(session: Session, whole: bool, figure: Figure, style: Style) -> None:
    """Draw minimum and mean quality of each run against the step, with a line at the shown step.

    ``whole``: the axis shows all qualities from 0 to 1 rather than those of the curves.
    """
    axes = figure.add_subplot()
    runs = curves.step_runs(session)
    quality_by_step(axes, runs, style)
    if not whole:
        axes.set_ylim(close_limits(part for run in runs for part in (run.minimum, run.mean)))
    at = session.view.frame
    axes.axvline(at, color=SELECTED_COLOR, linewidth=2.0, zorder=0.5, gid="shown")
    last = max(len(run.frames) for run in session.runs)
    axes.set_xlim(-0.03 * last, 1.03 * last)


def draw_reach(session: Session, whole: bool, figure: Figure, style: Style) -> None:
    """Draw the lowest quality against the fraction of the motion, and the end of what is proved."""
    axes = figure.add_subplot()
    found = reach_of(session)
    run = reach_run(session)
    assert run is not None
    style_axes(axes, style, "fraction of the motion [%]", "lowest quality [-]")
    look = style.series(curves.series_of(run))
    axes.plot(100 * found.fractions, found.lowest, color=look.color, linewidth=style.width, gid="q")
    axes.axvline(100.0, color=style.scheme.edge, linewidth=1.0, zorder=0.5)
    factor = factor_of(session.case.motions, run.case.motions)
    if factor is not None and factor != 1:
        axes.axvline(100 * factor, color=SELECTED_COLOR, linewidth=2.0, zorder=0.5, gid="typed")
    end = 100 * found.safe.fraction
    axes.set_xlim(0.0, 100 * found.fractions[-1])
    axes.set_ylim((0.0, 1.0) if whole else (0.0, 1.1 * max(found.lowest.max(), 0.1)))
    axes.set_title(run.label, **style.letters)
    if end <= 100 * found.fractions[-1]:
        axes.axvline(end, color=INVERTED_COLOR, linewidth=2.0, gid="proved")
        words = f"proved up to {floor(10 * end) / 10:g} %"
        left = end > 50 * found.fractions[-1]
        axes.annotate(
            words, (end, 1.0), xycoords=axes.get_xaxis_transform(),
            xytext=(-4 if left else 4, -3), textcoords="offset points",
            ha="right" if left else "left", va="top", fontsize=style.size, color=INVERTED_COLOR,
        )  # fmt: skip


def draw_or_say(draw: Draw, figure: Figure, style: Style) -> None:
    """Call ``draw(figure, style)``; if it raises SlidevizError, draw the text of that instead."""
    try:
        draw(figure, style)
    except SlidevizError as error:
        say(str(error), figure, style)


def say(text: str, figure: Figure, style: Style) -> None:
    """Draw a text in the middle of a figure, without axes to be seen."""
    figure.add_subplot().set_axis_off()
    figure.text(
        0.5, 0.5, text, ha="center", va="center", wrap=True,
        **style.letters,
    )  # fmt: skip


def draw_measured(session: Session, figure: Figure, style: Style) -> None:
    """Draw throat and gaps of the undeformed mesh and of the shown step; as text without span."""
    measured = curves.gaps_of(session)
    if any(gap.along for gap in measured[0][2]):
        draw_gaps(figure, measured, style)
        return
    lines = [
        f"{label}: {gap.words} {gap.distance:.6g}" for label, _, found in measured for gap in found
    ]
    say("\n".join(lines) or "There is one blade, which does not repeat.", figure, style)


def draw_greedy(session: Session, figure: Figure, style: Style) -> None:
    """Draw the greedy selection of the shown step: its error against control nodes."""
    axes = figure.add_subplot()
    run = curves.greedy_run(session)
    assert run is not None
    convergence(axes, [run], style=style)
    axes.set_title(run.label, **style.letters)


def draw_span(
    find: Callable[[], list[Profile]],
    coordinate: curves.Coordinate,
    what: Literal["minimum", "mean"],
    whole: bool,
    figure: Figure,
    style: Style,
) -> None:
    """Draw the lowest or mean quality along a coordinate; ``find`` returns the profiles."""
    profiles = find()
    axes = figure.add_subplot()
    spanwise(axes, profiles, what, style=style)
    unit = "-" if coordinate == "span" else "mesh units"
    axes.yaxis.label.set_text(f"{coordinate} before deformation [{unit}]")
    if not whole:
        axes.set_xlim(close_limits(getattr(profile, what) for profile in profiles))
    add_legend(axes, style, loc="best")
