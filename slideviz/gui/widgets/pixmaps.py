"""Qt images for previews and the clipboard."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from qtpy.QtCore import QSize, Qt
from qtpy.QtGui import QColor, QImage, QPainter, QPixmap
from qtpy.QtWidgets import QApplication, QLabel

from slideviz.export.offscreen_renderer import OffscreenRenderer

LARGE = 50_000
"""Number of cells above which a preview is drawn at the size it is shown, not twice as large."""


def to_image(pixels: np.ndarray) -> QImage:
    """Return an image of pixels (height, width, 3 or 4) uint8, copied."""
    height, width, depth = pixels.shape
    kind = QImage.Format.Format_RGBA8888 if depth == 4 else QImage.Format.Format_RGB888
    return QImage(pixels.tobytes(), width, height, depth * width, kind).copy()


def drawn_for(renderer: OffscreenRenderer, box: tuple[int, int]) -> tuple[int, int]:
    """Return the size in pixels at which a preview is drawn, given its box.

    It is twice the box, as lines are at least a pixel wide; of a large mesh, which is slow to
    draw, the box itself.
    """
    mesh = renderer.session.mesh
    times = 1 if mesh is not None and len(mesh.cells) > LARGE else 2
    return times * box[0], times * box[1]


def fitted(image: QImage, box: tuple[int, int]) -> QImage:
    """Return an image scaled to fit into a box (width, height), its aspect ratio kept."""
    keep = Qt.AspectRatioMode.KeepAspectRatio
    smooth = Qt.TransformationMode.SmoothTransformation
    return image.scaled(QSize(*box), keep, smooth)


def framed(image: QImage) -> QPixmap:
    """Return a pixmap of an image in a thin frame, its transparent parts on a chequerboard."""
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
    """Return a label of fixed size for a framed picture in a box (width, height) of pixels."""
    label = QLabel()
    label.setFixedSize(box[0] + 2, box[1] + 2)
    label.setAlignment(Qt.AlignmentFlag.AlignCenter)
    label.setAccessibleName(name)
    return label


@contextmanager
def wait_cursor() -> Iterator[None]:
    """Show the wait cursor within the context."""
    QApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)
    try:
        yield
    finally:
        QApplication.restoreOverrideCursor()


def copy_image(image: QImage) -> None:
    """Put an image on the clipboard."""
    QApplication.clipboard().setImage(image)
