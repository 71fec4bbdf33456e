"""Pushing a boundary away from the machine's axis, as someone who never read a manual would."""

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest

from slideviz.case.motions.rigid import Radial, Rotate
from slideviz.samples.table import write_sample
from slideviz.session import changes

pytestmark = pytest.mark.usefixtures("unpainted")


@pytest.fixture
def stator(driver, tmp_path):
    write_sample("stator", tmp_path, size=5_000)
    driver.window.files.open_path(tmp_path / "mesh.su2")
    driver.settle()
    driver.window.store.change(changes.set_role, ("BLADE",), "fixed")
    driver.window.store.change(changes.set_role, ("HUB",), "moving")
    return driver


def typed(field, text):
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, text)
    QTest.keyClick(field, Qt.Key.Key_Tab)


def test_three_percent_about_the_machines_axis_or_another(stator):
    panel = stator.window.motions
    panel.add_actions[Radial].trigger()
    editor = panel.editor
    assert editor.about.currentText() == "the machine's axis (z)"
    assert not editor.point.isVisible()
    assert not editor.axis.isVisible()
    typed(editor.percent, "3")
    (motion,) = stator.session.case.motions
    pair = next(p for p in stator.session.pairs if p.kind == "rotational")
    assert motion == Radial("HUB", 1.03, 0.0, pair.axis, pair.origin)
    assert "push radially by +3 %" in panel.list.item(0).text()
    nodes = stator.session.mesh.marker("HUB").nodes
    ghost = stator.window.scene.motion_ghosts["HUB"]
    # The sample's axis is that of z through the origin.
    before = np.linalg.norm(stator.session.mesh.points[nodes, :2], axis=1)
    assert np.allclose(np.linalg.norm(ghost[:, :2], axis=1), 1.03 * before)
    editor.percent.selectAll()
    QTest.keyClicks(editor.percent, "-100")
    assert editor.percent.property("bad")
    assert stator.session.case.motions[0].factor > 0
    stator.window.store.change(changes.set_case, motions=())
    panel = stator.window.motions
    panel.add_actions[Rotate].trigger()
    editor = panel.editor
    assert editor.about.currentText() == "the machine's axis (z)"
    row = editor.about.findData("point")
    editor.about.setCurrentIndex(row)
    editor.about.activated.emit(row)
    assert editor.point.isVisible()
    assert editor.axis.isVisible()
    typed(editor.point.fields[0], "0.5")
    assert stator.session.case.motions[0].point == (0.5, 0.0, 0.0)
    row = editor.about.findData("axis")
    editor.about.setCurrentIndex(row)
    editor.about.activated.emit(row)
    assert stator.session.case.motions[0].point == (0.0, 0.0, 0.0)
    assert not editor.point.isVisible()
