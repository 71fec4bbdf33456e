"""The motion panel: what its fields show, keep and refuse, for 2D and 3D meshes."""

from pathlib import Path

import numpy as np
import pytest
from qtpy.QtCore import Qt
from qtpy.QtTest import QTest
from qtpy.QtWidgets import QApplication

import slideviz as sv
from slideviz.case.model import Case
from slideviz.case.motion_words import describe
from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness, FfdTwist
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.kinds import KINDS
from slideviz.case.motions.onto import Onto
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion
from slideviz.ffd.box import plane_corners, regular_box
from slideviz.ffd.section import with_boxes
from slideviz.gui.panels.motion_editor import ROWS
from slideviz.gui.panels.motions import TableDialog
from slideviz.gui.widgets.build import wrapped
from slideviz.gui.widgets.fields import control_point_problem
from slideviz.samples.table import write_sample
from slideviz.session import changes, jobs
from slideviz.session.motions import Ghosts, TableRows, largest_prescribed
from slideviz.session.run_messages import run_requirements
from slideviz.terms import SHOWN
from tests.builders import airfoil, stage
from tests.slow import one_of_each_fast

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

NOISE = 3.7e-13


@pytest.fixture
def block(driver, sample_folder):
    """The block in a cube, which moves, without a motion."""
    driver.open(sample_folder / "hexahedron" / "mesh.su2")
    driver.role("BLOCK", "moving")
    return driver


@pytest.fixture
def blade(driver, passage_file):
    driver.open(passage_file)
    driver.role("airfoil", "moving")
    return driver


def editor(driver):
    return driver.window.motions.editor


def texts(vector):
    return [field.text() for field in vector.fields[: vector.count]]


def put(driver, *motions):
    driver.window.store.change(changes.set_case, motions=motions)


def listed(driver, row=0):
    return driver.window.motions.list.item(row).text()


def test_what_rounding_left_is_not_shown_but_a_small_displacement_is(block):
    motion = Rotate("BLOCK", 5.0, (NOISE, 0.0, 0.0))
    put(block, motion)
    assert texts(editor(block).point) == ["0", "0", "0"]
    assert "through (0, 0, 0)" in listed(block)
    block.type(editor(block).angle, "7")
    assert block.session.case.motions[0].point == motion.point, "nobody has edited it"
    put(block, Rotate("BLOCK", 5.0, (1e-7, 0.0, 0.0)))
    assert texts(editor(block).point)[0] == "1e-07", "a small length is none"
    assert "through (1e-07, 0, 0)" in listed(block)
    put(block, Translate("BLOCK", (NOISE, 0.0, 0.0)))
    assert texts(editor(block).vector) == ["3.7e-13", "0", "0"]
    put(block, Scale("BLOCK", (2.0, 2.0, 2.0)))
    block.choose(editor(block).about, "point")
    point = block.session.case.motions[0].point
    points = block.session.mesh.points[block.session.mesh.marker("BLOCK").nodes]
    assert point == pytest.approx(points.mean(axis=0), abs=1e-11)
    assert point == (0.5, 0.5, 0.5)


def test_an_axis_without_direction_is_marked_and_the_list_tells_the_others(block, sample_folder):
    put(block, Rotate("BLOCK", 5.0, "centroid", (1.0, 0.0, 0.0)))
    axis = editor(block).axis
    axis.fields[0].selectAll()
    QTest.keyClicks(axis.fields[0], "0")
    assert [field.property("bad") for field in axis.fields] == [True] * 3
    assert "an axis needs a direction: not all may be 0" in axis.fields[2].toolTip()
    assert block.session.case.motions[0].axis == (1.0, 0.0, 0.0)
    axis.fields[1].selectAll()
    QTest.keyClicks(axis.fields[1], "2")
    assert not any(field.property("bad") for field in axis.fields)
    assert block.session.case.motions[0].axis == (0.0, 2.0, 0.0)
    axis.fields[1].selectAll()
    QTest.keyClicks(axis.fields[1], "0")
    block.type(editor(block).angle, "9")
    assert block.session.case.motions == (Rotate("BLOCK", 9.0, "centroid", (0.0, 2.0, 0.0)),)
    put(block, Rotate("BLOCK", 5.0, "centroid", (0.0, -1.0, 0.0)), Rotate("BLOCK", 5.0))
    assert listed(block, 0) == "1.  BLOCK: rotate by 5° about -y through its centroid"
    assert listed(block, 1) == "2.  BLOCK: rotate by 5° about z through its centroid"


def test_the_list_tells_the_point_of_a_2d_rotation_and_of_a_box_what_is_missing(blade):
    put(blade, Rotate("airfoil", 5.0), Rotate("airfoil", 5.0, (1.0, 0.5)))
    assert listed(blade, 0) == "1.  airfoil: rotate by 5° about its centroid"
    assert listed(blade, 1) == "2.  airfoil: rotate by 5° about (1, 0.5)"
    put(blade)
    blade.add_motion(Ffd)
    assert blade.session.case.motions[0].box == ""
    blade.type(editor(blade).vector.fields[0], "0.1")
    (missing,) = run_requirements(blade.session)
    assert missing.text == "A motion lacks its box: choose one, or make a new one."
    # It is made where one looks for it.
    button = editor(blade).new_box
    assert button.isVisible()
    assert button.text() == "New box around airfoil"
    blade.click(button)
    assert blade.session.case.motions[0].box == "BOX"
    assert not run_requirements(blade.session)
    assert not button.isVisible()
    assert editor(blade).box.currentText() == "BOX"
    (motion,) = blade.session.case.motions
    assert blade.window.store.can_undo == f"new box ({describe(motion)})"
    blade.window.store.undo()
    assert blade.session.case.ffd_boxes == ()
    assert button.isVisible()


MOVED = {
    Translate: lambda p: p + np.r_[0.02, np.zeros(p.shape[1] - 1)],
    Rotate: lambda p: (
        np.c_[(p - p.mean(axis=0))[:, :2] @ [[0, 1], [-1, 0]], p[:, 2:]]
        + [*p.mean(axis=0)[:2], *[0.0] * (p.shape[1] - 2)]
    ),
    Scale: lambda p: p.mean(axis=0) + (p - p.mean(axis=0)) * np.r_[1.2, np.ones(p.shape[1] - 1)],
    Radial: lambda p: np.c_[1.1 * p[:, :2], p[:, 2:]],
}
"""Where the nodes of a boundary (n, d) go."""


def type_first(driver, kind):
    """Type the number that makes a motion of that kind move something."""
    form = editor(driver)
    field, text = {
        Translate: (form.vector.fields[0], "0.02"),
        Rotate: (form.angle, "90"),
        Scale: (form.factors.fields[0], "1.2"),
        Radial: (form.percent, "10"),
    }[kind]
    driver.type(field, text)


@pytest.mark.parametrize(("kind", "what"), one_of_each_fast(list(MOVED), ["blade", "block"]))
def test_every_kind_moves_its_ghost_as_it_is_typed(request, kind, what):
    driver, name = request.getfixturevalue(what), {"blade": "airfoil", "block": "BLOCK"}[what]
    driver.add_motion(kind)
    type_first(driver, kind)
    points = driver.session.mesh.points[driver.session.mesh.marker(name).nodes]
    ghost = driver.window.scene.motion_ghosts[name]
    assert np.allclose(ghost, MOVED[kind](points))
    driver.add_motion(Translate)
    type_first(driver, Translate)
    ghost = driver.window.scene.motion_ghosts[name]
    assert np.allclose(ghost, MOVED[Translate](MOVED[kind](points))), "one after the other"


def test_a_file_with_mistakes_is_told_as_it_is_chosen(blade, tmp_path, qtbot):
    file = tmp_path / "table.txt"
    file.write_text("0 0.1\n")
    blade.add_motion(FromFile)
    blade.type(editor(blade).path, str(file))
    told = blade.window.run_panel.text
    qtbot.waitUntil(lambda: "table.txt:1: " in told.text())
    assert not blade.window.run_panel.run.isEnabled()


def test_a_curve_over_span_is_typed_checked_and_shown_with_its_ghost(driver, tmp_path):
    driver.open(write_sample("impeller", tmp_path, 3000)[0])
    driver.role("BLADE", "moving")
    driver.add_motion(SpanMotion)
    form = editor(driver)
    driver.type(form.curve, "0:0, 0.5:1, 1:5")
    motion = SpanMotion("BLADE", "twist", (0.0, 0.5, 1.0), (0.0, 1.0, 5.0))
    assert driver.session.case.motions == (motion,)
    assert listed(driver) == "1.  BLADE: twist 0° at 0 %, 1° at 50 %, 5° at 100 % span"
    mesh = driver.session.mesh
    moved = driver.window.scene.motion_ghosts["BLADE"] - mesh.points[mesh.marker("BLADE").nodes]
    assert np.linalg.norm(moved, axis=1).max() > 0.01
    driver.type(form.curve, "0:0, 0.5")
    assert form.curve.property("bad")
    assert "write span:value" in form.curve.toolTip()
    assert driver.session.case.motions == (motion,)
    driver.choose(form.about, "point")
    assert driver.session.case.motions[0].point is not None
    driver.choose(form.about, "line")
    assert driver.session.case.motions == (motion,)
    assert form.curve.value == "0:0, 0.5:1, 1:5"
    driver.choose(form.change, "chord")
    assert driver.session.case.motions[0].values == (1.0, 1.0), "at rest"
    driver.type(form.curve, "0:1, 1:-1")
    assert "is not above 0" in form.curve.toolTip()
    driver.choose(form.change, "stagger")
    assert driver.session.case.motions == (SpanMotion("BLADE", "stagger", (0.0,), (0.0,)),)


@pytest.mark.window("own")
def test_motions_over_span_of_each_zone_have_its_walls(driver, tmp_path):
    names = [f"{zone}:{side}" for zone in (1, 2) for side in ("per1", "per2")]
    roles = dict.fromkeys(names, "periodic") | {"1:blade": "moving", "2:blade": "moving"}
    twist = SpanMotion("1:blade", "twist", (0.0, 1.0), (0.0, 3.0))
    case = Case(roles=roles, motions=(twist,), periodic_type="rotational")
    opened = jobs.prepare(stage(), tmp_path / "s.su2", case, jobs.Job())
    window = driver.window
    window.resize(1280, 800)
    window.show_opened(opened)
    driver.qtbot.waitUntil(window.motions.editor.drawn.isVisible)
    QApplication.processEvents()
    form = editor(driver)
    assert form.drawn.geometry().bottom() < form.about.geometry().top()
    hub, shroud = form.walls.ends
    assert (hub.currentData(), shroud.currentData()) == ("1:hub", "1:shroud")
    driver.click_row("1:blade")
    [missing] = run_requirements(driver.session)
    window.focus_requirement(missing)
    assert driver.session.case.motions[1].marker == "2:blade"
    assert driver.session.view.selected == ("2:blade",)
    assert window.boundaries.selected() == ("2:blade",)
    assert (hub.currentData(), shroud.currentData()) == ("2:hub", "2:shroud")
    assert {hub.itemData(k)[:2] for k in range(hub.count())} == {"2:"}
    window.store.change(changes.set_case, span=("1:hub", "1:shroud"))
    assert hub.currentData() == "2:hub", "those of the other zone"
    driver.choose(hub, "2:inflow")
    assert driver.session.case.span == ("2:inflow", "2:shroud")
    window.motions.list.setCurrentRow(0)
    assert hub.currentData() == "1:hub"


@pytest.mark.window("own")
def test_a_wing_is_twisted_between_its_root_and_tip(driver, tmp_path):
    driver.open(write_sample("wing", tmp_path, 2000)[0])
    window = driver.window
    window.resize(1280, 800)
    driver.role("wing", "moving")
    driver.add_motion(SpanMotion)
    form = editor(driver)
    driver.type(form.curve, "0:0, 1:8")
    root, tip = form.walls.ends
    assert (root.currentData(), tip.currentData()) == ("symmetry", "wing")
    assert form.walls.title.text() == "Root, tip"
    assert [end.shown for end in (root, tip, form.walls.along)] == ["symmetry", "wing", "auto"]
    mesh = driver.session.mesh
    moved = window.scene.motion_ghosts["wing"] - mesh.points[mesh.marker("wing").nodes]
    assert np.abs(moved[:, 1]).max() == 0.0
    assert np.linalg.norm(moved, axis=1).max() > 0.02
    driver.choose(form.walls.along, "x")
    assert driver.session.case.span_axis == (1.0, 0.0, 0.0)
    assert (root.currentData(), tip.currentData()) == ("wing", "wing"), "no flat wall is across x"
    driver.choose(form.walls.along, "AUTO")
    assert driver.session.case.span_axis is None
    QApplication.processEvents()


# Tables ---------------------------------------------------------------------------------------


@pytest.fixture
def dialog(blade, qtbot):
    session = blade.session
    made = TableDialog(blade.window, TableRows.on(session.mesh, session.case, "airfoil"), "")
    qtbot.addWidget(made)
    return made


def test_a_table_is_checked_as_it_is_typed_can_have_all_nodes_and_is_not_accepted_if_wrong(
    dialog, blade, qtbot
):
    node = blade.session.mesh.marker("airfoil").nodes[0]
    assert not dialog.save.isEnabled()
    QTest.keyClicks(dialog.edit, f"{node} 0.3 0.4")
    qtbot.waitUntil(dialog.save.isEnabled)
    assert dialog.answer.text().startswith("1 of ")
    assert not dialog.answer.property("bad")
    QTest.keyClicks(dialog.edit, " 7")
    qtbot.waitUntil(lambda: bool(dialog.answer.property("bad")))
    assert "expected 3: node dx dy" in dialog.answer.text()
    assert not dialog.save.isEnabled()
    dialog.edit.setPlainText("")
    blade.click(dialog.fill)
    assert len(dialog.text.splitlines()) == 1 + len(dialog.rows.nodes)
    assert dialog.save.isEnabled()
    dialog.edit.undo()
    assert dialog.text == ""
    dialog.edit.setPlainText("nonsense")
    dialog.accept()
    assert dialog.result() != TableDialog.DialogCode.Accepted


@pytest.fixture
def typed(monkeypatch):
    """Answer the dialog with a text; tells what it began with."""
    began = []

    def answer(text):
        def go(dialog):
            began.append(dialog.text)
            if text is None:
                return TableDialog.DialogCode.Rejected
            dialog.edit.setPlainText(text)
            return TableDialog.DialogCode.Accepted

        monkeypatch.setattr(TableDialog, "exec", go)
        return began

    return answer


def test_a_new_table_is_saved_and_used_and_its_rows_are_changed(blade, typed, answers, tmp_path):
    mesh = blade.session.mesh
    node, file = int(mesh.marker("airfoil").nodes[0]), tmp_path / "mine.txt"
    asked = answers("ask_save", file)
    typed(f"{node} 0.001 0.002")
    blade.window.motions.add_table.trigger()
    assert asked[0][1] == blade.session.path.parent / "displacement_airfoil.txt"
    assert blade.session.case.motions == (FromFile(file, "airfoil"),)
    moved = blade.window.scene.motion_ghosts["airfoil"][0] - mesh.points[node]
    assert np.allclose(moved, [0.001, 0.002])
    file.write_text(f"{node} 0.001 0.002\n")
    put(blade, FromFile(file, "airfoil"))
    began = typed(f"{node} 0.003 0.004")
    asked = answers("ask_save", file)
    blade.click(editor(blade).table)
    assert began == ["", f"{node} 0.001 0.002\n"]
    assert asked[0][1] == file
    assert blade.session.case.motions == (FromFile(file, "airfoil"),)
    moved = blade.window.scene.motion_ghosts["airfoil"][0] - mesh.points[node]
    assert np.allclose(moved, [0.003, 0.004])
    typed(None)
    blade.click(editor(blade).table)
    assert file.read_text() == f"{node} 0.003 0.004\n"


def test_a_table_that_cannot_be_written_is_told(blade, typed, answers, tmp_path):
    node = int(blade.session.mesh.marker("airfoil").nodes[0])
    typed(f"{node} 0 0")
    answers("ask_save", tmp_path / "none" / "mine.txt")
    blade.window.motions.add_table.trigger()
    assert "the folder does not exist" in blade.window.banner.text.text()
    assert not blade.session.case.motions


@pytest.fixture
def boxed(driver, tmp_path):
    """A 2D mesh with two boxes, whose lower side moves."""
    mesh = square_with_boxes()
    sv.write(tmp_path / "boxed.su2", mesh)
    driver.open(tmp_path / "boxed.su2")
    driver.role("low", "moving")
    return driver


def square_with_boxes():
    axis = np.linspace(0.0, 1.0, 5)
    points = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    first = (5 * np.arange(4)[:, None] + np.arange(4)).ravel()
    low = np.arange(4)[:, None] + [0, 1]
    mesh = sv.Mesh(
        points,
        sv.Cells.from_blocks([(9, first[:, None] + [0, 1, 6, 5])]),
        (
            sv.Marker("low", sv.Cells.from_blocks([(3, low)])),
            sv.Marker("high", sv.Cells.from_blocks([(3, low + 20)])),
        ),
    )
    corners = plane_corners(np.array([[-0.1, -0.1], [1.1, -0.1], [1.1, 0.2], [-0.1, 0.2]]))
    return with_boxes(mesh, [regular_box(name, corners, (3, 1, 1), None) for name in ("A", "B")])


def test_boxes_can_be_drawn_where_there_are_some(driver, passage_file, tmp_path):
    shown = driver.window.dock_manager.panels["display"].shown["ffd"]
    action = driver.window.actions_table.by_name["ffd"]
    driver.open(passage_file)
    assert not shown.isEnabled()
    assert not action.isEnabled()
    assert shown.toolTip() == wrapped(SHOWN["ffd"].why_not)
    sv.write(tmp_path / "boxed.su2", square_with_boxes())
    driver.open(tmp_path / "boxed.su2")
    assert shown.isEnabled()
    assert action.isEnabled()
    assert shown.toolTip() == wrapped(SHOWN["ffd"].tip)
    assert driver.window.statusBar().currentMessage().endswith(". 2 FFD boxes: B shows them")
    # In the panel of motions that stays until they are shown.
    hint = driver.window.motions.hint
    assert hint.text().endswith("\n2 FFD boxes: B shows them")
    driver.role("low", "moving")
    driver.add_motion(Ffd)
    driver.window.store.change(changes.set_view, ffd=False)
    assert hint.isVisible()
    assert hint.text() == "2 FFD boxes: B shows them"
    shown.click()
    assert not hint.isVisible()
    assert "ffd" in driver.session.view.drawn
    assert action.isChecked()


def test_motion_of_a_box_is_shown_edited_and_kept_and_takes_whole_numbers(boxed, tmp_path):
    boxed.add_motion(Ffd)
    form = editor(boxed)
    for text in ("0.5", "-2"):
        boxed.type(form.index.fields[0], text)
        assert boxed.session.case.motions[0].index == (0, 0, -1)
    assert "whole numbers from 0, or -1 for all" in control_point_problem((0.5, 0.0))
    boxed.type(form.index.fields[0], "9")
    assert boxed.session.case.motions[0].index == (9, 0, -1)
    (missing,) = run_requirements(boxed.session)[:1]
    assert "moves yet" in missing.text
    put(boxed)
    boxed.add_motion(Ffd)
    form = editor(boxed)
    assert boxed.session.case.motions == (Ffd("low", "A", (0, 0, -1), (0.0, 0.0, 0.0)),)
    assert form.box.isVisible()
    assert not form.angle.isVisible()
    boxed.type(form.index.fields[0], "2")
    boxed.type(form.index.fields[1], "-1")
    boxed.type(form.vector.fields[1], "0.1")
    boxed.choose(form.box, "B")
    motion = Ffd("low", "B", (2, -1, -1), (0.0, 0.1, 0.0))
    assert boxed.session.case.motions == (motion,)
    assert listed(boxed) == "1.  low: move (2, all) of B by (0, 0.1)"
    moved = Ghosts(boxed.session.mesh).moved(boxed.session.case)["low"]
    u = (np.linspace(0.0, 1.0, 5) + 0.1) / 1.2
    np.testing.assert_allclose(moved[:, 1], 0.1 * 3 * u**2 * (1 - u), atol=1e-14)
    boxed.session.case.write(tmp_path / "kept.cfg")
    assert sv.Case.read(tmp_path / "kept.cfg").motions == (motion,)


def test_camber_and_thickness_of_a_box_are_shown_edited_and_kept(boxed, tmp_path):
    for kind, words in ((FfdCamber, "camber"), (FfdThickness, "thickness")):
        put(boxed)
        boxed.add_motion(kind)
        form = editor(boxed)
        assert boxed.session.case.motions == (kind("low", "A", (0, -1), 0.0),)
        assert [form.index.count, form.amount.isVisible(), form.vector.isVisible()] == [1, 1, 0]
        assert "moves yet" in run_requirements(boxed.session)[0].text
        boxed.type(form.index.fields[0], "2")
        boxed.type(form.amount, "0.1")
        boxed.choose(form.box, "B")
        motion = kind("low", "B", (2, -1), 0.1)
        assert boxed.session.case.motions == (motion,)
        assert listed(boxed) == f"1.  low: {words} (2, all) of B +0.1"
        moved = Ghosts(boxed.session.mesh).moved(boxed.session.case)["low"]
        u = (np.linspace(0.0, 1.0, 5) + 0.1) / 1.2
        side = 1.0 if kind is FfdCamber else 2.0 / 3.0 - 1.0  # y = 0 is a third up the box
        np.testing.assert_allclose(moved[:, 1], side * 0.3 * u**2 * (1 - u), atol=1e-14)
        boxed.session.case.write(tmp_path / "kept.cfg")
        assert sv.Case.read(tmp_path / "kept.cfg").motions == (motion,)
    form = editor(boxed)
    assert not form.kind.model().item(form.kind.findData(FfdTwist)).isEnabled()
    assert not boxed.window.motions.add_actions[FfdTwist].isEnabled()


@pytest.mark.window("own")
def test_twist_of_a_box_is_shown_edited_and_kept(driver, sample_folder, tmp_path):
    block, mesh = driver, sv.read(sample_folder / "hexahedron" / "mesh.su2")
    low, high = mesh.bounds
    ends = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]] * 2, float)
    ends[4:, 2] = 1.0
    box = regular_box("BOX", low + ends * (high - low), (1, 2, 1), None)
    sv.write(tmp_path / "boxed.su2", with_boxes(mesh, [box]))
    block.open(tmp_path / "boxed.su2")
    block.role("BLOCK", "moving")
    block.add_motion(FfdTwist)
    form = editor(block)
    block.qtbot.waitUntil(form.plane.hasFocus)
    assert block.session.case.motions == (FfdTwist("BLOCK", "BOX", 0, 0.0),)
    shown = [form.plane, form.angle, form.point, form.axis, form.box]
    assert all(field.isVisible() for field in shown)
    assert not form.index.isVisible()
    block.type(form.plane, "0.5")
    assert block.session.case.motions[0].plane == 0
    block.type(form.plane, "1")
    block.type(form.angle, "20")
    block.type(form.point.fields[0], "0.5")
    block.type(form.axis.fields[1], "2")
    motion = FfdTwist("BLOCK", "BOX", 1, 20.0, (0.5, 0.0, 0.0), (0.0, 2.0, 0.0))
    assert block.session.case.motions == (motion,)
    assert listed(block) == "1.  BLOCK: twist plane 1 of BOX +20° about y through (0.5, 0, 0)"
    block.session.case.write(tmp_path / "kept.cfg")
    assert sv.Case.read(tmp_path / "kept.cfg").motions == (motion,)


def test_bumps_on_an_airfoil_are_shown_edited_and_kept(driver, tmp_path):
    sv.write(tmp_path / "wing.su2", airfoil(24, 3).with_points(2.0 * airfoil(24, 3).points + 1.0))
    driver.open(tmp_path / "wing.su2")
    driver.role("airfoil", "moving")
    driver.add_motion(HicksHenne)
    form = editor(driver)
    assert driver.session.case.motions == (HicksHenne("airfoil", 0.0, chord=(1.0, 3.0)),)
    assert [form.side.isVisible(), form.peak.isVisible(), form.term.isVisible()] == [1, 1, 0]
    assert texts(form.chord) == ["1", "3"]
    driver.type(form.peak, "120")
    driver.type(form.peak, "30")
    driver.type(form.raised, "0.02")
    driver.choose(form.side, "lower")
    motion = HicksHenne("airfoil", 0.02, 0.3, "lower", (1.0, 3.0))
    assert driver.session.case.motions == (motion,)
    assert listed(driver) == "1.  airfoil: move lower side outwards by 0.02 at 30 % chord"
    assert form.form.labelForField(form.raised).text() == "Outwards by"
    assert "the lower side down" in form.raised.toolTip()
    moved = Ghosts(driver.session.mesh).moved(driver.session.case)["airfoil"]
    assert moved[:, 1].min() < driver.session.mesh.points[:24, 1].min()
    driver.choose(form.kind, Cst)
    assert driver.session.case.motions == (Cst("airfoil", 0.0, chord=(1.0, 3.0)),)
    driver.type(form.term.fields[1], "4")
    driver.type(form.term.fields[0], "5")
    assert driver.session.case.motions[0].term == (1, 4)
    driver.type(form.term.fields[0], "2")
    driver.type(form.raised, "0.1")
    driver.type(form.chord.fields[0], "4")
    assert driver.session.case.motions == (Cst("airfoil", 0.1, (2, 4), chord=(1.0, 3.0)),)
    driver.choose(form.kind, Bump)
    assert not form.side.isVisible()
    assert form.form.labelForField(form.raised).text() == "Raised by"
    assert "towards +y" in form.raised.toolTip()
    driver.type(form.raised, "0.05")
    assert driver.session.case.motions == (Bump("airfoil", 0.05, 0.5, (1.0, 3.0)),)
    driver.session.case.write(tmp_path / "kept.cfg")
    assert sv.Case.read(tmp_path / "kept.cfg").motions == driver.session.case.motions


def test_a_boundary_is_laid_onto_a_surface_without_blocking_the_window(driver, tmp_path):
    mesh = airfoil(24, 3)
    sv.write(tmp_path / "wing.su2", mesh)
    sv.write(tmp_path / "high.su2", mesh.with_points(mesh.points + np.array([0.0, 0.2])))
    driver.open(tmp_path / "wing.su2")
    driver.role("airfoil", "moving")
    driver.add_motion(Onto)
    form = editor(driver)
    assert [form.path.isVisible(), form.limit.isVisible(), form.table.isVisible()] == [1, 1, 0]
    assert "surface" in form.path.toolTip()
    driver.type(form.limit, "-1")
    driver.type(form.limit, "0.1")
    put(driver, Onto(tmp_path / "high.su2", "airfoil", 0.1))
    # The thread of the window does not compute it; a job does, and then the ghost is there.
    ghost = driver.window.scene.motion_ghosts
    assert np.array_equal(ghost["airfoil"], mesh.points[:24])
    assert largest_prescribed(driver.session.case, driver.session.mesh) == 0.0
    driver.qtbot.waitUntil(lambda: not driver.window.intersection_check.busy)
    ghost = driver.window.scene.motion_ghosts
    assert np.abs(ghost["airfoil"] - mesh.points[:24] - [0.0, 0.2]).max() < 0.02
    assert largest_prescribed(driver.session.case, driver.session.mesh) > 0.19
    assert listed(driver) == "1.  airfoil: lay onto high.su2"
    put(driver, Onto(tmp_path / "none.su2", "airfoil"))
    assert "The surface to lie on" in driver.window.run_panel.text.text()


@pytest.mark.parametrize("kind", KINDS)
def test_the_editor_has_a_row_for_each_field_of_each_kind(kind):
    fields = {*kind.__dataclass_fields__}
    assert {ROWS[name].attribute for name in kind.rows} <= fields | {*dir(kind)}


def test_arrow_keys_step_every_length_by_the_size_of_the_mesh(blade):
    extent = blade.session.mesh.extent
    for name, row in ROWS.items():
        field = getattr(editor(blade), name)
        for each in getattr(field, "fields", [field]):
            assert not row.is_length or each.extent == extent, name
    put(blade, Onto(Path("none.stl"), "airfoil"))
    QTest.keyClick(editor(blade).limit, Qt.Key.Key_Up)
    assert 0.001 * extent < blade.session.case.motions[0].limit <= 0.01 * extent


IN_TESTS_OF_THEIR_OWN = {
    HicksHenne: test_bumps_on_an_airfoil_are_shown_edited_and_kept,
    Cst: test_bumps_on_an_airfoil_are_shown_edited_and_kept,
    Bump: test_bumps_on_an_airfoil_are_shown_edited_and_kept,
    Ffd: test_motion_of_a_box_is_shown_edited_and_kept_and_takes_whole_numbers,
    FfdCamber: test_camber_and_thickness_of_a_box_are_shown_edited_and_kept,
    FfdThickness: test_camber_and_thickness_of_a_box_are_shown_edited_and_kept,
    FfdTwist: test_twist_of_a_box_is_shown_edited_and_kept,
    SpanMotion: test_a_curve_over_span_is_typed_checked_and_shown_with_its_ghost,
    FromFile: test_a_new_table_is_saved_and_used_and_its_rows_are_changed,
    Onto: test_a_boundary_is_laid_onto_a_surface_without_blocking_the_window,
}
"""Tests of kinds that need a box, a curve or a file, or move an airfoil alone."""


def test_every_kind_is_typed_in_a_test():
    assert {*MOVED, *IN_TESTS_OF_THEIR_OWN} == {*KINDS}
