"""A field that shows what is not valid keeps a run from starting, by whatever way."""

import pytest
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QLineEdit

from slideviz.case.motions.rigid import Rotate, Scale, Translate
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.fields import NumberBox, NumberField
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def blade(driver, passage_file):
    """A blade that turns by 3 degrees: ready to run."""
    driver.open(passage_file)
    driver.role("airfoil", "moving")
    driver.window.store.change(changes.add_motion, Rotate("airfoil", 3.0))
    assert driver.window.run_panel.run.isEnabled()
    return driver


def type_into(field, text):
    """Type instead of what a field has, and stay in it."""
    field.setFocus()
    field.selectAll()
    QTest.keyClick(field, Qt.Key.Key_Backspace)
    QTest.keyClicks(field, text)


def try_all_ways(driver):
    """Try to start a run in every way there is; return how many did."""
    window = driver.window
    at = window.focusWidget() or window
    QTest.keyClick(at, Qt.Key.Key_F5)
    QTest.keyClick(at, Qt.Key.Key_R, Qt.KeyboardModifier.ControlModifier)
    driver.click(window.run_panel.run)
    window.actions_table.by_name["run"].trigger()
    window.start_run()
    return len(driver.session.runs)


def test_no_run_starts_with_what_was_typed_before(blade):
    window, field = blade.window, blade.window.motions.editor.angle
    for typed, told in (
        ("360**2", "Angle (°): “360**2” is not a number."),
        ("", "Angle (°): a number is needed."),
    ):
        type_into(field, typed)
        assert field.property("bad")
        assert told in window.run_panel.text.text()
        assert not window.run_panel.run.isEnabled()
        assert not window.actions_table.by_name["run"].isEnabled()
        assert try_all_ways(blade) == 0
        type_into(field, "4")
        assert window.run_panel.run.isEnabled()
        assert window.actions_table.by_name["run"].isEnabled()


def test_an_invalid_field_keeps_runs_from_starting_until_it_is_hidden_or_gone(
    blade, qtbot, monkeypatch
):
    window, field, store = blade.window, blade.window.motions.editor.angle, blade.window.store
    drawn = blade.session.view.drawn
    type_into(field, "1fgab.5xe-1")
    assert field.text() == "1fgab.5xe-1"
    QTest.keyClick(field, Qt.Key.Key_Tab)
    assert not field.hasFocus()
    assert field.text() == "1fgab.5xe-1"
    assert blade.session.case.motions == (Rotate("airfoil", 3.0),)
    assert "“1fgab.5xe-1” is not a number" in window.run_panel.text.text()
    assert "the value is still 3" in window.statusBar().currentMessage()
    assert try_all_ways(blade) == 0
    store.change(changes.add_motion, Rotate("airfoil", 3.0))
    assert (field.text(), blade.session.invalid) == ("3", ()), "another motion has its own number"
    assert "the value is still 3" not in window.statusBar().currentMessage()
    store.undo()
    window.dock_manager.bring_to_front("method")
    steps, count = window.method.steps, blade.session.case.steps
    type_into(steps.lineEdit(), "2.5")
    QTest.keyClick(steps, Qt.Key.Key_Tab)
    assert (steps.text(), blade.session.case.steps) == ("2.5", count)
    assert "Steps: “2.5” is not a whole number" in window.run_panel.text.text()
    assert try_all_ways(blade) == 0
    assert blade.session.view.drawn == drawn, "no letter ran a shortcut"
    monkeypatch.setattr(questions, "ask_unsaved", lambda *_: "discard")
    blade.open(blade.session.path)
    assert not blade.session.invalid
    assert steps.value() == count
    assert not steps.fault
    window.dock_manager.bring_to_front("motion")
    blade.role("airfoil", "moving")
    store.change(changes.add_motion, Rotate("airfoil", 3.0))
    type_into(field, "3.3.3")
    store.change(changes.replace_motion, 0, Translate("airfoil", (0.01, 0.0)))
    assert not blade.session.invalid
    assert window.run_panel.run.isEnabled()
    store.change(changes.replace_motion, 0, Rotate("airfoil", 2.0))
    type_into(field, "-")
    store.change(changes.remove_motion, 0)
    assert not blade.session.invalid


def test_every_field_of_motion_and_method_is_watched(blade):
    window = blade.window
    window.docks["method"].raise_()
    window.method.more.button.setChecked(True)
    for motion in (Rotate("airfoil", 3.0, (0.0, 0.0)), Translate("airfoil", (0.1, 0.0)),
                   Scale("airfoil", (1.1, 1.1), (0.0, 0.0))):  # fmt: skip
        window.store.change(changes.set_case, motions=(motion,))
        for panel in (window.motions, window.method):
            every = [*panel.findChildren(NumberField), *panel.findChildren(NumberBox)]
            open_ = [f for f in every if f.isVisibleTo(panel) and f.isEnabledTo(panel)]
            assert open_
            for field in open_:
                before = field.text()
                line = field if isinstance(field, QLineEdit) else field.lineEdit()
                type_into(line, "")
                assert not window.run_panel.run.isEnabled(), field.objectName()
                assert "a number is needed." in window.run_panel.text.text()
                QTest.keyClick(line, Qt.Key.Key_Escape)
                assert field.text() == before
                assert window.run_panel.run.isEnabled(), field.objectName()


def test_an_axis_without_direction_stays_told(driver, sample_folder):
    driver.open(sample_folder / "hexahedron" / "mesh.su2")
    driver.role("BLOCK", "moving")
    window = driver.window
    window.store.change(changes.add_motion, Rotate("BLOCK", 3.0))
    driver.type(window.motions.editor.axis.fields[2], "0")
    assert "Axis: an axis needs a direction" in window.run_panel.text.text()
    # Whatever else changes meanwhile.
    window.store.change(changes.set_case, steps=3)
    assert try_all_ways(driver) == 0
    driver.type(window.motions.editor.axis.fields[0], "1")
    assert window.run_panel.run.isEnabled()
