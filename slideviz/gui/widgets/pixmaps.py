"""Images of Qt for previews and the clipboard."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QColor, QImage, QPainter, QPixmap
from qtpy.QtWidgets import QApplication, QLabel

from slideviz.export.offscreen_renderer import OffscreenRenderer

LARGE = 50_000
"""Cells of a mesh whose preview is drawn as large as it is shown."""


def to_image(pixels: np.ndarray) -> QImage:
    """Return the image of pixels (height, width, 3 or 4), with memory of its own."""
    height, width, depth = pixels.shape
    kind = QImage.Format.Format_RGBA8888 if depth == 4 else QImage.Format.Format_RGB888
    return QImage(pixels.tobytes(), width, height, depth * width, kind).copy()


def drawn_for(renderer: OffscreenRenderer, box: tuple[int, int]) -> tuple[int, int]:
    """Return the size at which a preview is drawn: twice the box, for lines are a pixel wide.

    Not of a large mesh, which takes its time.
    """
    mesh = renderer.session.mesh
    times = 1 if mesh is not None and len(mesh.cells) > LARGE else 2
    return times * box[0], times * box[1]


def fitted(image: QImage, box: tuple[int, int]) -> QImage:
    """Return an image as large as it can be in a box."""
    keep, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
    return image.scaled(QSize(*box), keep, smooth)


def framed(image: QImage) -> QPixmap:
    """Return an image with a thin frame; what is transparent is seen as a chequerboard."""
    out = QPixmap(image.width() + 2, image.height() + 2)
    out.fill(QColor("#ffffff"))
    painter = QPainter(out)
    if image.hasAlphaChannel():
        for x in range(0, out.width(), 10):
            for y in range((x // 10) % 2 * 10, out.height(), 20):
                painter.fillRect(x, y, 10, 10, QColor("#d5d9de"))
    painter.drawImage(1, 1, image)
    painter.setPen(QColor("#9aa3ad"))
    painter.drawRect(0, 0, out.width() - 1, out.height() - 1)
    painter.end()
    return out


def preview_label(name: str, box: tuple[int, int]) -> QLabel:
    """Return a label for a framed picture that fits into a box of pixels."""
    label = QLabel()
    label.setFixedSize(box[0] + 2, box[1] + 2)
    label.setAlignment(Qt.AlignmentFlag.AlignCenter)
    label.setAccessibleName(name)
    return label


@contextmanager
def wait_cursor() -> Iterator[None]:
    """Show the wait cursor while a drawing takes a second or two."""
    QApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)
    try:
        yield
    finally:
        QApplication.restoreOverrideCursor()


def copy_image(image: QImage) -> None:
    """Put an image on the clipboard."""
    QApplication.clipboard().setImage(image)
