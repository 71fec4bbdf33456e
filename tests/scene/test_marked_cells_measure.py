"""Measured points in the scene: picked where the mouse is, and drawn with their number."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.color_scheme import DARK, SELECTED_COLOR
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces, padded
from slideviz.scene.marked_cells import MeasureLayer
from slideviz.scene.pick import to_display
from slideviz.scene.scene import Scene
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.inspect import nodes_of
from slideviz.session.measure import Pick, add_pick, drop_pick
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from tests.builders import cube, square


@pytest.fixture(params=[square(4), cube(3)], ids=["2d", "3d"])
def shown(request):
    """A scene with a mesh, and its session."""
    plotter = pv.Plotter(off_screen=True, window_size=[420, 300])
    scene = Scene(plotter)
    mesh = request.param
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    scene.open(session, find_surfaces(mesh))
    plotter.render()
    yield scene, session
    plotter.close()


def seen(scene, point):
    return to_display(scene.plotter, padded(np.asarray(point)[None]))[0]


def front_facet(scene, session):
    """The nodes of a facet that faces the camera; of a 2D mesh of a cell."""
    if session.mesh.dim == 2:
        return nodes_of(session.mesh, 5)
    camera = np.array(scene.plotter.camera.position)
    every = [(one, facet) for one in scene.drawn.values() for facet in one.surface.facets]
    one, facet = min(
        every,
        key=lambda pair: np.linalg.norm(
            np.asarray(pair[0].shape.points)[pair[1]].mean(axis=0) - camera
        ),
    )
    return one.surface.nodes[facet]


def test_a_click_near_a_node_picks_it_and_elsewhere_the_place_on_the_face(shown):
    scene, session = shown
    mesh = session.mesh
    nodes = front_facet(scene, session)
    middle = mesh.points[nodes].mean(axis=0)
    for node in nodes:
        inwards = seen(scene, middle) - seen(scene, mesh.points[node])
        x, y = seen(scene, mesh.points[node]) + 5.0 * inwards / np.linalg.norm(inwards)
        assert scene.pick_point(x, y) == Pick((int(node),))
    found = scene.pick_point(*seen(scene, middle))
    assert len(found.nodes) > 1
    np.testing.assert_allclose(found.place(mesh), middle, atol=1e-3 * mesh.extent)
    assert scene.pick_point(2, 2) is None


def test_a_click_beside_the_mesh_picks_a_node_of_its_boundary(shown):
    scene, session = shown
    places = to_display(scene.plotter, padded(session.mesh.points))
    node = int(places[:, 0].argmin())
    x, y = places[node]
    assert scene.pick_point(x - 6.0, y) in [
        Pick((int(k),)) for k in np.flatnonzero(np.linalg.norm(places - (x, y), axis=1) < 6.0)
    ]
    assert scene.pick_point(x - 12.0, y) is None
    names = frozenset(session.mesh.marker_names)
    scene.update(changes.set_view(session, hidden=names))
    assert scene.pick_point(x - 6.0, y) is None


def test_a_place_on_a_section_lies_on_it(shown):
    scene, session = shown
    if session.mesh.dim == 2:
        return
    middle = session.mesh.points.mean(axis=0)
    plane = Section("plane", tuple(middle), (1.0, 0.0, 0.0), whole_cells=False)
    scene.update(changes.add_section(session, plane))
    scene.look_from("+x")
    scene.plotter.render()
    found = scene.pick_point(*(seen(scene, middle + np.array([0.0, 0.13, 0.07]))))
    assert found.place(session.mesh)[0] == pytest.approx(middle[0], abs=1e-6)


def test_points_lines_and_number_are_drawn_follow_the_step_and_go(shown):
    scene, session = shown
    mesh = session.mesh
    moved = mesh.with_points(2.0 * mesh.points)
    session = changes.add_frames(
        changes.start_run(session), [StepFrame(moved, quality(moved, reference=mesh))]
    )
    rim, line, dots, label = MeasureLayer.names
    session = changes.show_frame(session, 0)
    assert not {rim, line, dots, label} & set(scene.plotter.actors)
    for count, node in enumerate((0, 1, 7), start=1):
        session = add_pick(session, Pick((node,)))
        scene.update(session)
        actors = scene.plotter.actors
        assert scene.stage.shapes[dots].n_points == count
        assert scene.stage.shapes[line].n_cells == max(count - 1, 1)
    assert "°, r = " in actors[label].input
    assert actors[dots].prop.color.hex_rgb == SELECTED_COLOR
    before = np.asarray(scene.stage.shapes[line].points)
    wanted = mesh.points[[0, 1, 7]]
    np.testing.assert_allclose(before[:, : mesh.dim], wanted)
    scene.update(changes.show_frame(session, 1))
    after = np.asarray(scene.stage.shapes[line].points)
    np.testing.assert_allclose(after[:, : mesh.dim], 2.0 * wanted)
    scene.set_scheme(DARK)
    assert scene.plotter.actors[line].prop.color.hex_rgb == DARK.text
    two = drop_pick(session)
    scene.update(two)
    distance = np.linalg.norm(mesh.points[1] - mesh.points[0])
    assert float(scene.plotter.actors[label].input) == pytest.approx(distance, rel=1e-5)
    scene.update(drop_pick(drop_pick(two)))
    assert not {rim, line, dots, label} & set(scene.plotter.actors)
