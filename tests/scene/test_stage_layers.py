"""Points, neighbouring passages and axes in the scene, judged by where which colors are."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.case.motions.box import Ffd
from slideviz.case.motions.rigid import Rotate
from slideviz.color_scheme import DARK, LIGHT
from slideviz.ffd.box import CORNERS, regular_box
from slideviz.ffd.section import with_boxes
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.samples.table import sample
from slideviz.scene.actors import VALUES
from slideviz.scene.ghosts import circles
from slideviz.scene.legend import COLORS, SIZE
from slideviz.scene.mesh import PALER, THRESHOLD, PassageLayer, ThresholdLayer, outermost
from slideviz.scene.pick import to_display
from slideviz.session import changes
from slideviz.session.inspect import cell_centers
from slideviz.session.opening import open_mesh
from slideviz.session.passages import matrices, period_of
from slideviz.session.state import StepFrame
from slideviz.terms import NODE_TYPES, ROLES
from tests.builders import far_field

LEFT = np.array([-0.004, 0.0])


@pytest.fixture
def window_size():
    return [620, 460]


@pytest.fixture(scope="module")
def row():
    return sample("turbine-row", size=5000)


@pytest.fixture(scope="module")
def stator():
    return sample("stator", size=5000)


def opened(scene, one, **view):
    session = open_mesh(StepFrame(one.mesh, quality(one.mesh)), None, (), one.case)
    session = changes.set_view(session, **view)
    scene.open(session, find_surfaces(one.mesh))
    return session


def image(scene):
    scene.plotter.render()
    return np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)


def near(scene, point, reach=3):
    """Return the colors around a point of the mesh, (k, 3)."""
    picture = image(scene)
    x, y = to_display(scene.plotter, np.array([list(point) + [0.0] * (3 - len(point))]))[0]
    row, column = picture.shape[0] - 1 - round(y), round(x)
    part = picture[row - reach : row + reach + 1, column - reach : column + reach + 1, :3]
    return part.reshape(-1, 3)


def has(colors, wanted, within=45, least=1):
    """Return whether so many pixels have about that color."""
    off = np.abs(colors - np.array(pv.Color(wanted).int_rgb)).max(axis=1)
    return int((off < within).sum()) >= least


def deformed(session, shift):
    """Return the session at a step in which all points have moved by ``shift``."""
    mesh = session.mesh.with_points(session.mesh.points + shift)
    frame = StepFrame(mesh, quality(mesh, session.mesh))
    return changes.add_frames(changes.start_run(session), [frame])


# Points -----------------------------------------------------------------------------------


def test_points_have_the_color_of_their_type_where_the_nodes_are(scene, row):
    session = opened(scene, row, points="types", color_by="size-skew", edges=False, triad=False)
    mesh = row.mesh
    blade = mesh.points[mesh.marker("BLADE").nodes]
    inflow = mesh.points[mesh.marker("INFLOW").nodes]
    # The line of the boundary has the color of its role: a point is wider.
    assert has(near(scene, blade[5]), NODE_TYPES["moving"].color, least=22)
    assert has(near(scene, inflow[len(inflow) // 2]), NODE_TYPES["sliding_edge"].color)
    scene.update(changes.set_view(session, points="none"))
    assert not has(near(scene, blade[5]), NODE_TYPES["moving"].color, least=22)
    assert not has(near(scene, inflow[len(inflow) // 2]), NODE_TYPES["sliding_edge"].color)


def test_points_follow_the_step_and_their_boundary(scene, row):
    session = opened(scene, row, points="types", color_by="size-skew", edges=False, triad=False)
    at = row.mesh.points[row.mesh.marker("BLADE").nodes][5]
    moved = deformed(session, LEFT)
    scene.update(moved)
    assert has(near(scene, at + LEFT), NODE_TYPES["moving"].color)
    assert not has(near(scene, at), NODE_TYPES["moving"].color, 25)
    hidden = changes.show_boundaries(moved, ("BLADE",), False)
    scene.update(hidden)
    assert not has(near(scene, at + LEFT), NODE_TYPES["moving"].color)
    scene.update(changes.show_frame(changes.show_boundaries(hidden, ("BLADE",)), 0))
    assert has(near(scene, at), NODE_TYPES["moving"].color)


def test_the_legend_names_the_points(scene, row):
    session = opened(scene, row, points="types", color_by="size-skew")

    def words():
        found = [name.split(":") for name in scene.plotter.actors if name.startswith("legend:")]
        return {parts[2] for parts in found if parts[1] == "nodes"}

    assert words() == {"moving", "sliding edge", "periodic"}
    bar = scene.plotter.scalar_bars["size-skew"]
    with_points = bar.GetHeight()
    scene.update(changes.set_view(session, points="none", color_by="size-skew"))
    assert not words()
    assert scene.plotter.scalar_bars["size-skew"].GetHeight() > with_points
    scene.update(changes.set_view(session, color_by="role"))
    assert words() == {"moving", "sliding edge", "periodic"}
    assert "legend:moving:moving" in scene.plotter.actors, "the role is named, too"


# Neighbouring passages --------------------------------------------------------------------


def test_neighbours_of_a_row_are_drawn_one_pitch_away(scene, row):
    pitch = period_of(open_mesh(StepFrame(row.mesh, quality(row.mesh)), None)).vector
    nodes = row.mesh.marker("BLADE").nodes
    at = row.mesh.points[nodes[len(nodes) // 3]]
    session = opened(scene, row, passages=1, edges=False, triad=False)
    orange = np.array(pv.Color(ROLES["moving"].color).int_rgb)
    plain = np.array(pv.Color(LIGHT.cell).int_rgb)
    paler = pv.Color((orange + PALER * (plain - orange)).astype(int).tolist())
    assert has(near(scene, at), ROLES["moving"].color, 20)
    for side in (-1, 1):
        assert has(near(scene, at + side * pitch), paler, 20), side
        assert not has(near(scene, at + side * pitch), ROLES["moving"].color, 20), "not paler"
    assert scene.pick(*to_display(scene.plotter, [[*(at + pitch), 0.0]])[0]) != "BLADE"
    scene.update(changes.set_view(session, passages=0))
    assert not has(near(scene, at + pitch), paler, 20)
    assert not [name for name in scene.plotter.actors if name.startswith("copy:")]


def test_neighbours_of_a_stator_are_turned(scene, stator):
    session = opened(scene, stator, passages=1)
    copies = {
        name: actor for name, actor in scene.plotter.actors.items() if name.startswith("copy:")
    }
    assert len(copies) == 2 * len(stator.mesh.markers)
    drawn = scene.drawn["BLADE"]
    for number in (-1, 1):
        actor = copies[f"copy:{number}:BLADE"]
        assert actor.mapper.dataset is drawn.shape, "the data is shared"
        angle = np.arctan2(actor.user_matrix[1, 0], actor.user_matrix[0, 0])
        assert abs(abs(angle) - 2 * np.pi / 41) < 1e-6
    # The second periodic side of one is the first of the next.
    period = period_of(session)
    first = stator.mesh.points[stator.mesh.marker(period.first).nodes]
    second = stator.mesh.points[stator.mesh.marker(period.second).nodes]
    moved = first @ matrices(session, period)[1][:3, :3].T
    gap = np.linalg.norm(moved[:, None] - second[None], axis=2).min(axis=1)
    assert gap.max() < 1e-6


def test_a_whole_wheel_is_drawn_once_and_fits_the_view(scene, stator):
    session = opened(scene, stator)
    near_scale = scene.plotter.camera.parallel_scale
    scene.update(changes.set_view(session, passages=-1))
    names = {name for name in scene.plotter.actors if name.endswith(":BLADE") and "copy" in name}
    assert len(names) == 40
    scene.camera.fit()
    assert scene.plotter.camera.parallel_scale > 3 * near_scale
    copies = next(layer for layer in scene.layers if isinstance(layer, PassageLayer))
    points = np.concatenate([shape.points for shape in copies.shapes()])
    seen = to_display(scene.plotter, points)
    assert seen.min() > 0
    assert (seen.max(axis=0) < [620 - 100, 460]).all()


def test_neighbours_follow_the_step_and_the_colors(scene, row):
    session = opened(scene, row, passages=1, edges=False, triad=False)
    pitch = period_of(session).vector
    nodes = row.mesh.marker("BLADE").nodes
    at = row.mesh.points[nodes[len(nodes) // 3]]
    before = near(scene, at + pitch, 1).mean(axis=0)
    scene.update(deformed(session, LEFT))
    assert np.abs(near(scene, at + pitch, 1).mean(axis=0) - before).max() > 40
    after = near(scene, at + pitch + LEFT, 1).mean(axis=0)
    assert np.abs(after - before).max() < 25
    inside = row.mesh.points.mean(axis=0) + pitch
    plain = near(scene, inside, 1).mean(axis=0)
    scene.update(changes.set_view(session, color_by="skew"))
    _, green, blue = near(scene, inside, 1).mean(axis=0)
    assert green > blue + 40, "yellow to green, as good cells are"
    assert np.ptp(plain) < 30


def test_neighbours_show_the_chosen_cells_only(scene, row):
    session = opened(scene, row, passages=1, edges=False, triad=False, color_by="skew")
    half = float(np.median(session.frame.values("skew")))
    at = cell_centers(row.mesh, np.arange(len(row.mesh.cells)))
    shifted = at + period_of(session).vector

    def yellow(points):
        """Tell where a picture shows the color of a value: yellow to green."""
        picture = image(scene)
        x, y = (
            np.rint(to_display(scene.plotter, np.c_[points, np.zeros(len(points))])).astype(int).T
        )
        seen = picture[picture.shape[0] - 1 - y, x]
        return seen[:, 1] > seen[:, 2] + 25

    assert yellow(shifted).mean() > 0.9
    for threshold in ((0.0, half), (half, 1.0)):
        scene.update(changes.set_view(session, threshold=threshold))
        own, copied = yellow(at), yellow(shifted)
        assert 0.2 < own.mean() < 0.8
        assert (own == copied).mean() > 0.85
    scene.update(session)
    assert yellow(shifted).mean() > 0.9


def test_neighbours_of_a_3d_mesh_share_the_chosen_cells(scene, stator):
    session = opened(scene, stator, passages=1, color_by="size-skew")
    chosen = next(layer for layer in scene.layers if isinstance(layer, ThresholdLayer))
    for threshold, seen in (((0.0, 0.9), True), ((0.5, 0.95), True), ((-1.0, -0.5), False)):
        scene.update(changes.set_view(session, threshold=threshold))
        actors = scene.plotter.actors
        copies = [actors[f"copy:{number}:{THRESHOLD}"] for number in (-1, 1)]
        for copy in copies:
            assert copy.mapper.dataset is chosen.shape, threshold
            assert bool(copy.visibility) is seen, threshold
        assert actors["copy:1:BLADE"].prop.opacity < 0.5, "glass, like the boundaries of the mesh"
    scene.update(changes.set_view(session, threshold=None))
    assert not scene.plotter.actors[f"copy:1:{THRESHOLD}"].visibility
    assert scene.plotter.actors["copy:1:BLADE"].prop.opacity == 1.0


def test_a_mesh_that_does_not_repeat_has_no_neighbours(scene, session):
    lonely = changes.set_view(session, passages=2)
    assert period_of(lonely) is None
    scene.open(lonely, find_surfaces(lonely.mesh))
    assert not [name for name in scene.plotter.actors if name.startswith("copy:")]


def test_periodic_boundaries_that_do_not_match_have_no_neighbours(row):
    session = open_mesh(StepFrame(row.mesh, quality(row.mesh)), None, (), row.case)
    assert period_of(session) is not None
    wrong = changes.set_role(session, ("INFLOW", "BLADE"), "periodic")
    assert period_of(wrong) is None


# Axes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [LIGHT, DARK], ids=["light", "dark"])
def test_the_axes_are_in_the_lower_left_corner(scene, stator, scheme):
    session = opened(scene, stator)
    scene.set_scheme(scheme)

    def differs(a, b):
        return np.abs(a - b).max(axis=2) > 20

    shown = image(scene)
    scene.update(changes.set_view(session, triad=False))
    without = image(scene)
    rows, columns = np.nonzero(differs(shown, without))
    assert len(rows) > 80
    assert columns.max() <= SIZE
    assert rows.min() >= shown.shape[0] - SIZE
    scene.update(changes.set_view(session, triad=True))
    assert differs(without, image(scene)).sum() > len(rows) / 2


def test_the_axes_turn_with_the_camera_and_have_their_colors(scene, stator):
    opened(scene, stator)
    counts = []
    for side in ("+x", "+y", "+z"):
        scene.look_from(side)
        corner = image(scene)[-SIZE:, :SIZE].reshape(-1, 3)
        counts.append([has_hue(corner, color) for color in COLORS])
    found = np.array(counts)
    for axis in range(3):
        others = np.delete(found[:, axis], axis)
        assert found[axis, axis] < others.min(), "seen from its end, it is a dot"


def has_hue(colors, wanted):
    """Count the pixels of about the hue of a color, whatever their shade."""
    rgb = np.array(pv.Color(wanted).float_rgb)
    parts = colors - colors.min(axis=1, keepdims=True)
    wanted = (rgb - rgb.min()) / (rgb - rgb.min()).max()
    strong = parts.max(axis=1) > 60
    parts = parts[strong] / parts[strong].max(axis=1, keepdims=True)
    return int((np.abs(parts - wanted).max(axis=1) < 0.3).sum())


def test_few_points_fill_the_room_of_all():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(5000, 3)) * (3.0, 1.0, 0.2) + (10.0, -4.0, 0.0)
    few = outermost(points)
    assert len(few) < 200
    for way in rng.normal(size=(50, 3)):
        assert np.ptp(few @ way) == pytest.approx(np.ptp(points @ way), rel=0.05)


@pytest.fixture(scope="module")
def boxed():
    """A cube in a box of 3 x 3 x 2 control points, drawn; and the same with one of them moved."""
    mesh = sample("hexahedron", size=4).mesh
    low, high = mesh.bounds
    corners = low + CORNERS * (high - low)
    mesh = with_boxes(mesh, [regular_box("B", corners, (2, 2, 1), None)])
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    name = mesh.marker_names[0]
    session = changes.set_role(changes.set_view(session, ffd=True), [name], "moving")
    return session, changes.add_motion(session, Ffd(name, "B", (1, 1, 1), (0.0, 0.0, 0.5)))


def test_of_a_box_only_what_moves_is_drawn_again(scene, boxed):
    before, after = boxed
    scene.open(before, find_surfaces(before.mesh))
    assert "boxes:moved" not in scene.plotter.actors
    base = scene.plotter.actors["boxes:undeformed"].mapper.dataset
    # 2 layers of 3 x 3 points: 12 lines in each, and 9 between them.
    assert (base.n_verts, base.n_lines) == (18, 33)
    assert scene.plotter.actors["boxes:behind"].prop.opacity < 0.5
    scene.update(after)
    moved = scene.plotter.actors["boxes:moved"].mapper.dataset
    assert scene.plotter.actors["boxes:moved:behind"].prop.opacity > 0.5
    assert (moved.n_verts, moved.n_lines) == (1, 5)
    assert "boxes:-labels" in scene.plotter.actors
    scene.update(changes.set_view(after, ffd=False))
    assert not any(name.startswith("boxes:") for name in scene.plotter.actors)


def test_the_displacement_has_no_colors_before_a_run(scene, passage):
    frame = StepFrame(passage.mesh, quality(passage.mesh))
    session = open_mesh(frame, None, (), passage.case)
    scene.open(session, find_surfaces(passage.mesh))
    session = changes.set_view(session, color_by="displacement")
    scene.update(session)
    assert not scene._cells.actor.mapper.scalar_visibility
    moved = StepFrame(passage.mesh.with_points(passage.mesh.points + 0.1), frame.quality)
    scene.update(changes.add_frames(changes.start_run(session), [moved]))
    assert scene._cells.actor.mapper.scalar_visibility


def test_some_boundaries_fill_the_view(scene, passage):
    session = open_mesh(StepFrame(passage.mesh, quality(passage.mesh)), None, (), passage.case)
    scene.open(session, find_surfaces(passage.mesh))
    whole = scene.plotter.camera.parallel_scale
    scene.fit(("inflow",))
    at = to_display(scene.plotter, np.asarray(scene.drawn["inflow"].shape.points))
    assert np.ptp(at[:, 1]) == pytest.approx(0.92 * scene.plotter.window_size[1], rel=0.01)
    scene.fit()
    assert scene.plotter.camera.parallel_scale == pytest.approx(whole)


def test_the_support_radius_is_a_circle_around_what_moves(scene):
    mesh = far_field(60.0)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = changes.set_role(session, ["body"], "moving")
    moved = changes.add_motion(session, Rotate("body", 20.0))
    scene.open(moved, find_surfaces(mesh))
    assert "support:circles" not in scene.plotter.actors
    shown = changes.set_view(moved, support=True)
    scene.update(shown)
    found = scene.plotter.actors["support:circles"].mapper.dataset
    np.testing.assert_allclose(np.linalg.norm(found.points[:, :2], axis=1), 15.0)
    scene.update(changes.set_case(shown, influence_factor=0.5))
    found = scene.plotter.actors["support:circles"].mapper.dataset
    np.testing.assert_allclose(np.linalg.norm(found.points[:, :2], axis=1), 60.0)
    scene.update(changes.set_case(shown, method="idw"))
    assert "support:circles" not in scene.plotter.actors
    scene.update(moved)
    assert "support:circles" not in scene.plotter.actors


def test_a_sphere_of_the_support_radius_is_three_circles():
    points = circles(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), 2.0).reshape(2, 3, -1, 3)
    for body, middle in zip(points, ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]), strict=True):
        np.testing.assert_allclose(np.linalg.norm(body - middle, axis=2), 2.0)
        assert (np.ptp(body, axis=1) == 0).sum() == 3


def test_numbers_of_walls_color_the_walls_and_other_cells_are_plain(scene, row):
    session = opened(scene, row, color_by="first-height")
    blade = scene.drawn["BLADE"]
    at, stage = row.mesh.points[blade.surface.nodes[len(blade.surface.nodes) // 2]], scene.stage
    low, high = session.color_range
    drawn = np.asarray(blade.shape.cell_data[VALUES])
    assert ((drawn >= low) & (drawn <= high)).all()
    colors = {tuple(stage.table.map_value(value)[:3]) for value in np.unique(drawn)}
    plain = pv.Color(scene.scheme.cell).int_rgb
    assert plain not in {tuple(round(255 * part) for part in color) for color in colors}
    assert np.isinf(scene.drawn["PER1"].shape.cell_data[VALUES]).any()
    assert stage.table.above_range_color == pv.Color(scene.scheme.cell)
    spots = near(scene, at, 1)
    assert (np.abs(spots - plain).sum(axis=1) > 100).any()
    # A narrower range clips the values at walls: they do not turn plain.
    scene.update(changes.set_view(session, color_range=(low, (low + high) / 2)))
    assert np.asarray(blade.shape.cell_data[VALUES]).max() == pytest.approx((low + high) / 2)
    scene.update(changes.set_view(session, color_by="size-skew"))
    assert stage.table.above_range_color is None
