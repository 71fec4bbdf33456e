"""A large mesh in the window: its boundary, sections and worst cells, run from file to file."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.gui.background import READING
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.mesh.quality import quality
from slideviz.samples.table import write_sample
from slideviz.scene.actors import VALUES
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session import changes, large
from slideviz.session.run_messages import run_requirements
from slideviz.session.state import IN_FILE
from slideviz.solver.deform import deform
from tests.builders import stage
from tests.windows import come_to_rest

pytestmark = pytest.mark.window("shared")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("large")
    write_sample("stator", made, 6000, file_format="su2b")
    return made


@pytest.fixture
def stator(driver, folder, monkeypatch):
    monkeypatch.setattr(large, "LARGE_CELLS", 1000)
    driver.open(folder / "stator.cfg")
    return driver


def waited(stator):
    reader = stator.window.section_reader
    stator.qtbot.waitUntil(lambda: not reader.busy)
    come_to_rest()


def add(stator, section):
    stator.window.store.change(changes.add_section, section)
    waited(stator)
    return stator.window.scene.sections.drawn["section:0"]


def test_only_the_boundary_is_in_memory_and_what_needs_all_cells_says_so(stator, folder, answers):
    session, whole = stator.session, sv.read(folder / "mesh.su2b")
    assert session.lacks_cells
    assert len(session.mesh.cells) < len(whole.cells)
    assert f"{len(whole.cells):,} cells" in stator.window.mesh_text.text()
    assert "boundary and sections only" in stator.window.mesh_text.text()
    assert "stay in the file" in stator.window.banner.text.text()
    assert not stator.window.banner.isHidden()
    found = quality(whole)
    assert session.frame.quality.min == found.min
    assert session.frame.quality.cells == len(whole.cells)
    for marker in whole.markers:
        assert len(session.mesh.marker(marker.name).cells) == len(marker.cells)
    actions = {one.objectName(): one for one in stator.window.findChildren(type_of_action())}
    for name in ("save_mesh", "export_quality"):
        assert not actions[name].isEnabled()
        assert "stays in its file" in actions[name].toolTip().replace("\n", " ")
    panel = stator.window.dock_manager.panels["sections"]
    assert not panel.picture.isEnabled()
    display = stator.window.dock_manager.panels["display"]
    assert not display.only.isEnabled()
    assert "stays in its file" in display.only.toolTip().replace("\n", " ")
    stator.window.store.change(changes.set_view, threshold=(0.0, 0.5))
    assert stator.session.view.threshold is None
    answers("ask_save", None)
    stator.window.start_run()
    assert not stator.window.runner.busy
    assert not stator.session.runs
    before = (folder / "mesh.su2b").read_bytes()
    answers("ask_save", folder / "mesh.su2b")
    stator.window.start_run()
    assert not stator.window.runner.busy
    assert "is the mesh itself" in stator.window.banner.text.text()
    assert (folder / "mesh.su2b").read_bytes() == before
    stator.window.actions_table.by_name["designs"].trigger()
    panel = stator.window.docks["designs"].findChild(DesignsPanel)
    assert "sweep it with `slideviz sweep`" in panel.status.label.text()
    assert not any(widget.isEnabled() for widget in (panel.rows.add, panel.load, panel.run))
    panel.start()
    assert not panel.runner.busy
    stator.window.store.change(changes.set_case, method="elastic")
    wanted = run_requirements(stator.session)
    assert any("needs all of a mesh in memory" in one.text for one in wanted)


def test_a_small_mesh_and_other_formats_are_opened_whole(driver, folder, tmp_path, monkeypatch):
    driver.open(folder / "stator.cfg")
    assert not driver.session.lacks_cells
    monkeypatch.setattr(large, "LARGE_CELLS", 100)
    write_sample("hexahedron", tmp_path, 8)
    driver.open(tmp_path / "hexahedron.cfg")
    assert not driver.session.lacks_cells


def test_little_memory_makes_a_mesh_large(folder, monkeypatch):
    assert not large.is_large(folder / "mesh.su2b", None)
    monkeypatch.setattr(large, "free_memory", lambda: 1e6)
    assert large.is_large(folder / "mesh.su2b", None)


def test_a_section_has_the_cells_and_colors_of_the_whole_mesh(stator, folder):
    whole = sv.read(folder / "mesh.su2b")
    section = Section("cylinder", (0.0, 0.0, 0.0), (0, 0, 1), 0.27)
    stator.window.store.change(changes.set_view, color_by="skew")
    one = add(stator, section)
    there = Cutter(whole).cut(whole.points, section)
    np.testing.assert_array_equal(one.frame.mesh.numbering.cells[one.polygons.cells], there.cells)
    assert not stator.window.statusBar().currentMessage().startswith(READING)
    np.testing.assert_allclose(
        one.shown.shape.cell_data[VALUES], quality(whole).skew[there.cells], rtol=1e-12
    )


def test_a_dragged_section_keeps_its_picture_until_the_next_is_read(stator):
    one = add(stator, Section("plane", (0.27, 0.0, 0.05), (0, 0, 1)))
    before = one.polygons
    assert len(before)
    for z in (0.051, 0.052, 0.06):
        other = Section("plane", (0.27, 0.0, z), (0, 0, 1))
        stator.window.store.change(changes.replace_section, 0, other)
        assert one.polygons is before
    waited(stator)
    after = stator.window.scene.sections.drawn["section:0"].polygons
    assert np.allclose(after.points[:, 2], 0.06)


def test_worst_cells_are_listed_and_marked(stator, folder):
    found = quality(sv.read(folder / "mesh.su2b"))
    window = stator.window
    window.dock_manager.bring_to_front("worst")
    panel = window.dock_manager.panels["worst"]
    stator.qtbot.waitUntil(lambda: panel.model.worst is not None)
    worst = found.worst(3)
    shown = [int(panel.model.index(row, 0).data()) for row in range(3)]
    assert shown == worst.tolist()
    for row in range(3):
        panel._fly_to_row(row)
        assert stator.session.view.marked_cell == panel.model.cell(row)
        assert f"Cell {worst[row]}" in panel.info.text()
        assert any(name.startswith("mark") for name in window.scene.plotter.renderer.actors)


def type_of_action():
    from qtpy.QtGui import QAction

    return QAction


def test_a_run_goes_from_file_to_file(stator, folder, tmp_path, answers):
    window, output = stator.window, tmp_path / "out.su2b"
    asked = answers("ask_save", output)
    add(stator, Section("plane", (0.27, 0.0, 0.05), (0, 0, 1)))
    window.store.change(changes.set_case, steps=1)
    case = stator.session.case
    window.start_run()
    stator.settle()
    waited(stator)
    assert len(asked) == 1
    whole = sv.read(folder / "mesh.su2b")
    *_, step = deform(case, whole)
    np.testing.assert_array_equal(sv.read(output).points, step.mesh.points)
    found, frame = quality(step.mesh, whole), stator.session.frame
    assert (frame.quality.min, frame.quality.inverted) == (found.min, found.inverted)
    part = stator.session.mesh.numbering
    np.testing.assert_array_equal(frame.mesh.points, step.mesh.points[part.points])
    cut = Cutter(whole).cut(step.mesh.points, stator.session.view.sections[0])
    one = window.scene.sections.drawn["section:0"]
    np.testing.assert_array_equal(one.frame.mesh.numbering.cells[one.polygons.cells], cut.cells)
    assert stator.told == f"Note: The deformed mesh is in {output}."
    assert window.run_panel.strip.count.text() == "1 note ▾"
    assert not stator.session.unsaved_mesh  # it is in its file


def test_a_run_that_is_cancelled_leaves_no_file(stator, tmp_path, answers):
    output = tmp_path / "out.su2b"
    answers("ask_save", output)
    stator.window.start_run()
    stator.window.running.cancel()
    stator.settle()
    assert not output.exists()
    assert stator.session.frame is stator.session.first


def test_the_reason_is_a_sentence():
    assert IN_FILE.endswith(".")


def test_all_zones_of_a_large_mesh_are_opened_and_run(driver, tmp_path, monkeypatch, answers):
    monkeypatch.setattr(large, "LARGE_CELLS", 100)
    whole, output = stage(), tmp_path / "out.su2b"
    sv.write(tmp_path / "stage.su2b", whole)
    driver.open(tmp_path / "stage.su2b")
    mesh, table = driver.session.mesh, driver.window.boundaries.table
    assert driver.session.lacks_cells
    assert mesh.marker_names == whole.marker_names
    half = len(mesh.markers) // 2
    assert [table.item(row, 0).text() for row in (0, half + 1)] == ["Zone 1", "Zone 2"]
    assert driver.window.actions_table.bar.zone.currentText() == "all 2"
    assert driver.session.frame.quality.min == quality(whole).min
    blades = ("1:blade", "2:blade")
    motions = tuple(sv.Rotate(name, 1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)) for name in blades)
    roles = {**driver.session.case.roles, **dict.fromkeys(blades, "moving")}
    driver.window.store.change(changes.set_case, roles=roles, motions=motions, relax="no")
    section = Section("cylinder", (0.0, 0.0, 0.0), (0, 0, 1), 0.8)
    add(driver, section)
    answers("ask_save", output)
    case = driver.session.case
    driver.window.start_run()
    driver.settle()
    waited(driver)
    *_, step = deform(case, whole)
    np.testing.assert_array_equal(sv.read(output).points, step.mesh.points)
    assert driver.session.frame.quality.min == quality(step.mesh, whole).min
    cut = Cutter(whole).cut(step.mesh.points, driver.session.view.sections[0])
    one = driver.window.scene.sections.drawn["section:0"]
    np.testing.assert_array_equal(one.frame.mesh.numbering.cells[one.polygons.cells], cut.cells)
    driver.window.dock_manager.bring_to_front("worst")
    panel = driver.window.dock_manager.panels["worst"]
    wanted = quality(step.mesh, whole).worst(3).tolist()

    def shown():
        return [int(panel.model.index(row, 0).data() or -1) for row in range(3)]

    driver.qtbot.waitUntil(lambda: shown() == wanted)
