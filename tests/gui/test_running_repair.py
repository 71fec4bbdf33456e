"""Repair in the window: offered where cells are folded, as a run of its own."""

from __future__ import annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.gui.commands import COMMANDS, CommandState
from slideviz.gui.panels.curves import CurvesPanel
from slideviz.session import changes
from tests import builders
from tests.solver.test_repair_stage import folded, last, scrambled

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


def test_a_folded_run_is_mended_by_the_button_of_its_message(driver, window, tmp_path):
    mesh, case = folded()
    sv.write(tmp_path / "mesh.su2", mesh)
    case.change(mesh_file=tmp_path / "mesh.su2").write(tmp_path / "case.cfg")
    driver.open(tmp_path / "case.cfg")
    assert not COMMANDS["repair"].enabled(CommandState(driver.session))
    window.start_run()
    driver.settle()
    first = driver.session.run_shown
    assert first.last.quality.inverted
    window.run_panel.text.linkActivated.emit("reach")
    driver.settle()
    assert window.dock_manager.panel(CurvesPanel).kind.currentData() == "reach"
    assert not window.dock_manager.panel(CurvesPanel).area.shows_text
    assert COMMANDS["repair"].enabled(CommandState(driver.session))
    driver.answer("Repair")
    driver.settle()
    run = driver.session.run_shown
    assert run.number == 2
    assert not run.last.quality.inverted
    assert "folded cells mended" in window.run_panel.text.text()
    assert not driver.session.outdated
    again = last(run.case, mesh)
    np.testing.assert_array_equal(run.last.mesh.points, again.mesh.points)
    assert "repair:cells" not in window.scene.plotter.actors
    window.store.change(changes.set_view, repaired=True)
    actors = window.scene.plotter.actors
    dots, ghost = actors["repair:nodes"], actors["repair:cells"]
    assert dots.mapper.dataset.n_points == len(run.last.step.repaired.nodes)
    before = first.last.mesh.points[mesh.cells.take(run.last.step.repaired.cells).nodes]
    np.testing.assert_allclose(ghost.mapper.dataset.points[:, :2], before)
    window.store.change(changes.show_run, 1)
    assert "repair:cells" not in window.scene.plotter.actors


def test_a_folded_mesh_is_mended_without_a_motion(driver, window, tmp_path):
    sv.write(tmp_path / "folded.su2", scrambled(builders.square(8), 0.5))
    driver.open(tmp_path / "folded.su2")
    assert driver.session.first.quality.inverted
    window.running.repair()
    driver.settle()
    assert not driver.session.run_shown.last.quality.inverted
    assert driver.session.run_shown.last.step.repaired.nodes.size
    assert not driver.session.outdated
