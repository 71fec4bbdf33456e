"""The base of all panels."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtWidgets import QWidget

from slideviz.color_scheme import ColorScheme
from slideviz.gui.widgets.plot_canvas import PlotCanvas
from slideviz.session.run_messages import Requirement
from slideviz.session.state import Session
from slideviz.session.store import Store


class Panel(QWidget):
    """A widget of a dock that shows the session and changes it.

    Its `sync` is the only code that fills its widgets; `follow`, when they are made, calls it.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        super().__init__()
        self.store = store

    def follow(self, concerns: Callable[[Session, Session], bool] = lambda *_: True) -> None:
        """Show the session now, and after each change for which ``concerns(old, new)`` holds."""

        def changed(old: Session, new: Session) -> None:
            if concerns(old, new):
                self.sync(new)

        self.store.listen(changed)
        self.sync(self.store.session)

    def sync(self, session: Session) -> None:
        """Show the session."""
        raise NotImplementedError

    def take_theme(self, scheme: ColorScheme) -> None:
        """Draw plots, and what palette and icons do not reach, in the colours of another theme."""
        for canvas in self.findChildren(PlotCanvas):
            canvas.set_scheme(scheme)

    def lead_to(self, missing: Requirement) -> None:
        """Put the cursor into the field for a requirement of a run."""
