"""The whole way by mouse and keyboard, and the command line gives the same file."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from qtpy.QtCore import Qt, QTimer
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication, QDialog, QDialogButtonBox, QFileDialog, QLineEdit

from slideviz.case.motions.rigid import Rotate, Translate
from slideviz.gui.widgets import questions

ASK_SAVE = questions.ask_save


def type_into_file_dialog(path):
    """Type a name into the next file dialog, and press Enter; again until it is accepted.

    The dialog reads its folder in the background and takes no name before it has.
    """

    def typing(seen=None):
        dialog = QApplication.activeModalWidget()
        if seen is not None and dialog is not seen:
            return
        if not isinstance(dialog, QFileDialog):
            QTimer.singleShot(50, typing)
            return
        name = dialog.findChild(QLineEdit, "fileNameEdit")
        if dialog.isActiveWindow() and name.hasFocus():
            # The list of completions would take the Enter key.
            name.setCompleter(None)
            name.selectAll()
            QTest.keyClicks(name, str(path))
            QTimer.singleShot(300, lambda: typing(dialog))
            QTest.keyClick(name, Qt.Key.Key_Return)
        else:
            dialog.activateWindow()
            name.setFocus()
            QTimer.singleShot(50, lambda: typing(seen))

    QTimer.singleShot(50, typing)


def accept_dialog():
    """Press the button of the next dialog that is no file dialog."""

    def pressing():
        dialog = QApplication.activeModalWidget()
        if not isinstance(dialog, QDialog) or isinstance(dialog, QFileDialog):
            QTimer.singleShot(30, pressing)
            return
        box = dialog.findChild(QDialogButtonBox)
        QTest.mouseClick(
            box.button(QDialogButtonBox.StandardButton.Save), Qt.MouseButton.LeftButton
        )

    QTimer.singleShot(30, pressing)


def test_a_blade_passage_from_mesh_to_case_and_the_command_line_agrees(
    driver, passage_file, tmp_path, monkeypatch
):
    window, mesh_file = driver.window, Path(passage_file)
    monkeypatch.setattr(questions, "ask_save", ASK_SAVE)
    driver.open(mesh_file)

    # The blade by a click in the view and the right button, the others in the table.
    mesh = driver.session.mesh
    driver.click_view(mesh.points[mesh.marker("airfoil").nodes[0]])
    assert window.boundaries.selected() == ("airfoil",)
    driver.role("airfoil", "moving")
    driver.click_row("inflow")
    driver.click_row("outflow", Qt.KeyboardModifier.ControlModifier)
    driver.role("outflow", "sliding")
    driver.click_row("periodic_1")
    driver.click_row("periodic_2", Qt.KeyboardModifier.ControlModifier)
    driver.role("periodic_1", "periodic")
    assert not driver.session.guesses

    # The motion: 5 degrees about the centroid, then a small translation.
    driver.add_motion(Rotate)
    driver.type(window.motions.editor.angle, "5")
    driver.add_motion(Translate)
    driver.type(window.motions.editor.vector.fields[0], "0.01")
    driver.type(window.motions.editor.vector.fields[1], "0.02")
    assert driver.session.case.motions == (
        Rotate("airfoil", 5.0),
        Translate("airfoil", (0.01, 0.02)),
    )

    # The method: pseudo sliding, periodic with moving vertices, two steps.
    window.docks["method"].raise_()
    driver.choose(window.method.sliding, "ps")
    driver.choose(window.method.periodic, "moving")
    driver.type(window.method.steps.lineEdit(), "2")
    assert window.run_panel.text.text() == "Ready."

    driver.click(window.run_panel.run)
    driver.settle()
    assert len(driver.session.frames) == 3
    quality = driver.session.deformed.quality
    assert quality.inverted == 0
    assert f"{quality.min:.4f}" in window.player.result.text()
    assert driver.session.view.color_by == "size-skew"
    airfoil = mesh.marker("airfoil").nodes
    moved = driver.session.deformed.mesh.points[airfoil] - mesh.points[airfoil]
    assert np.allclose(moved.mean(axis=0), [0.01, 0.02])

    # Mesh, picture, case.
    mesh_out, picture, case = (tmp_path / name for name in ("out.su2", "out.png", "out.cfg"))
    type_into_file_dialog(mesh_out)
    QTest.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    driver.settle()
    accept_dialog()
    type_into_file_dialog(picture)
    driver.activate()
    QTest.keyClick(window, Qt.Key.Key_P, Qt.KeyboardModifier.ControlModifier)
    type_into_file_dialog(case)
    driver.activate()
    both = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    QTest.keyClick(window, Qt.Key.Key_S, both)
    assert mesh_out.stat().st_size > 10_000
    with Image.open(picture) as image:
        assert len(image.convert("RGB").getcolors(2**24)) > 200
    assert not window.windowTitle().startswith("*")

    # The command line, in another folder.
    away = tmp_path / "cluster"
    away.mkdir()
    shutil.copy(case, away)
    shutil.copy(mesh_file, away)
    again = away / "again.su2"
    call = [sys.executable, "-m", "slideviz", "run", str(away / case.name), "-o", str(again)]
    done = subprocess.run(call, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    assert again.read_bytes() == mesh_out.read_bytes()
