"""The fields of the method panel, made from the table of keys: each shows, sets and explains."""

import pytest
from qtpy.QtTest import QTest

from slideviz.case.keys import KEYS, REDUCTION
from slideviz.gui.panels.method import Switch
from slideviz.gui.widgets.build import Choice
from slideviz.gui.widgets.fields import NumberBox, NumberField, VectorField
from slideviz.rbf.reduction import Reduction
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

OWN = {"multilevel": "levels", "level_size": "level_end"}
"""Fields that stand for more than one key, by the one that they have label and tip from."""


@pytest.fixture
def ready(driver, passage_file):
    """The window with a case in which every setting does something, all of them open."""
    driver.open(passage_file)
    driver.window.store.change(
        changes.set_case, reduction=Reduction(0.25, multilevel=True), periodic_type="rotational"
    )
    driver.window.docks["method"].raise_()
    if not driver.window.method.more.button.isChecked():
        driver.click(driver.window.method.more.button)
    return driver


def field_of(driver, key):
    panel = driver.window.method
    form = panel.form if key.form == "main" else panel.more.form
    return form.fields[OWN.get(key.field, key.field)]


def change_by_hand(driver, key):
    """Give the field of a key another value, as a user does."""
    field = field_of(driver, key)
    if isinstance(field, Choice):
        driver.choose(field, field.itemData((field.currentIndex() + 1) % field.count()))
    elif isinstance(field, Switch):
        field.click()
    elif isinstance(field, VectorField):
        driver.type(field.fields[0], "0.625")
    else:
        assert isinstance(field, NumberField | NumberBox)
        text = next(text for text in ("7", "0.7") if not key.kind.problem(text))
        driver.type(field if isinstance(field, NumberField) else field.lineEdit(), text)


def test_every_key_that_is_shown_has_a_field_that_sets_it(ready):
    for key in KEYS.values():
        if key.form is None:
            continue
        field, before = field_of(ready, key), ready.session.case
        assert field.objectName() == OWN.get(key.field, key.field)
        assert field.isEnabled(), key.name
        change_by_hand(ready, key)
        own = "reduction" if key.group == REDUCTION else key.field
        assert getattr(ready.session.case, own) != getattr(before, own), key.name
        ready.window.store.undo()
        assert ready.session.case == before, key.name


@pytest.mark.parametrize("name", ["FEATURE_ANGLE", "GAMMA", "INFLUENCE_FACTOR"])
def test_a_field_refuses_a_number_with_the_words_of_a_case_file(ready, name):
    key = KEYS[name]
    field, before = field_of(ready, key), key.get(ready.session.case)
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, "-3")
    assert field.fault == key.kind.problem("-3")
    assert f"{key.title}: -3 is out of range; expected" in ready.window.run_panel.text.text()
    assert key.get(ready.session.case) == before
