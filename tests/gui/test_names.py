"""Names that look like rich text are shown as they are written."""

import pytest
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QLabel, QMessageBox

from slideviz.gui.start import StartPage
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.labels import wrapped

pytestmark = pytest.mark.usefixtures("unpainted")

NAME = '<b>wing</b><img src="a.png">'
ask_replace = questions.ask_replace
ask_overwrite_input = questions.ask_overwrite_input


def test_tooltips_show_names_as_they_are(qtbot):
    tip = wrapped(f"{NAME}\nhides it")
    assert "<b>" not in tip
    assert "&lt;b&gt;wing" in tip
    assert wrapped("a < b") == "a < b"


@pytest.mark.parametrize("ask", [ask_replace, ask_overwrite_input])
def test_questions_show_names_as_they_are(window, tmp_path, monkeypatch, ask):
    shown = []

    def run(box):
        shown.append((box.textFormat(), box.text()))
        return QMessageBox.StandardButton.Cancel

    monkeypatch.setattr(QMessageBox, "exec", run)
    path = tmp_path / NAME.replace("/", "")
    assert not ask(window, [path] if ask is ask_replace else path)
    ((form, text),) = shown
    assert form == Qt.TextFormat.PlainText
    assert path.name in text


def test_labels_do_not_guess(window, tmp_path):
    guessing = [
        label.text()
        for label in window.findChildren(QLabel)
        if label.textFormat() == Qt.TextFormat.AutoText
    ]
    assert guessing == []
    page = StartPage({}, window)
    page.show_recent([tmp_path / "<i>a.su2"])
    texts = [label.text() for label in page.findChildren(QLabel)]
    assert "<b>&lt;i&gt;a.su2</b>" in texts
