"""Shapes that are moved in place outlive a collection of garbage."""

import gc

import numpy as np
import pytest

from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.samples.table import sample
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame


@pytest.fixture
def window_size():
    return [300, 200]


@pytest.fixture
def stator():
    return sample("stator", size=5000)


def opened(plotter, made):
    scene = Scene(plotter)
    session = open_mesh(StepFrame(made.mesh, quality(made.mesh)), None, (), made.case)
    surfaces = find_surfaces(made.mesh)
    scene.open(session, surfaces)
    return scene, session, {surface.name: surface for surface in surfaces}


def test_a_ghost_moves_after_garbage_was_collected(plotter, stator):
    scene, session, surfaces = opened(plotter, stator)
    points = stator.mesh.points[surfaces["BLADE"].nodes]
    scene.set_motion_ghosts({"BLADE": points + 0.001})
    scene.update(session)
    gc.collect()
    scene.set_motion_ghosts({"BLADE": points + 0.002})
    scene.update(changes.select(session, ("INFLOW",)))
    shown = plotter.actors["motion:BLADE"].mapper.dataset.points
    np.testing.assert_allclose(shown, points + 0.002, atol=1e-8)


def test_a_marked_cell_moves_after_garbage_was_collected(plotter, stator):
    scene, session, _ = opened(plotter, stator)
    marked = changes.mark_cell(session, 17)
    scene.update(marked)
    gc.collect()
    mesh = stator.mesh.with_points(stator.mesh.points + 0.01)
    run = changes.end_run(
        changes.add_frames(changes.start_run(marked), [StepFrame(mesh, quality(mesh))]), "done"
    )
    scene.update(changes.mark_cell(run, 17))
    corners = mesh.points[mesh.cells.connectivity[17 * 8 : 18 * 8]]
    low, high = corners.min(axis=0), corners.max(axis=0)
    names = [name for name in plotter.actors if name.startswith("mark:")]
    assert len(names) == 3
    for name in names:
        at = plotter.actors[name].mapper.dataset.points
        assert (at >= low - 1e-6).all()
        assert (at <= high + 1e-6).all()
