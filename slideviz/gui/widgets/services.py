"""The interface of the window for panels and dialogs, which do not import the window."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qtpy.QtCore import QSettings
from qtpy.QtWidgets import QMainWindow, QWidget

from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.widgets.banner import Banner
from slideviz.session.store import Store

if TYPE_CHECKING:
    from slideviz.gui.dialogs.exports import Exports
    from slideviz.gui.docks import Docks
    from slideviz.gui.files import Files
    from slideviz.gui.running import Running
    from slideviz.gui.viewport.flat_views import SectionViews
    from slideviz.gui.viewport.viewing import Viewing


class Services(QMainWindow):
    """The window as panels and dialogs see it: the base of `slideviz.gui.window.MainWindow`."""

    store: Store
    """Holds the session; all changes of it go through the store."""
    settings: QSettings
    """The settings kept from one start to the next."""
    banner: Banner
    """Shows errors and messages above the view."""
    running: Running
    """Starts jobs and runs."""
    runner: JobRunner
    """Runs the job; ``busy`` while there is one."""
    files: Files
    """Opens and saves; knows the folder and the stem of file names that dialogs offer."""
    exports: Exports
    viewing: Viewing
    section_views: SectionViews
    """`exports`, `viewing`, `section_views`: what writes pictures, films and more; the 3D views;
    the flat views of the selected section."""
    dock_manager: Docks
    """The docks with the panels."""

    def show_status(self, text: str) -> None:
        """Show a short message in the status bar; an empty text clears it."""
        raise NotImplementedError


def main_window(widget: QWidget | None) -> Services | None:
    """Return the main window that a widget belongs to, even in a floating dock; else None."""
    while widget is not None and not isinstance(widget, Services):
        widget = widget.parentWidget()
    return widget
