"""Labels in little room end with an ellipsis and keep their words."""

import numpy as np
import pytest
from qtpy.QtCore import QEvent, QPoint, Qt
from qtpy.QtGui import QHelpEvent
from qtpy.QtWidgets import QApplication, QListWidget, QToolTip

from slideviz.gui.widgets.build import Choice, ElidedLabel, elide_items

WORDS = "size-skew: min 0.8218, mean 0.9302; 1,608 cells cut"


@pytest.fixture
def label(qtbot):
    label = ElidedLabel(WORDS)
    qtbot.addWidget(label)
    label.show()
    return label


def ink(label):
    """The columns that something is written in."""
    image = label.grab().toImage().convertToFormat(label.grab().toImage().Format.Format_Grayscale8)
    rows = np.array(image.constBits()).reshape(image.height(), image.bytesPerLine())
    pixels = rows[:, : image.width()].astype(int)
    return np.flatnonzero(np.ptp(pixels, axis=0) > 40)


def test_what_fits_is_shown_whole(label):
    label.resize(600, 20)
    assert label.shown == WORDS
    columns = ink(label)
    assert abs((columns[0] + columns[-1]) / 2.0 - 300) < 4, "centred"


def test_what_does_not_fit_ends_with_an_ellipsis_within_the_label(label):
    label.resize(150, 20)
    assert label.text() == WORDS
    assert label.shown.startswith("size-skew: min")
    assert label.shown.endswith("…")
    columns = ink(label)
    assert columns[-1] < 150
    # The first letters are there: nothing is cut off at the left.
    label.setAlignment(Qt.AlignmentFlag.AlignLeft)
    assert ink(label)[0] < 6


def test_a_long_text_makes_nothing_wider(label):
    label.resize(100, 20)
    assert label.minimumSizeHint().width() <= label.sizeHint().width()
    assert label.sizePolicy().horizontalPolicy() == label.sizePolicy().Policy.Ignored


def test_items_of_a_list_end_where_it_does(qtbot):
    box = QListWidget()
    box.addItems([WORDS, "short"])
    elide_items(box)
    qtbot.addWidget(box)
    box.resize(150, 80)
    box.show()
    assert box.horizontalScrollBar().maximum() == 0
    assert box.visualItemRect(box.item(0)).width() == box.viewport().width()
    assert box.sizeHintForRow(0) > 10, "as high as before"


@pytest.mark.parametrize("wide", [60, 400])
def test_a_list_that_is_too_narrow_shows_its_text_in_the_tooltip(qtbot, wide):
    choice = Choice({"a": "symmetry <1> of the wing"}, "The root.")
    choice.resize(wide, 24)
    qtbot.addWidget(choice)
    with qtbot.waitExposed(choice):
        choice.show()
    choice.resize(wide, 24)
    place = QPoint(5, 5)
    help_ = QHelpEvent(QEvent.Type.ToolTip, place, choice.mapToGlobal(place))
    QApplication.sendEvent(choice, help_)
    whole = "symmetry &lt;1&gt; of the wing<br>The root."
    assert QToolTip.text() == (whole if wide < 100 else "The root.")
    QToolTip.hideText()
