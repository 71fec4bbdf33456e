"""A ghost in the same place as its boundary is not drawn over it."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.scene.ghosts import WIRE
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame, second_view


@pytest.fixture
def scene():
    plotter = pv.Plotter(off_screen=True, window_size=[300, 300])
    yield Scene(plotter)
    plotter.close()


def test_a_boundary_that_stays_in_its_surface_is_drawn_whole(scene, cube):
    names = cube.marker_names
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_role(session, names, "fixed")
    scene.open(session, find_surfaces(cube))
    scene.look_from("iso")
    scene.plotter.render()
    before = np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)
    nodes = {marker.name: marker.nodes for marker in cube.markers}
    scene.set_motion_ghosts({name: cube.points[nodes[name]] for name in names})
    scene.plotter.render()
    after = np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)
    # But for the outline, where half a pixel of the ghost is seen beside it.
    assert (np.abs(after - before).max(axis=2) > 8).mean() < 0.01
    away = cube.points + 0.3 * cube.extent
    scene.set_motion_ghosts({name: away[nodes[name]] for name in names})
    scene.plotter.render()
    apart = np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)
    assert (np.abs(apart - before).max(axis=2) > 8).mean() > 0.05, "elsewhere it is seen"


def image(scene):
    scene.plotter.render()
    return np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)


def slid(cube, name):
    """The points of a side of the cube, pushed along x within its plane."""
    return cube.points[cube.marker(name).nodes] + np.array([0.25, 0.0, 0.0])


def side_of(cube, normal):
    """The boundary that lies in the plane z = 1, or another."""
    low, high = cube.points.min(axis=0), cube.points.max(axis=0)
    middle = (low + high) / 2.0 + np.asarray(normal) * (high - low) / 2.0
    return min(
        cube.marker_names,
        key=lambda name: np.linalg.norm(cube.points[cube.marker(name).nodes].mean(axis=0) - middle),
    )


def test_a_boundary_that_slides_in_its_surface_keeps_its_color_within_the_rim(scene, cube):
    top = side_of(cube, (0, 0, 1))
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_role(session, (top,), "moving")
    session = changes.set_view(session, edges=False, legend=False, triad=False)
    scene.open(session, find_surfaces(cube))
    scene.look_from("+z")
    before = image(scene)
    scene.set_motion_ghosts({top: slid(cube, top)})
    after = image(scene)
    changed = np.abs(after - before).max(axis=2) > 8
    # Inside of the mesh only the left edge of the rim is drawn over it, without patches.
    box = np.abs(before - before[2, 2]).max(axis=2) > 30
    rows, columns = np.nonzero(box)
    inner = (slice(rows.min() + 6, rows.max() - 6), slice(columns.min() + 6, columns.max() - 6))
    share = changed[inner].mean(axis=0)
    assert (share > 0.9).sum() in range(1, 7)
    assert ((share < 0.02) | (share > 0.9)).mean() > 0.97
    # Beside it the ghost is seen.
    assert changed[rows.mean().astype(int), columns.max() + 4]


def test_the_undeformed_mesh_has_no_ghost_of_itself(scene, cube):
    top = side_of(cube, (0, 0, 1))
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_role(session, (top,), "moving")
    scene.open(session, find_surfaces(cube))
    before = image(scene)
    session = changes.set_view(session, undeformed=True)
    scene.update(session)
    assert np.array_equal(image(scene), before)
    moved = cube.with_points(cube.points * (1.0, 1.0, 1.5))
    session = changes.add_frames(changes.start_run(session), [StepFrame(moved, quality(moved))])
    scene.update(session)
    assert scene.plotter.actors[f"undeformed:{top}"].visibility
    scene.update(changes.show_frame(session, 0))
    assert not scene.plotter.actors[f"undeformed:{top}"].visibility


def test_beside_a_run_the_undeformed_mesh_has_no_motion_ghost(scene, cube):
    top = side_of(cube, (0, 0, 1))
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_role(session, (top,), "moving")
    scene.open(session, find_surfaces(cube))
    scene.set_motion_ghosts({top: slid(cube, top)})
    ghost = scene.plotter.actors[f"motion:{top}"]
    assert ghost.visibility
    frames = [StepFrame(cube, quality(cube))]
    session = changes.end_run(changes.add_frames(changes.start_run(session), frames), "done")
    session = changes.show_beside(session, changes.UNDEFORMED)
    for state in (second_view(session), changes.show_frame(session, 0)):
        scene.update(state)
        assert not ghost.visibility
    # Settings that have changed since are told of over the run.
    scene.update(changes.set_role(session, (top,), "fixed"))
    assert ghost.visibility
    scene.set_motion_ghosts({})
    assert not any(name.startswith("motion:") for name in scene.plotter.actors)


def moving_top(cube, scene):
    """A session whose upper side moves, opened in the scene and seen from above."""
    top = side_of(cube, (0, 0, 1))
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_role(session, (top,), "moving")
    session = changes.set_view(session, edges=False, legend=False, triad=False)
    scene.open(session, find_surfaces(cube))
    return top, session


def ran_to(session, *meshes):
    frames = [StepFrame(mesh, quality(mesh)) for mesh in meshes]
    return changes.end_run(changes.add_frames(changes.start_run(session), frames), "done")


def test_a_boundary_that_goes_into_the_solid_is_seen_through_what_is_before_it(scene, cube):
    top, _ = moving_top(cube, scene)
    scene.look_from("-y")
    before = image(scene)
    inwards = cube.points[cube.marker(top).nodes] - np.array([0.0, 0.0, 0.4 * cube.extent / 3])
    scene.set_motion_ghosts({top: inwards})
    changed = np.abs(image(scene) - before).max(axis=2) > 25
    across = changed.sum(axis=1)
    assert across.max() > 100, "the rim is a line over the whole side"
    assert (across > 100).sum() < 8


def test_a_wall_that_is_dented_within_its_rim_is_seen_through_what_is_before_it(scene, cube):
    top, _ = moving_top(cube, scene)
    scene.look_from("-y")
    before = image(scene)
    nodes = cube.marker(top).nodes
    low, high = cube.points[nodes].min(axis=0), cube.points[nodes].max(axis=0)
    part = (cube.points[nodes] - low)[:, :2] / (high - low)[:2]
    dent = cube.points[nodes].copy()
    dent[:, 2] -= 0.3 * cube.extent * np.prod(4.0 * part * (1.0 - part), axis=1)
    scene.set_motion_ghosts({top: dent})
    changed = np.abs(image(scene) - before).max(axis=2) > 25
    assert changed.sum() > 300
    # Where the rim goes along, it is enough.
    scene.set_motion_ghosts({top: cube.points[nodes] + (0.0, 0.0, 1.0)})
    assert not scene.plotter.actors[f"motion:{top}{WIRE}"].visibility
    scene.set_motion_ghosts({})
    assert not any(name.startswith("motion:") for name in scene.plotter.actors)


def test_a_ghost_is_not_drawn_over_the_boundary_that_has_arrived(scene, cube):
    top, session = moving_top(cube, scene)
    half = cube.with_points(cube.points * (1.0, 1.0, 1.2))
    whole = cube.with_points(cube.points * (1.0, 1.0, 1.4))
    scene.set_motion_ghosts({top: whole.points[cube.marker(top).nodes]})
    session = ran_to(session, half, whole)
    session = changes.set_case(session, steps=session.case.steps + 1)
    assert session.outdated
    ghost = scene.plotter.actors[f"motion:{top}"]
    for frame, seen in ((1, True), (2, False), (0, True)):
        scene.update(changes.show_frame(session, frame))
        assert bool(ghost.visibility) == seen


def test_runs_beside_each_other_both_have_a_motion_ghost_or_none(scene, cube):
    top, session = moving_top(cube, scene)
    moved = cube.with_points(cube.points * (1.0, 1.0, 1.2))
    scene.set_motion_ghosts({top: cube.points[cube.marker(top).nodes] + cube.extent})
    ghost = scene.plotter.actors[f"motion:{top}"]
    for sliding in ("ps", "ds"):
        session = ran_to(changes.set_case(session, sliding=sliding), moved)
    session = changes.show_beside(session, 1)
    for state in (session, second_view(session)):
        scene.update(state)
        assert not ghost.visibility, "both runs have this motion"
    session = changes.set_role(session, (top,), "fixed")
    for state in (session, second_view(session)):
        scene.update(state)
        assert ghost.visibility, "no run has shown this yet"
