"""Draw the icon as PNG files of the usual sizes: ``icons.py FOLDER``, of a hicolor theme."""

from __future__ import annotations

import sys
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgRenderer

import slideviz

SIZES = (16, 24, 32, 48, 64, 128, 256)

if __name__ == "__main__":
    drawing = QSvgRenderer(str(Path(slideviz.__file__).parent / "gui/desktop/slideviz.svg"))
    for size in SIZES:
        image = QImage(size, size, QImage.Format.Format_ARGB32)
        image.fill(Qt.GlobalColor.transparent)
        painter = QPainter(image)
        drawing.render(painter)
        painter.end()
        folder = Path(sys.argv[1]) / f"{size}x{size}" / "apps"
        folder.mkdir(parents=True, exist_ok=True)
        if not image.save(str(folder / "slideviz.png")):
            sys.exit(f"icons: {folder} cannot be written")
