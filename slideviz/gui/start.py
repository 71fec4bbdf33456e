"""The start page: what to do when nothing is open."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import QSize, Qt, Signal
from qtpy.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from slideviz.gui.icons import icon, logo


class StartPage(QWidget):
    """Open, the files used last, and the sample cases."""

    open_wanted = Signal()
    file_wanted = Signal(object)
    sample_wanted = Signal(str)

    def __init__(self, samples: dict[str, str], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        outer = QHBoxLayout(self)
        outer.addStretch(1)
        column = QVBoxLayout()
        column.setSpacing(8)
        outer.addLayout(column)
        outer.addStretch(1)
        column.addStretch(2)
        head = QHBoxLayout()
        picture = QLabel()
        picture.setPixmap(logo().pixmap(QSize(64, 64)))
        title = QLabel(
            "<span style='font-size:22pt; font-weight:600'>slideviz</span><br>"
            "Deform CFD meshes, and see at once where and why they suffer"
        )
        head.addWidget(picture)
        head.addSpacing(10)
        head.addWidget(title, 1)
        column.addLayout(head)
        column.addSpacing(14)
        self.open = QPushButton(icon("open", "#ffffff"), "Open a mesh or case…")
        self.open.setObjectName("run")
        self.open.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.open.clicked.connect(self.open_wanted)
        row = QHBoxLayout()
        row.addWidget(self.open)
        hint = QLabel("or drop a file here")
        hint.setProperty("hint", True)
        row.addWidget(hint)
        row.addStretch(1)
        column.addLayout(row)
        column.addSpacing(12)
        self._recent = QVBoxLayout()
        self._recent.setSpacing(2)
        column.addLayout(self._recent)
        column.addSpacing(8)
        if samples:
            column.addWidget(QLabel("<b>Sample cases</b>"))
            column.addLayout(self._sample_grid(samples))
        column.addStretch(3)

    def _sample_grid(self, samples: dict[str, str]) -> QGridLayout:
        grid = QGridLayout()
        grid.setHorizontalSpacing(14)
        grid.setVerticalSpacing(3)
        self.sample_buttons: dict[str, QPushButton] = {}
        for row, (name, text) in enumerate(samples.items()):
            button = QPushButton(name)
            button.setObjectName(f"sample_{name}")
            button.clicked.connect(lambda _=False, name=name: self.sample_wanted.emit(name))
            self.sample_buttons[name] = button
            label = QLabel(text)
            label.setProperty("hint", True)
            grid.addWidget(button, row, 0)
            grid.addWidget(label, row, 1, Qt.AlignmentFlag.AlignLeft)
        grid.setColumnStretch(1, 1)
        return grid

    def show_recent(self, paths: list[Path]) -> None:
        """List the files used last."""
        while self._recent.count():
            widget = self._recent.takeAt(0).widget()
            if widget is not None:
                widget.deleteLater()
        if not paths:
            return
        self._recent.addWidget(QLabel("<b>Recent</b>"))
        for path in paths[:4]:
            label = QLabel(f"<a href='{path}'>{path.name}</a> &nbsp;<small>{path.parent}</small>")
            label.linkActivated.connect(lambda text: self.file_wanted.emit(Path(text)))
            self._recent.addWidget(label)
