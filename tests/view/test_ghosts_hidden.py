"""A ghost in the same place as its boundary is not drawn over it."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.mesh.quality import quality
from slideviz.view import changes
from slideviz.view.scene import Scene
from slideviz.view.state import Frame
from slideviz.view.surfaces import find_surfaces


@pytest.fixture
def scene():
    plotter = pv.Plotter(off_screen=True, window_size=[300, 300])
    yield Scene(plotter)
    plotter.close()


def test_a_boundary_that_stays_in_its_surface_is_drawn_whole(scene, cube):
    names = cube.marker_names
    session = changes.open_mesh(Frame(cube, quality(cube)), None)
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
