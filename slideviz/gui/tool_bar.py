"""The tool bar: the actions used most, what the cells are coloured by, and the zone."""

from __future__ import annotations

from collections.abc import Mapping

from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QAction
from qtpy.QtWidgets import QLabel, QMenu, QSizePolicy, QToolBar, QToolButton, QWidget

from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.icons import icon
from slideviz.gui.widgets.tips import TIPS, wrapped
from slideviz.session import changes
from slideviz.session.state import Session
from slideviz.terms import COLOUR_BY, labels

FIRST = ("open", "save_mesh", "save_case", "save_picture")
SHOWN = ("edges", "undeformed", "motion_ghost", "legend", "perspective")
"""What is shown or not; the axes are seldom switched, and the room is needed."""
SIDES = {"+x": "X", "+y": "Y", "+z": "Z", "iso": "Iso"}


class ToolBar(QToolBar):
    """Buttons for actions that there are already, by name.

    Attributes
    ----------
    colour, zone : Choice
    """

    def __init__(self, window, by_name: Mapping[str, QAction], colours: QMenu) -> None:
        super().__init__("Tools")
        self.setObjectName("tools")
        self.setMovable(False)
        self.setIconSize(QSize(20, 20))
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self._add(by_name, *FIRST)
        self._add(by_name, "undo", "redo")
        self._add_colour(window.store)
        self._add_range(colours)
        self._add(by_name, *SHOWN)
        for side, text in SIDES.items():
            by_name[f"side{side}"].setIconText(text)
        self._add(by_name, "fit", *(f"side{side}" for side in SIDES), separator=False)
        space = QWidget()
        space.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(space)
        self._add_zone(window.files.open_zone)

    def _add(self, by_name: Mapping[str, QAction], *names: str, separator: bool = True) -> None:
        for name in names:
            self.addAction(by_name[name])
        if separator:
            self.addSeparator()

    def _add_colour(self, store) -> None:
        self.addWidget(QLabel(" Colour by "))
        self.colour = Choice(labels(COLOUR_BY))
        self.colour.setObjectName("colour_by")
        self.colour.setToolTip(
            "What the colours of the view say; the panel Display has their range."
        )
        self.colour.chosen.connect(lambda value: store.change(changes.set_view, colour_by=value))
        self.addWidget(self.colour)

    def _add_range(self, colours: QMenu) -> None:
        self.range = QToolButton()
        self.range.setObjectName("colour_range")
        self.range.setToolTip(wrapped(TIPS["colours"]))
        self.range.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.range.setMenu(colours)
        self.addWidget(self.range)
        self.addSeparator()

    def take_theme(self, colour: str) -> None:
        """Redraw the icons that no action has, in another colour."""
        self.range.setIcon(icon("colours", colour))

    def _add_zone(self, open_zone) -> None:
        self.zone = Choice({})
        self.zone.setObjectName("zone")
        self.zone.setToolTip("Which zone of the file is open.")
        self.zone.chosen.connect(open_zone)
        self.zone_label = self.addWidget(QLabel(" Zone "))
        self.zone_shown = self.addWidget(self.zone)

    def sync(self, session: Session) -> None:
        """Show the session."""
        opened = session.mesh is not None
        self.colour.setEnabled(opened)
        self.range.setEnabled(opened and session.view.colour_by != "role")
        self.colour.show_value(session.view.colour_by)
        zones = session.mesh.zones if opened else 1
        if self.zone.count() != zones:
            self.zone.clear()
            for zone in range(1, zones + 1):
                self.zone.addItem(f"{zone} of {zones}", zone)
        self.zone.show_value(session.mesh.zone if opened else 1)
        for shown in (self.zone_label, self.zone_shown):
            shown.setVisible(zones > 1)
