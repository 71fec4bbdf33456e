"""The base class of the panels."""

# ruff: noqa: N802, D102  (Qt's names, and its documentation)

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtWidgets import QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.widgets.plot_canvas import PlotCanvas
from slideviz.session.run_messages import Requirement
from slideviz.session.state import Session
from slideviz.session.store import Store


class Panel(QWidget):
    """The base of the widgets in the docks, which show the session and change it.

    A subclass makes its widgets, then calls `follow`; only its `sync` fills them.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        super().__init__()
        self.store = store

    def follow(self, concerns: Callable[[Session, Session], bool] = lambda *_: True) -> None:
        """Call `sync` now, and after each change for which ``concerns(old, new)`` is true."""

        def changed(old: Session, new: Session) -> None:
            if concerns(old, new):
                self.sync(new)

        self.store.listen(changed)
        self.sync(self.store.session)

    def sync(self, session: Session) -> None:
        """Fill the widgets from the session."""
        raise NotImplementedError

    def heightForWidth(self, width: int) -> int:
        # A scroll area takes this as the least height: lists in the panel shrink before it scrolls.
        layout = self.layout()
        return -1 if layout is None else layout.totalMinimumHeightForWidth(width)

    def take_theme(self, scheme: ColorScheme) -> None:
        """Draw plots again in another theme's colors; subclasses: all else without a palette."""
        for canvas in self.findChildren(PlotCanvas):
            canvas.set_scheme(scheme)

    def lead_to(self, missing: Requirement) -> None:
        """Put the cursor into the field by which a missing requirement of a run is met."""
