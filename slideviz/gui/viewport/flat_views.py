"""The flat view of a section beside the 3D view: unrolled, or seen along its normal."""

from __future__ import annotations

from qtpy.QtCore import QPoint, Signal
from qtpy.QtWidgets import QGridLayout, QSizePolicy, QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.viewport.linked_views import TitleBar
from slideviz.gui.viewport.canvas import View3D
from slideviz.gui.viewport.view_mouse import CellMouse
from slideviz.gui.widgets.build import in_column
from slideviz.gui.widgets.labels import ElidedLabel
from slideviz.gui.widgets.ruler import Ruler
from slideviz.scene.flat_scene import FlatScene
from slideviz.sections.model import Section
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import Session
from slideviz.session.store import Store


class FlatView(QWidget):
    """The view of a section laid flat, with rulers, a line of facts, and buttons to fit and close.

    Parameters
    ----------
    store : Store
    cuts : Cuts
        The cuts of the 3D view, shared with it.
    scheme : ColorScheme
    multi_samples : int
        Samples per pixel for antialiasing; 0 for none.
    """

    closed = Signal()

    def __init__(
        self, store: Store, cuts: Cuts, scheme: ColorScheme, multi_samples: int = 4
    ) -> None:
        super().__init__()
        self.setObjectName("flat_view")
        self.title = TitleBar("flat_title", "Close the flat view")
        self.title.closed.connect(self.closed)
        self.title.show()
        self.fit_button = self.title.add_button("fit", "Make the section fill this view", self.fit)
        self.facts = ElidedLabel()
        self.facts.setObjectName("flat_facts")
        self.view = View3D(self, multi_samples=multi_samples)
        self.view.setMinimumSize(120, 80)
        self.view.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        self.view.set_flat(True)
        self.scene = FlatScene(self.view, cuts, scheme)
        self.across, self.upright = Ruler(False), Ruler(True)
        self._partner: FlatView | None = None
        self._fitted: tuple[object, ...] = ()
        self._ranges: tuple[object, ...] = ()
        self._place()
        self._connect(store)
        self.set_scheme(scheme)

    def _place(self) -> None:
        grid = QGridLayout()
        grid.setSpacing(0)
        grid.addWidget(self.upright, 0, 0)
        grid.addWidget(self.view, 0, 1)
        grid.addWidget(self.across, 1, 1)
        grid.setColumnStretch(1, 1)
        grid.setRowStretch(0, 1)
        in_column(self.title, self.facts, grid, wide=[grid], spacing=0, on=self)

    def _connect(self, store: Store) -> None:
        self.view.signals.zoomed.connect(self._zoomed)
        self.view.signals.resized.connect(self._resized)
        self._refit = later(self, self.fit)
        CellMouse(self.view, self.scene, store)
        # The rulers follow the camera, whether the mouse or the program moves it.
        self._watching = self.view.camera.AddObserver("ModifiedEvent", lambda *_: self._looked())

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
        self.title.set_text(f"{called}: {words}" if called else words)
        self.facts.setText(self.scene.summary)
        self.facts.setToolTip(self.scene.summary)
        about = section.origin if section.shape.terms.point else ()
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

    def _looked(self) -> None:
        """Update the rulers and the linked view after the camera changed."""
        self._sync_rulers()
        partner = self._partner
        # Drawing sets the clipping planes, which modifies the camera but does not move it.
        if partner is not None and not partner.scene.camera.looks_like(self.scene.camera):
            partner.scene.camera.take(self.scene.camera)
            partner.view.render_soon()

    def set_scheme(self, scheme: ColorScheme) -> None:
        """Draw in another color scheme."""
        self.scene.set_scheme(scheme)
        self.view.render()

    def close_view(self) -> None:
        """Release the graphics resources."""
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
