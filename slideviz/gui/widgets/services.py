"""The services of the window that panels and dialogs use, without knowing the window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QSettings
from qtpy.QtWidgets import QMainWindow, QWidget

from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.gui.widgets.banner import Banner
from slideviz.session.store import Store

if TYPE_CHECKING:
    from slideviz.gui.docks import Docks
    from slideviz.gui.files import Files
    from slideviz.gui.running import Running
    from slideviz.gui.viewport.section_views import SectionViews
    from slideviz.gui.viewport.viewing import Viewing


class Services(QMainWindow):
    """The window as panels and dialogs see it: the base of `slideviz.gui.window.MainWindow`.

    Attributes
    ----------
    store : Store
        What is open and shown; everything is changed through it.
    settings : QSettings
        What is kept from one start to the next.
    banner : Banner
        Tells what went wrong.
    running : Running
        Starts jobs and runs.
    runner : JobRunner
        Tells whether one runs.
    files : Files
        Where file dialogs start, and what the files that they offer begin with.
    viewing, section_views
        The views of the mesh, and of the section that is laid flat.
    docks_ : Docks
        The panels.
    """

    store: Store
    settings: QSettings
    banner: Banner
    running: Running
    runner: JobRunner
    files: Files
    viewing: Viewing
    section_views: SectionViews
    docks_: Docks

    def say(self, text: str) -> None:
        """Show a short message in the status bar; an empty one takes it away."""
        raise NotImplementedError


def main_window(widget: QWidget | None) -> Services | None:
    """Return slideviz's window around a widget, also where its dock floats."""
    while widget is not None and not isinstance(widget, Services):
        widget = widget.parentWidget()
    return widget


def folder_of(widget: QWidget) -> Path:
    """Return the folder in which file dialogs start."""
    window = main_window(widget)
    return window.files.folder() if window is not None else Path.home()
