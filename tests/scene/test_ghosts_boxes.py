"""Boxes as people see them: what `slideviz info` says of them, and their lattice in the view."""

import json

import numpy as np
import pytest
import pyvista as pv

import slideviz as sv
from slideviz.cli import run
from slideviz.color_scheme import DARK
from slideviz.ffd.box import plane_corners, regular_box
from slideviz.ffd.section import with_boxes
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.scene.ghosts import BASE, CHOSEN, LABELS, MOVED
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame, ViewState
from tests.ffd.ffd_samples import square

CORNERS = plane_corners(np.array([[-0.1, -0.2], [1.1, -0.2], [1.1, 0.3], [-0.1, 0.3]]))
FLAT, SPLINES = regular_box("BOX", CORNERS, (3, 1, 1), None), (4, 2, 2)
PUSH = sv.Ffd("y_low", "BOX", (2, 1, -1), (0.0, 0.5, 0.0))


@pytest.fixture
def boxed():
    return with_boxes(square(), [FLAT, regular_box("TIP", CORNERS, (5, 2, 1), SPLINES)])


@pytest.fixture
def scene():
    plotter = pv.Plotter(off_screen=True, window_size=[300, 200])
    yield Scene(plotter)
    plotter.close()


def session_of(mesh, *motions):
    case = sv.Case(roles={"y_low": "moving"}, motions=motions)
    return open_mesh(StepFrame(mesh, quality(mesh)), None, (), case)


def test_info_lists_boxes(boxed, tmp_path, capsys):
    sv.write(tmp_path / "mesh.su2", boxed)
    assert run(["info", str(tmp_path / "mesh.su2")]) == 0
    told = [" ".join(line.split()) for line in capsys.readouterr().out.splitlines()]
    at = told.index("FFD boxes:")
    assert told[at + 1 : at + 3] == [
        "BOX degree 3 x 1, Bézier",
        "TIP degree 5 x 2, uniform B-splines of order 4 x 2",
    ]
    assert run(["info", str(tmp_path / "mesh.su2"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["ffd_boxes"] == [
        {"name": "BOX", "degrees": [3, 1], "orders": None},
        {"name": "TIP", "degrees": [5, 2], "orders": [4, 2]},
    ]


def test_info_tells_what_is_wrong_with_boxes_and_the_rest(boxed, tmp_path, capsys):
    sv.write(tmp_path / "mesh.su2", boxed)
    text = (tmp_path / "mesh.su2").read_text()
    (tmp_path / "mesh.su2").write_text(text.replace("FFD_DEGREE_I= 3", "FFD_DEGREE_I= 0"))
    assert run(["info", str(tmp_path / "mesh.su2")]) == 0
    told = capsys.readouterr().out
    assert "FFD boxes: " in told
    assert "the degree of i is 0" in told
    assert "quality: min" in told


def test_lattices_are_drawn_where_they_are_wanted(boxed, scene):
    session = session_of(boxed)
    scene.open(session, find_surfaces(boxed))
    assert not {BASE, MOVED, LABELS} & set(scene.plotter.actors)
    session = changes.set_view(session, ffd=True)
    scene.update(session)
    shape = scene.plotter.actors[BASE].mapper.dataset
    assert (shape.n_points, shape.n_lines) == (4 * 2 + 6 * 3, 4 + 2 * 3 + 2 * 6 + 3 * 5)
    assert MOVED not in scene.plotter.actors
    # A motion takes one of the control points along, and only of its box is another drawn.
    scene.update(changes.add_motion(session, PUSH))
    moved = scene.plotter.actors[MOVED].mapper.dataset
    shift = np.asarray(moved.points)[:, :2] - FLAT.points[:, :, 0, :2].reshape(-1, 2)
    assert moved.n_points == 8
    assert np.flatnonzero(shift.any(axis=1)).tolist() == [5]
    assert shift[5] == pytest.approx([0.0, 0.5])
    scene.set_scheme(DARK)
    assert scene.plotter.actors[BASE].prop.color.hex_rgb != "#000000"
    scene.update(changes.set_view(session, ffd=False))
    assert not {BASE, MOVED, LABELS} & set(scene.plotter.actors)


def test_solid_boxes_are_drawn_in_space(scene):
    mesh = square(3, dim=3)
    corners = np.array(
        [[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float
    )
    boxed = with_boxes(mesh, [regular_box("CUBE", corners, (2, 1, 1), None)])
    scene.open(changes.set_view(session_of(boxed), ffd=True), find_surfaces(boxed))
    shape = scene.plotter.actors[BASE].mapper.dataset
    assert (shape.n_points, shape.n_lines) == (12, 8 + 6 + 6)


def test_boxes_are_drawn_at_first_where_a_motion_is_of_one(boxed):
    plain = session_of(boxed)
    assert "ffd" not in plain.view.drawn
    opened = session_of(boxed, PUSH)
    assert "ffd" in opened.view.drawn
    assert "ffd" in changes.inherit_view(opened, ViewState()).view.drawn
    added = changes.add_motion(plain, PUSH)
    assert "ffd" in added.view.drawn
    # Who takes them away is not asked again by the next number that is typed.
    gone = changes.set_view(added, ffd=False)
    other = changes.replace_motion(gone, 0, sv.Ffd("y_low", "BOX", (2, 1, -1), (0.0, 0.1, 0.0)))
    assert "ffd" not in other.view.drawn


def test_the_chosen_control_points_are_marked_at_zero_and_none_that_is_not_there(boxed, scene):
    session = session_of(boxed, sv.Ffd("y_low", "BOX", (2, -1, -1), (0.0, 0.0, 0.0)))
    session = changes.set_view(session, ffd=True)
    scene.open(session, find_surfaces(boxed))
    assert CHOSEN not in scene.plotter.actors
    chosen = changes.choose_motion(session, 0)
    scene.update(chosen)
    assert scene.stage.shapes[CHOSEN].n_points == 4
    lacking = sv.Ffd("y_low", "BOX", (9, -1, -1), (0.0, 0.0, 0.0))
    scene.update(changes.replace_motion(chosen, 0, lacking))
    assert CHOSEN not in scene.plotter.actors
