"""The list of runs draws the line below a run whole."""

from qtpy.QtCore import QEvent, QObject
from qtpy.QtWidgets import QTreeWidgetItem

from slideviz.gui.panels.runs import RUN, WORDS, RunTree


class Paints(QObject):
    """Collects the rectangles that are drawn again."""

    def __init__(self):
        super().__init__()
        self.widths = []

    def eventFilter(self, _watched, event):  # noqa: N802  (Qt's name)
        if event.type() == QEvent.Type.Paint:
            self.widths.append(event.region().boundingRect().width())
        return False


def test_words_that_change_are_drawn_again_over_the_whole_width(qtbot):
    tree = RunTree()
    qtbot.addWidget(tree)
    item = QTreeWidgetItem(["1  pseudo sliding", "0.5", "0.9", "0"])
    item.setData(RUN, WORDS, "5 steps")
    tree.addTopLevelItem(item)
    tree.resize(300, 200)
    with qtbot.waitExposed(tree):
        tree.show()
    qtbot.wait(50)
    paints = Paints()
    tree.viewport().installEventFilter(paints)
    item.setData(RUN, WORDS, "beside · 5 steps · 218 nodes · 1.2 s")
    qtbot.waitUntil(lambda: bool(paints.widths))
    assert max(paints.widths) == tree.viewport().width()
