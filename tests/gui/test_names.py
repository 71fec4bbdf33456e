"""Names that look like rich text are shown as they are written."""

import pytest
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QFileDialog, QLabel, QMessageBox

from slideviz.gui.panels.run import _shortened
from slideviz.gui.start import StartPage
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import tool_button, wrapped
from slideviz.gui.widgets.plot_canvas import PLOT_FILTERS

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

NAME = '<b>wing</b><img src="a.png">'
ask_replace = questions.ask_replace
ask_save = questions.ask_save
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


@pytest.mark.parametrize(
    ("filters", "chosen", "typed", "expected"),
    [
        ("Table (*.csv)", "Table (*.csv)", "mesh.su2", "mesh.su2.csv"),
        ("Table (*.csv)", "Table (*.csv)", "runs", "runs.csv"),
        ("Table (*.csv)", "Table (*.csv)", "v1.5", "v1.5.csv"),
        ("Table (*.csv)", "Table (*.csv)", "runs.CSV", "runs.CSV"),
        ("Case (*.cfg)", "Case (*.cfg)", "a.su2", "a.su2.cfg"),
        (PLOT_FILTERS, "SVG drawing (*.svg)", "plot.pdf", "plot.pdf"),
        (PLOT_FILTERS, "SVG drawing (*.svg)", "plot.cfg", "plot.cfg.svg"),
        ("SU2 (*.su2);;VTK (*.vtu)", "VTK (*.vtu)", "a.su2", "a.su2"),
    ],
)
def test_a_file_is_never_saved_under_the_suffix_of_another_kind(
    monkeypatch, tmp_path, filters, chosen, typed, expected
):
    name = str(tmp_path / typed)
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, **__: (name, chosen))
    asked = []
    monkeypatch.setattr(questions, "ask_replace", lambda _, paths: asked.append(paths) or True)
    found = ask_save(None, "Save", tmp_path / "default.csv", filters)
    assert found == tmp_path / expected
    # The dialog has asked only about the name that was typed.
    assert not asked
    found.touch()
    assert ask_save(None, "Save", tmp_path / "default.csv", filters) == found
    assert asked == [] if expected == typed else [[found]]


@pytest.mark.parametrize("inside", ["(hub: none; shroud: none)", "(a (b; c); d)", ""])
def test_a_sentence_is_not_cut_within_brackets(inside):
    begin = f"The names of boundaries do not say between which the span goes {inside}".strip()
    text = f"{begin}; name two of {', '.join(f'wall{k}' for k in range(20))}."
    assert _shortened(text) == f"{begin}."
    assert _shortened("a; b.") == "a; b."


@pytest.mark.window("own")
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


def test_a_button_with_a_picture_alone_has_a_name_for_screen_readers(qtbot):
    for text, name in (("", "Remove the run (Delete)"), ("Remove", "")):
        button = tool_button("Remove the run (Delete)", image="remove", text=text)
        qtbot.addWidget(button)
        assert button.accessibleName() == name
