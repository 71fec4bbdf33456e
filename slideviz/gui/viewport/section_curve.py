"""The plot beside the view of a 2D mesh: the colored quantity along a line or circle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from matplotlib.figure import Figure
from qtpy.QtCore import Signal
from qtpy.QtWidgets import QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.panels.curves import CurveCanvas
from slideviz.gui.viewport.linked_views import TitleBar
from slideviz.gui.widgets.build import in_column
from slideviz.gui.widgets.labels import ElidedLabel
from slideviz.gui.widgets.plot_canvas import PlotArea, ask_and_write_plot
from slideviz.gui.widgets.plot_image import Draw
from slideviz.plots.section_curve import Colors, CurveRow, draw_curves
from slideviz.plots.section_rows import CurveRows, colors_of, facts_of, labels_of
from slideviz.plots.style import Style
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import Session
from slideviz.session.store import Store

NOTHING = "The section cuts no cell."
"""Text shown instead of the plot."""


class CurveView(QWidget):
    """The plot of the curves along a section of a 2D mesh, one per mesh that is compared.

    Parameters
    ----------
    store : Store
    scheme : ColorScheme
    """

    closed = Signal()

    def __init__(self, store: Store, scheme: ColorScheme) -> None:
        super().__init__()
        self.setObjectName("curve_view")
        self.store = store
        self.title = TitleBar("curve_title", "Close the curve")
        self.title.closed.connect(self.closed)
        self.title.show()
        self.save_button = self.title.add_button(
            "picture", "Save the curve as PNG, SVG or PDF…", self._save
        )
        self.facts = ElidedLabel()
        self.facts.setObjectName("curve_facts")
        canvas = CurveCanvas(self.drawing)
        self.area = PlotArea(canvas)
        canvas.picked = self._picked
        canvas.setToolTip("Click to mark the cell at a place.")
        in_column(self.title, self.facts, self.area, wide=[self.area], spacing=0, on=self)
        self._made = CurveRows()
        self.rows: tuple[CurveRow, ...] = ()
        self._labels, self._colors = ("", ""), Colors()
        self.set_scheme(scheme)

    def show_section(self, shown: Sequence[tuple[Session, Cuts]], section: Section) -> None:
        """Show the curves along a section, given each view's session and cuts, the first first."""
        session, cuts = shown[0]
        self.rows = self._made.of(shown, section)
        self._labels, self._colors = labels_of(session, section), colors_of(session)
        self.title.set_text(section.describe(2))
        facts = facts_of(session, cuts, section)
        self.facts.setText(facts)
        self.facts.setToolTip(facts)
        self.save_button.setEnabled(bool(self.rows))
        if self.rows:
            self.area.plot()
        else:
            self.area.say(NOTHING)

    def drawing(self) -> Draw:
        """Return a function that draws the present curves into a figure."""
        return partial(_draw, self.rows, self._labels, self._colors)

    def set_scheme(self, scheme: ColorScheme) -> None:
        """Draw in another color scheme."""
        self.area.canvas.set_scheme(scheme)

    def close_view(self) -> None:
        """Drop the curves."""
        self.rows = ()

    def _picked(self, position: float) -> None:
        """Mark the cell at a position along the last curve, of the shown run; none beside it."""
        if self.rows and not self.area.empty:
            self.store.change(changes.mark_cell, self.rows[-1].curve.cell_at(position))

    def _save(self) -> None:
        ask_and_write_plot(self, "Save curve", "along_section", self.drawing())


def _draw(
    rows: Sequence[CurveRow],
    labels: tuple[str, str],
    colors: Colors,
    figure: Figure,
    style: Style,
) -> None:
    if rows:
        draw_curves(figure.add_subplot(), rows, labels, style, colors)
