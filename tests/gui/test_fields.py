"""Fields of numbers: what is shown, and what is kept."""

import pytest
from qtpy.QtCore import QEvent, Qt
from qtpy.QtGui import QColor, QFocusEvent, QKeyEvent, QPalette
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QToolTip

from slideviz.case.motions.rigid import Rotate, Scale
from slideviz.gui.widgets import theme
from slideviz.gui.widgets.build import Choice
from slideviz.gui.widgets.fields import NumberBox, NumberField, TextField, VectorField, short_text

pytestmark = pytest.mark.window("shared")

NONE = Qt.KeyboardModifier.NoModifier
THIRD = 0.005596983152812345


@pytest.fixture
def field(qtbot):
    made = NumberField(THIRD)
    qtbot.addWidget(made)
    return made


def test_six_digits_are_shown_and_all_are_kept(field):
    assert field.text() == "0.00559698"
    assert field.cursorPosition() == 0
    assert field.value == THIRD
    assert not field.problem


def test_every_digit_is_there_to_be_edited(field):
    told = []
    field.changed.connect(told.append)
    field.hasFocus = lambda: True
    field.focusInEvent(QFocusEvent(QFocusEvent.Type.FocusIn))
    assert field.text() == repr(THIRD)
    field.hasFocus = lambda: False
    field.focusOutEvent(QFocusEvent(QFocusEvent.Type.FocusOut))
    assert field.text() == "0.00559698"
    assert field.value == THIRD, "looking does not round"
    assert told == []
    field.selectAll()
    QTest.keyClicks(field, "2.5")
    assert (field.value, told[-1]) == (2.5, 2.5)


@pytest.mark.parametrize(
    ("typed", "value"),
    [("360*2", 720.0), ("360/7 + 1", 360 / 7 + 1), ("-(1,5 - 4)*2e1", 50.0), ("007", 7.0)],
)
def test_sums_and_products_are_worked_out(qtbot, typed, value):
    made, told = NumberField(1.0), []
    qtbot.addWidget(made)
    made.changed.connect(told.append)
    made.selectAll()
    QTest.keyClicks(made, typed)
    assert not made.problem
    QTest.keyClick(made, Qt.Key.Key_Return)
    assert (made.value, told[-1]) == (value, value)
    made.focusOutEvent(QFocusEvent(QFocusEvent.Type.FocusOut))
    assert made.text() == short_text(value)


@pytest.mark.parametrize("typed", ["2**9", "1/0", "(" * 300, "1e999*0", "9" * 400 + "*9", "1 2"])
def test_what_has_no_value_is_not_worked_out(qtbot, typed):
    made = NumberField(1.0)
    qtbot.addWidget(made)
    made.setText(typed)
    made.textEdited.emit(typed)
    assert "number" in made.problem
    assert made.value == 1.0


@pytest.mark.parametrize("typed", ["0.0.945", "12e", "", "-", "abc", "0x10"])
def test_an_invalid_text_stays_and_its_value_is_the_one_from_before(qtbot, typed):
    made, told = NumberField(0.949), []
    qtbot.addWidget(made)
    made.changed.connect(told.append)
    made.selectAll()
    QTest.keyClick(made, Qt.Key.Key_Backspace)
    QTest.keyClicks(made, typed)
    assert made.text() == typed
    made.editingFinished.emit()
    made.focusOutEvent(QFocusEvent(QFocusEvent.Type.FocusOut))
    assert (made.text(), made.value) == (typed, 0.949), "no valid beginning of what was typed"
    assert (told or [0.949])[-1] == 0.949
    assert made.property("bad")
    assert made.fault in made.toolTip()
    made.show_value(0.949)  # as the session does after any change
    assert made.text() == typed
    made.show_value(0.5)
    assert (made.text(), made.fault) == ("0.5", "")
    QTest.keyClicks(made, "..")
    made.editingFinished.emit()
    assert made.value == 0.5, "the last one that was left valid"
    QTest.keyClick(made, Qt.Key.Key_Escape)
    assert (made.text(), made.value, made.fault) == ("0.5", 0.5, "")


def is_typed(box, text):
    """Type a text into a box; return whether all its letters were the box's own."""
    own = True
    for letter in text:
        override = QKeyEvent(QEvent.Type.ShortcutOverride, ord(letter.upper()), NONE, letter)
        own = box.event(override) and override.isAccepted() and own
        QTest.keyClicks(box, letter)
    return own


@pytest.mark.parametrize("typed", ["2.5", "-4", "360*2", "abc", "99", ""])
def test_a_whole_number_loses_no_character(qtbot, typed):
    box, told = NumberBox(), []
    qtbot.addWidget(box)
    box.setRange(1, 40)
    box.setValue(7)
    box.valueChanged.connect(told.append)
    box.focusInEvent(QFocusEvent(QFocusEvent.Type.FocusIn))
    box.selectAll()
    QTest.keyClick(box, Qt.Key.Key_Backspace)
    assert is_typed(box, typed), "no letter is a shortcut of the window"
    QTest.keyClick(box, Qt.Key.Key_Return)
    box.focusOutEvent(QFocusEvent(QFocusEvent.Type.FocusOut))
    assert (box.text(), box.value()) == (typed, 7)
    assert (told or [7])[-1] == 7
    words = f"“{typed}” is not a whole number from 1 to 40" if typed else "a number is needed"
    assert (box.fault, box.toolTip(), box.property("bad")) == (words, words, True)
    box.show_value(7)
    assert box.text() == typed
    QTest.keyClick(box, Qt.Key.Key_Escape)
    assert (box.text(), box.value(), box.fault) == ("7", 7, "")


def test_a_double_click_selects_the_whole_number(qtbot):
    made = NumberField(0.949)
    qtbot.addWidget(made)
    made.show()
    where = made.cursorRect().center()
    QTest.mouseClick(made, Qt.MouseButton.LeftButton, pos=where)
    QTest.mouseDClick(made, Qt.MouseButton.LeftButton, pos=where)
    assert made.selectedText() == "0.949"
    # A third click changes nothing of that; a later one puts the cursor there.
    QTest.mouseClick(made, Qt.MouseButton.LeftButton, pos=where)
    assert made.selectedText() == "0.949"
    QTest.keyClicks(made, "2")
    assert made.value == 2.0
    QTest.mouseClick(
        made, Qt.MouseButton.LeftButton, pos=where, delay=2 * QApplication.doubleClickInterval()
    )
    assert made.selectedText() == ""


def test_a_list_opens_at_its_value_after_escape(qtbot):
    choice = Choice({"none": "none", "ps": "pseudo sliding", "ds": "direct sliding"})
    qtbot.addWidget(choice)
    choice.show_value("ps")
    choice.show()
    view = choice.view()
    choice.showPopup()
    first = view.window().y()
    view.setCurrentIndex(view.model().index(2, 0))  # as the mouse does that passes over it
    QTest.keyClick(view, Qt.Key.Key_Escape)
    assert choice.currentData() == "ps"
    choice.showPopup()
    assert view.currentIndex().row() == 1
    assert view.window().y() == first, "the value lies below the mouse that opened the list"
    choice.hidePopup()


def test_short_numbers_are_shown_as_they_are():
    assert short_text(1234567.0) == "1234567"
    assert short_text(-0.25) == "-0.25"
    assert short_text(3.7e-13) == "3.7e-13"
    assert short_text(3.7e-13, scale=0.1) == "0"
    assert short_text(-0.0) == "0"


def test_what_rounding_left_of_zero_is_shown_as_zero(qtbot):
    fields = VectorField((0.0, 0.0, 0.0))
    qtbot.addWidget(fields)
    fields.show_value((0.05, 3.72047013e-13, -0.03))
    assert [one.text() for one in fields.fields] == ["0.05", "0", "-0.03"]
    assert fields.value[1] == 3.72047013e-13
    fields.show_value((0.0, 3.72047013e-13, 0.0))
    assert fields.fields[1].text() == "3.72047e-13"
    fields.set_scale(1.0)
    assert fields.fields[1].text() == "0"


def contrast(one: QColor, other: QColor) -> float:
    """Return the contrast of two colors (WCAG 2.1)."""

    def light(color: QColor) -> float:
        parts = [color.redF(), color.greenF(), color.blueF()]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((light(one), light(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("name", ["light", "dark"])
def test_tool_tips_and_boxes_stand_out_in_every_theme(qtbot, name):
    theme.apply("dark" if name == "light" else "light")
    theme.apply(name)
    role = QPalette.ColorRole
    tip = QToolTip.palette()
    assert contrast(tip.color(role.ToolTipBase), tip.color(role.ToolTipText)) > 7
    sheet = QApplication.instance().styleSheet()
    assert f"background: {tip.color(role.ToolTipBase).name()}" in sheet
    window = QApplication.palette().color(role.Window)
    base = QApplication.palette().color(role.Base)
    for kind in theme.FRAMED:
        outline = QApplication.palette(kind).color(role.Window).darker(140)
        assert min(contrast(outline, window), contrast(outline, base)) >= 2.9, kind
    theme.apply("system")


def test_a_narrow_choice_ends_with_an_ellipsis_and_its_list_shows_every_word(qtbot):
    choice = Choice({"a": "a", "b": "airfoil.rotate.angle_deg   (now -8)"})
    qtbot.addWidget(choice)
    choice.resize(120, choice.sizeHint().height())
    with qtbot.waitExposed(choice):
        choice.show()
    assert choice.shown == "a"
    before = choice.grab().toImage()
    choice.setCurrentIndex(1)
    assert choice.shown.endswith("…")
    assert choice.grab().toImage() != before
    choice.showPopup()
    assert choice.view().width() >= choice.fontMetrics().horizontalAdvance(choice.itemText(1))
    choice.hidePopup()


def test_a_word_for_the_lowest_number_can_be_typed(qtbot):
    box, told = NumberBox(), []
    qtbot.addWidget(box)
    box.setRange(0, 40)
    box.setSpecialValueText("automatic")
    box.setValue(5)
    box.valueChanged.connect(told.append)
    box.selectAll()
    assert is_typed(box, "auto")
    assert (box.text(), told, box.fault) == ("automatic", [0], "")
    box.selectAll()
    QTest.keyClicks(box, "12")
    assert told[-1] == 12


@pytest.mark.window("own")
@pytest.mark.parametrize("kind", ["text", "number", "whole"])
def test_ctrl_z_and_ctrl_y_act_on_what_is_typed(driver, kind):
    """And not on the window, whose last change may be about something that is not seen."""
    store, window = driver.window.store, driver.window
    box = {"text": TextField, "number": NumberField, "whole": NumberBox}[kind]()
    box.setParent(window)
    box.show()
    box.setFocus()
    driver.qtbot.waitUntil(box.hasFocus)
    edit = box.lineEdit() if kind == "whole" else box
    edit.selectAll()
    QTest.keyClicks(box, "7")
    store.redo = store.undo = lambda: pytest.fail("the window was asked")
    window.actions_table.by_name["redo"].setEnabled(True)
    window.actions_table.by_name["undo"].setEnabled(True)
    QTest.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert edit.text() != "7"
    QTest.keyClick(box, Qt.Key.Key_Y, Qt.KeyboardModifier.ControlModifier)
    assert edit.text() == "7"
    QTest.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    asked = []
    store.redo, store.undo = (lambda: asked.append("redo")), (lambda: asked.append("undo"))
    QTest.keyClick(box, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClick(box, Qt.Key.Key_Y, Qt.KeyboardModifier.ControlModifier)
    assert asked == ["undo", "redo"], "nothing of its own is left"


@pytest.mark.window("own")
def test_what_a_field_takes_back_is_no_new_change(driver, sample_folder, qtbot):
    driver.open(sample_folder / "passage" / "passage.cfg")
    window, store = driver.window, driver.window.store
    window.motions.list.setCurrentRow(0)
    now = [0.0]
    store._clock = lambda: now[0]
    before = store.session.case.motions[0]
    assert isinstance(before, Rotate)
    editor = window.motions.editor
    driver.choose(editor.kind, Scale)
    made = store.session.case.motions[0]
    field = editor.factors.fields[0]
    field.setFocus()
    qtbot.waitUntil(field.hasFocus)
    field.selectAll()
    for letter in "-16":
        now[0] += 60.0  # each is a change of its own
        QTest.keyClicks(field, letter)
    assert store.session.case.motions[0].factors[0] == -16.0
    now[0] += 60.0
    QTest.keyClick(field, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert store.session.case.motions[0] == made
    QTest.keyClick(field, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert store.session.case.motions[0] == before, "the window undoes the change before"


def test_a_text_that_is_not_valid_withdraws_its_valid_beginning(driver, sample_folder, qtbot):
    driver.open(sample_folder / "passage" / "passage.cfg")
    window, store = driver.window, driver.window.store
    window.motions.list.setCurrentRow(0)
    before, words = store.session.case, store.can_undo
    field = window.motions.editor.angle
    field.setFocus()
    qtbot.waitUntil(field.hasFocus)
    field.selectAll()
    QTest.keyClicks(field, "0.04")
    assert store.session.case.motions[0].angle_deg == 0.04
    QTest.keyClicks(field, "abc")
    assert store.session.case == before
    assert "-8" in window.motions.list.item(0).text().replace("−", "-")
    QTest.keyClick(field, Qt.Key.Key_Escape)
    assert (field.text(), store.session.case) == ("-8", before)
    assert "Invalid" not in window.statusBar().currentMessage()
    assert store.can_undo == words, "nothing that undo would bring back"
