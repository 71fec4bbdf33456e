"""Chosen and marked cells in the scene: exactly these, where they are, and to be seen."""

from collections import Counter

import numpy as np
import pytest
import pyvista as pv

from slideviz.color_scheme import INVERTED_COLOR, SELECTED_COLOR
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.quality import INVERTED, quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.samples.table import sample
from slideviz.scene.actors import VALUES, part_shape
from slideviz.scene.marked_cells import DOT, FACES, OUTLINE
from slideviz.scene.pick import to_display
from slideviz.scene.scene import Scene
from slideviz.sections.model import Section
from slideviz.sections.polygons import ONLY_INVERTED
from slideviz.session import changes
from slideviz.session.inspect import nodes_of
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame


@pytest.fixture
def scene():
    plotter = pv.Plotter(off_screen=True, window_size=[420, 300])
    yield Scene(plotter)
    plotter.close()


@pytest.fixture(scope="module")
def bent(cube):
    """A session of the cube with one step that shakes every node inside, at it, by quality."""
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    return stepped(session, 0.02)


def stepped(session, *sizes):
    mesh, rng = session.mesh, np.random.default_rng(7)
    shake = rng.uniform(-1, 1, mesh.points.shape)
    edge = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    shake[edge] = 0.0
    frames = []
    for size in sizes:
        moved = mesh.with_points(mesh.points + size * mesh.extent * shake)
        frames.append(StepFrame(moved, quality(moved, mesh)))
    session = changes.add_frames(changes.start_run(session), frames)
    return changes.set_view(session, color_by="size-skew", motion_ghost=False)


def opened(scene, session):
    scene.open(session, find_surfaces(session.mesh))
    return session


def image(scene):
    scene.plotter.render()
    return np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)


def count(picture, color, within=14):
    rgb = np.array(pv.Color(color).int_rgb)
    return int((np.abs(picture[..., :3] - rgb).max(axis=2) <= within).sum())


def seen_at(scene, point):
    return to_display(scene.plotter, np.array([[*point, 0.0][:3]]))[0]


def outside(mesh, cells):
    """Return the sides that one cell alone of these has, as sets of nodes with their owner."""
    sides = []
    for cell in cells:
        nodes = nodes_of(mesh, int(cell))
        facets = ELEMENTS[int(mesh.cells.types[cell])].facets
        sides += [(frozenset(nodes[list(facet)].tolist()), int(cell)) for facet in facets]
    times = Counter(side for side, _ in sides)
    return {(side, cell) for side, cell in sides if times[side] == 1}


def drawn(shape):
    """Return the polygons of a shape as sets of nodes of the mesh, with their owner."""
    nodes = np.asarray(shape.point_data["vtkOriginalPointIds"])
    owner = np.asarray(shape.cell_data["vtkOriginalCellIds"])
    faces = [shape.get_cell(i).point_ids for i in range(shape.n_cells)]
    return {
        (frozenset(nodes[face].tolist()), int(cell))
        for face, cell in zip(faces, owner, strict=True)
    }


def in_range(frame, low, high):
    return np.flatnonzero((frame.quality.values >= low) & (frame.quality.values <= high))


@pytest.mark.parametrize("name", ["hexahedron", "cylindrical"])
def test_the_sides_drawn_are_those_between_chosen_cells_and_others(name):
    mesh = sample(name, size=5).mesh
    for seed in range(3):
        rng = np.random.default_rng(seed)
        cells = np.flatnonzero(rng.random(len(mesh.cells)) < (0.1, 0.5, 0.9)[seed])
        assert drawn(part_shape(mesh, cells)) == outside(mesh, cells)


def test_3d_exactly_the_cells_in_the_range_are_drawn(scene, bent):
    session = opened(scene, bent)
    values = session.frame.quality.values
    low, high = np.quantile(values, [0.1, 0.4])
    session = changes.set_view(session, threshold=(low, high))
    scene.update(session)
    layer, wanted = scene._threshold, in_range(session.frame, low, high)
    assert 0 < len(wanted) < len(values)
    assert layer.cells.tolist() == wanted.tolist()
    assert drawn(layer.shape) == outside(session.mesh, wanted)
    # They have the colors of their values and are where the step has put them.
    assert np.array_equal(layer.shape.cell_data[VALUES], values[layer.owner])
    nodes = layer.shape.point_data["vtkOriginalPointIds"]
    assert np.allclose(layer.shape.points, session.frame.mesh.points[nodes])
    assert layer.actor.visibility
    assert all(one.actor.prop.opacity < 0.5 for one in scene.drawn.values())
    scene.update(changes.set_view(session, threshold=None))
    assert not layer.actor.visibility
    assert layer.cells is None
    assert all(one.actor.prop.opacity == 1.0 for one in scene.drawn.values())


def test_the_range_is_that_of_what_the_view_is_colored_by(scene, bent):
    session = opened(scene, changes.set_view(bent, threshold=(0.0, 0.9)))
    by_size = changes.set_view(session, color_by="size")
    scene.update(by_size)
    wanted = np.flatnonzero(by_size.frame.quality.size <= 0.9)
    assert scene._threshold.cells.tolist() == wanted.tolist()
    assert wanted.tolist() != in_range(session.frame, 0.0, 0.9).tolist()


def test_chosen_cells_follow_the_step(scene, cube):
    session = stepped(open_mesh(StepFrame(cube, quality(cube)), None), 0.01, 0.02)
    session = opened(scene, changes.set_view(session, threshold=(0.0, 0.8)))
    for frame in (2, 1, 2):
        session = changes.show_frame(session, frame)
        scene.update(session)
        assert scene._threshold.cells.tolist() == in_range(session.frame, 0.0, 0.8).tolist()
    # The same cells at another step: moved in place.
    every = changes.set_view(session, threshold=(0.0, 1.0))
    scene.update(every)
    shape = scene._threshold.shape
    scene.update(changes.show_frame(every, 1))
    assert scene._threshold.shape is shape
    nodes = shape.point_data["vtkOriginalPointIds"]
    assert np.allclose(shape.points, every.frames[1].mesh.points[nodes])


def test_inverted_cells_alone_can_be_chosen(scene, cube):
    session = stepped(open_mesh(StepFrame(cube, quality(cube)), None), 0.12)
    assert session.frame.quality.inverted
    session = opened(scene, changes.set_view(session, threshold=ONLY_INVERTED))
    assert len(scene._threshold.cells) == session.frame.quality.inverted
    assert count(image(scene), INVERTED_COLOR, 60) > 50


def test_rings_are_at_all_inverted_cells_or_at_those_that_sections_cut(scene, cube):
    def rings():
        actor = scene.plotter.actors.get("points:inverted")
        return 0 if actor is None else actor.mapper.dataset.n_points

    session = stepped(open_mesh(StepFrame(cube, quality(cube)), None), 0.12)
    session = opened(scene, session)
    inverted = session.frame.quality.inverted
    assert rings() == inverted
    middle = Section("plane", tuple(np.mean(cube.bounds, axis=0)), (0.0, 0.0, 1.0))
    scene.update(changes.add_section(session, middle))
    cut = np.unique(scene.sections.drawn["section:0"].polygons.cells)
    assert 0 < rings() < inverted
    assert rings() == (session.frame.quality.status[cut] == INVERTED).sum()
    assert [words for words, _ in scene.stage.ring_words] == [f"{rings()} inv.", "in section"]
    image(scene)
    scene.update(session)
    assert rings() == inverted
    assert [words for words, _ in scene.stage.ring_words] == [f"{inverted} inv."]


def test_a_range_that_holds_nothing_draws_nothing(scene, bent):
    opened(scene, changes.set_view(bent, threshold=(0.001, 0.002)))
    assert len(scene._threshold.cells) == 0
    assert scene.pick_cell(210, 150) is None
    image(scene)


def test_2d_the_other_cells_vanish(scene, session):
    points = session.mesh.points.copy()
    points[12] += 0.4
    mesh = session.mesh.with_points(points)
    session = changes.add_frames(
        changes.start_run(session), [StepFrame(mesh, quality(mesh, session.mesh))]
    )
    session = opened(scene, changes.set_view(session, color_by="size-skew", edges=True))
    whole = image(scene)
    scene.update(changes.set_view(session, threshold=(0.0, 0.99)))
    assert scene._threshold.cells.tolist() == [5, 6, 9, 10]
    picture = image(scene)

    def color(picture, point):
        x, y = seen_at(scene, point)
        return picture[picture.shape[0] - 1 - int(y), int(x), :3]

    assert np.abs(color(picture, (2.8, 2.6)) - color(whole, (2.8, 2.6))).max() < 12
    # Outside a chosen cell the faint area, without color.
    assert np.ptp(color(whole, (0.4, 3.6))) > 60
    assert np.ptp(color(picture, (0.4, 3.6))) < 25
    x, y = seen_at(scene, (0.4, 3.6))
    assert scene.pick_cell(x, y) is None
    scene.update(session)
    assert np.array_equal(image(scene), whole)


def test_the_cell_under_a_pixel_2d(scene, session):
    opened(scene, session)
    for cell in (0, 6, 15):
        x, y = seen_at(scene, session.mesh.points[nodes_of(session.mesh, cell)].mean(axis=0))
        assert scene.pick_cell(x, y) == cell
    assert scene.pick_cell(2, 2) is None


def test_the_cell_under_a_pixel_3d_is_the_owner_of_the_side_in_front(scene, bent):
    session = opened(scene, bent)
    scene.look_from("+x")
    image(scene)
    mesh = session.frame.mesh
    right = [one for one in scene.drawn.values() if np.ptp(one.shape.points[:, 0]) < 1e-9]
    front = max(right, key=lambda one: one.shape.points[:, 0].max())
    for facet in (0, 20, 41):
        at = front.shape.points[front.surface.facets[facet]].mean(axis=0)
        x, y = to_display(scene.plotter, at[None])[0]
        assert scene.pick_cell(x, y) == front.surface.owner[facet]
    assert scene.pick_cell(1, 1) is None
    # While cells are chosen, the boundaries are in nobody's way.
    inner = int(np.argmin(session.frame.quality.values))
    low = float(session.frame.quality.values[inner])
    scene.update(changes.set_view(session, threshold=(low, low)))
    x, y = to_display(scene.plotter, mesh.points[nodes_of(mesh, inner)].mean(axis=0)[None])[0]
    image(scene)
    assert scene.pick_cell(x, y) == inner


def test_a_marked_cell_is_outlined_and_followed(scene, session):
    points = session.mesh.points.copy()
    points[12] += 0.4
    mesh = session.mesh.with_points(points)
    session = changes.add_frames(
        changes.start_run(session), [StepFrame(mesh, quality(mesh, session.mesh))]
    )
    session = opened(scene, session)
    assert count(image(scene), SELECTED_COLOR) == 0
    marked = changes.mark_cell(session, 10)
    scene.update(marked)
    assert count(image(scene), SELECTED_COLOR) > 150
    for frame in (1, 0):
        shown = changes.show_frame(marked, frame)
        scene.update(shown)
        lines = scene.plotter.actors[OUTLINE].mapper.dataset
        wanted = shown.frame.mesh.points[nodes_of(mesh, 10)]
        by_node = np.lexsort(lines.points[:, :2].T), np.lexsort(wanted.T)
        assert np.allclose(lines.points[by_node[0], :2], wanted[by_node[1]])
        assert lines.n_cells == 4
    scene.update(session)
    assert count(image(scene), SELECTED_COLOR) == 0
    assert OUTLINE not in scene.plotter.actors
    assert DOT not in scene.plotter.actors


def test_a_marked_cell_inside_a_3d_mesh_is_seen_through_its_boundaries(scene, bent):
    session = opened(scene, bent)
    beside = np.concatenate([one.surface.owner for one in scene.drawn.values()])
    inner = next(cell for cell in range(len(session.mesh.cells)) if cell not in beside)
    marked = changes.mark_cell(session, inner)
    scene.update(marked)
    assert all(one.actor.prop.opacity < 0.5 for one in scene.drawn.values())
    assert count(image(scene), SELECTED_COLOR) > 60
    faces = scene.plotter.actors[FACES].mapper.dataset
    assert drawn(faces) == outside(session.mesh, [inner])
    assert set(faces.cell_data[VALUES]) == {session.frame.quality.values[inner]}
    # One beside a boundary needs no such thing; its outline is in front even from behind.
    scene.update(changes.mark_cell(session, int(beside[0])))
    assert all(one.actor.prop.opacity == 1.0 for one in scene.drawn.values())
    for side in ("+x", "-x"):
        scene.look_from(side)
        assert count(image(scene), SELECTED_COLOR) > 60


def test_flying_to_a_cell_puts_it_into_the_middle_at_a_good_size(scene, bent):
    session = opened(scene, bent)
    before = scene.camera.place
    cell = 200
    at = session.frame.mesh.points[nodes_of(session.mesh, cell)]
    scene.fly_to(cell)
    image(scene)
    assert np.allclose(scene.plotter.camera.focal_point, at.mean(axis=0))
    seen = to_display(scene.plotter, at)
    assert 300 / 16 < np.ptp(seen, axis=0).max() < 300 / 4
    scene.camera.move_to(before)
    assert np.allclose(scene.camera.place, before)
    scene.fly_to(10**9)
    assert np.allclose(scene.camera.place, before)
