"""Both themes can be read: words about inverted cells, and the boxes in lists."""

import re
from pathlib import Path

import pytest
from qtpy.QtGui import QColor, QPalette
from qtpy.QtWidgets import QApplication

from slideviz.gui.viewport.player import result_parts
from slideviz.gui.widgets import theme
from slideviz.mesh.quality import quality
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from tests.builders import square


@pytest.fixture
def themed(qapp):
    yield theme.apply
    theme.apply("light")


def luminance(color):
    parts = (QColor(color).redF(), QColor(color).greenF(), QColor(color).blueF())
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    """The ratio of WCAG 2.2; 4.5 is enough for letters, 3 for signs."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("name", ["light", "dark"])
def test_words_about_inverted_cells_can_be_read(themed, name):
    themed(name)
    palette = QApplication.palette()
    for role in (
        QPalette.ColorRole.Window,
        QPalette.ColorRole.Base,
        QPalette.ColorRole.ToolTipBase,
    ):
        assert contrast(theme.alarm(), palette.color(role)) > 4.5
    mesh = square(4)
    points = mesh.points.copy()
    points[mesh.points.prod(axis=1).argmax()] = -3.0
    session = open_mesh(
        StepFrame(mesh.with_points(points), quality(mesh.with_points(points))), None
    )
    assert session.frame.quality.inverted
    assert theme.alarm() in result_parts(session)[0][0]


@pytest.mark.parametrize("name", ["light", "dark"])
@pytest.mark.parametrize("kind", ["QListView", "QTableView", "QCheckBox"])
def test_boxes_stand_out_from_what_is_around_them(themed, name, kind):
    themed(name)
    palette = QApplication.palette(kind)
    # Fusion draws the frame of a box so much darker than the color of windows.
    frame = palette.color(QPalette.ColorRole.Window).darker(140)
    assert contrast(frame, palette.color(QPalette.ColorRole.Base)) > 2.9


@pytest.mark.parametrize("name", ["light", "dark"])
def test_the_signs_of_docks_are_there(themed, name):
    themed(name)
    signs = re.findall(r'url\("(.*?)"\)', QApplication.instance().styleSheet())
    assert len(signs) == 2
    assert all(Path(sign).is_file() for sign in signs), signs
