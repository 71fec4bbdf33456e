"""Scenes judged by meaning: which colors are where, not by golden pictures."""

import numpy as np
import pytest
import pyvista as pv

import slideviz as sv
from slideviz.color_scheme import COLOR_MAP, DARK, INVERTED_COLOR, LIGHT
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import enclosed, facet_connectivity, find_surfaces, is_closed
from slideviz.scene.mesh import GLASS
from slideviz.scene.pick import to_display
from slideviz.scene.scene import Scene
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from slideviz.terms import ROLES
from tests.builders import grid, halo_text


def image(scene):
    scene.plotter.render()
    return np.asarray(scene.plotter.screenshot(return_img=True)).astype(int)


def count(picture, color, within=14):
    """Return how many pixels have about that color."""
    rgb = np.array(pv.Color(color).int_rgb)
    return int((np.abs(picture[..., :3] - rgb).max(axis=2) <= within).sum())


def pixel(scene, point):
    """Return the color at a point of the mesh."""
    picture = image(scene)
    x, y = to_display(scene.plotter, np.array([point], float))[0]
    return picture[picture.shape[0] - 1 - int(y), int(x)]


def opened(scene, session):
    scene.open(session, find_surfaces(session.mesh))
    return session


def test_roles_have_their_colors(scene, session):
    session = opened(scene, changes.set_role(session, ("left",), "moving"))
    before = count(image(scene), ROLES["moving"].color)
    assert before > 200
    scene.update(changes.set_role(session, ("left",), "sliding"))
    after = image(scene)
    assert count(after, ROLES["moving"].color) == 0
    assert count(after, ROLES["sliding"].color) > 200


def test_cells_of_a_halo_are_paler_than_those_of_the_domain(scene, tmp_path):
    up = np.array([[0.0, 0, 0], [0, 0, 0], [0, -1.0, 0]])
    text = halo_text(grid((4, 4), [(2, 3), (2, 3)]), "y_m", "y_p", up)
    (tmp_path / "a.su2").write_text(text)
    mesh = sv.read(tmp_path / "a.su2")
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = opened(scene, changes.set_view(session, edges=False, color_by="size-skew"))
    inside, beyond = ((0.1, y) for y in (0.6, 1.1))
    colors = [pixel(scene, (*at, 0.0)) for at in (inside, beyond)]
    assert (colors[1] - colors[0]).max() > 60
    assert scene.pick_cell(*to_display(scene.plotter, np.array([[*beyond, 0.0]]))[0]) is not None
    # It moves with the mesh.
    moved = mesh.with_points(mesh.points + np.array([3.0, 0.0]))
    session = changes.add_frames(changes.start_run(session), [StepFrame(moved, quality(moved))])
    scene.update(session)
    scene.fit()
    colors = [pixel(scene, (at[0] + 3.0, at[1], 0.0)) for at in (inside, beyond)]
    assert (colors[1] - colors[0]).max() > 60


def test_quality_is_colored_from_0_to_1_whatever_the_values(scene, session):
    points = session.mesh.points.copy()
    points[12] += 0.45
    mesh = session.mesh.with_points(points)
    frame = StepFrame(mesh, quality(mesh, session.mesh))
    session = changes.set_view(opened(scene, session), color_by="size-skew", edges=False)
    session = changes.add_frames(changes.start_run(session), [frame])
    scene.update(session)
    table = pv.LookupTable(COLOR_MAP, scalar_range=(0.0, 1.0))
    for cell, middle in ((0, (0.3, 0.3, 0)), (10, (2.75, 2.75, 0)), (5, (1.5, 1.5, 0))):
        value = float(frame.quality.values[cell])
        wanted = np.array(table.map_value(value)[:3]) * 255
        assert np.abs(pixel(scene, middle)[:3] - wanted).max() < 12, (cell, value)


def test_an_inverted_cell_has_its_own_color(scene, session):
    points = session.mesh.points.copy()
    points[12] += 3.0
    mesh = session.mesh.with_points(points)
    frame = StepFrame(mesh, quality(mesh, session.mesh))
    assert frame.quality.inverted
    session = changes.set_view(opened(scene, session), color_by="skew", edges=False)
    scene.update(session)
    assert count(image(scene), INVERTED_COLOR) == 0
    scene.update(changes.add_frames(changes.start_run(session), [frame]))
    assert count(image(scene), INVERTED_COLOR) > 50


def test_the_legend_has_more_room_where_pixels_are_small(scene, session):
    opened(scene, changes.set_view(session, color_by="skew"))
    strip, left = scene.stage.strip(), scene.plotter.scalar_bars["skew"].GetPosition()[0]
    scene.plotter.render_window.SetDPI(108)  # VTK's letters are half as large again there
    scene.resized()
    assert scene.stage.strip() == pytest.approx(1.5 * strip)
    wider = 1.0 - scene.plotter.scalar_bars["skew"].GetPosition()[0]
    assert wider == pytest.approx(1.5 * (1.0 - left))


def test_a_sliver_is_found_by_a_ring_of_the_same_size_at_any_zoom(scene, session):
    points = session.mesh.points.copy()
    points[12] = points[6] + [0.5, -0.02]  # of 16 cells, one is hardly inverted
    mesh = session.mesh.with_points(points)
    frame = StepFrame(mesh, quality(mesh, session.mesh))
    assert frame.quality.inverted
    session = changes.set_view(opened(scene, session), edges=False)
    scene.update(session)
    assert not scene.stage.ring_words
    session = changes.add_frames(changes.start_run(session), [frame])
    scene.update(session)
    word = f"{frame.quality.inverted} inv."
    assert scene.stage.ring_words == ((word, INVERTED_COLOR),)
    assert f"legend:rings:{word}:○" in scene.plotter.actors
    near = count(image(scene), INVERTED_COLOR)
    scene.camera.aim((2.0, 2.0, 0.0), 400.0, 10.0)
    far = count(image(scene), INVERTED_COLOR)
    assert far > 40
    assert near < 3 * far
    # No colors of values: what is red are the rings alone, and the line about them.
    scene.update(changes.set_view(session, inverted=False))
    assert count(image(scene), INVERTED_COLOR) == 0
    scene.update(changes.set_view(session, color_by="size-skew", threshold=(0.5, 1.0)))
    assert "points:inverted" not in scene.plotter.actors
    scene.update(changes.set_view(session, color_by="size-skew", threshold=(0.0, 1.0)))
    assert "points:inverted" in scene.plotter.actors


def test_steps_move_the_points_in_place(scene, session):
    session = opened(scene, session)
    shape = scene.drawn["top"].shape
    mesh = session.mesh.with_points(session.mesh.points * [1.0, 0.5])
    session = changes.add_frames(
        changes.start_run(session), [StepFrame(mesh, quality(mesh, session.mesh))]
    )
    scene.update(session)
    assert scene.drawn["top"].shape is shape
    assert np.allclose(np.asarray(shape.points)[:, 1], 2.0)
    scene.update(changes.show_frame(session, 0))
    assert np.allclose(np.asarray(shape.points)[:, 1], 4.0)


def test_hidden_boundaries_are_not_drawn_and_not_picked(scene, session):
    session = opened(scene, changes.set_role(session, ("left",), "moving"))
    x, y = to_display(scene.plotter, np.array([[0.0, 1.5, 0.0]]))[0]
    assert scene.pick(x, y) == "left"
    scene.update(changes.show_boundaries(session, ("left",), False))
    # The legend still names the role, so that some of its color remains.
    assert count(image(scene), ROLES["moving"].color) < 250
    assert scene.pick(x, y) is None


def test_a_click_finds_the_nearest_boundary_of_a_2d_mesh(scene, session):
    opened(scene, session)
    for name, point in (("bottom", (1.7, 0)), ("top", (3, 4)), ("right", (4, 2.2))):
        x, y = to_display(scene.plotter, np.array([[*point, 0.0]]))[0]
        assert scene.pick(x + 3, y + 3) == name
    x, y = to_display(scene.plotter, np.array([[2.0, 2.0, 0.0]]))[0]
    assert scene.pick(x, y) is None


def test_a_click_finds_the_front_boundary_of_a_3d_mesh(scene, cube):
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    opened(scene, session)
    for side, name in (("+x", "RIGHT"), ("-x", "LEFT"), ("+y", "UPPER"), ("-z", "FRONT")):
        scene.look_from(side)
        scene.plotter.render()
        x, y = to_display(scene.plotter, np.array([cube.points.mean(axis=0)]))[0]
        assert scene.pick(x, y) == name, side
    scene.update(changes.show_boundaries(session, ("FRONT",), False))
    assert scene.pick(x, y) in ("BLOCK", "BACK")
    assert scene.pick(2, 2) is None


def test_selected_boundaries_are_highlighted(scene, session):
    session = opened(scene, session)
    before = image(scene)
    scene.update(changes.select(session, ("top",)))
    changed = np.abs(image(scene) - before).max(axis=2) > 30
    rows = np.flatnonzero(changed.any(axis=1))
    assert rows.max() < 100, "only near the upper side"
    assert changed.sum() > 300


def test_the_motion_ghost_is_where_the_motion_leads(scene, session):
    session = opened(scene, changes.set_role(session, ("left",), "moving"))
    one = scene.drawn["left"]
    scene.set_motion_ghosts({"left": session.mesh.points[one.surface.nodes] + [2.0, 0.0]})
    scene.update(changes.set_view(session, edges=False))
    red, _, blue = pixel(scene, (2.0, 1.5, 0.0))[:3]
    assert red > blue + 40, "the ghost is orange"
    scene.update(changes.set_view(session, motion_ghost=False, edges=False))
    red, _, blue = pixel(scene, (2.0, 1.5, 0.0))[:3]
    assert abs(red - blue) < 25
    scene.set_motion_ghosts({})
    assert "motion:left" not in scene.plotter.actors


def test_the_undeformed_ghost_stays_where_the_boundary_was(scene, session):
    session = opened(scene, changes.set_role(session, ("top",), "moving"))
    mesh = session.mesh.with_points(session.mesh.points * [1.0, 0.5])
    session = changes.add_frames(
        changes.start_run(session), [StepFrame(mesh, quality(mesh, session.mesh))]
    )
    scene.update(session)
    plain = pixel(scene, (2.0, 4.0, 0.0))
    scene.update(changes.set_view(session, undeformed=True))
    assert np.abs(pixel(scene, (2.0, 4.0, 0.0)) - plain).max() > 40


def test_edges_can_be_switched_off(scene, session):
    session = opened(scene, session)
    with_edges = image(scene)
    scene.update(changes.set_view(session, edges=False))
    assert count(image(scene), LIGHT.cell, 3) > count(with_edges, LIGHT.cell, 3) + 500


def test_the_mesh_stays_out_of_the_strip_of_the_legend(scene, session):
    opened(scene, session)
    seen = to_display(scene.plotter, np.asarray(scene.drawn["right"].shape.points))
    assert seen[:, 0].max() < 420 - 100
    assert seen[:, 0].max() > 150


def test_zooming_keeps_the_point_under_the_mouse(scene, session):
    opened(scene, session)
    corner = np.array([[0.0, 4.0, 0.0]])
    x, y = to_display(scene.plotter, corner)[0]
    before = to_display(scene.plotter, np.array([[4.0, 4.0, 0.0]]))[0, 0] - x
    scene.camera.zoom_at(x, y, 1.5)
    assert np.allclose(to_display(scene.plotter, corner)[0], (x, y), atol=0.6)
    after = to_display(scene.plotter, np.array([[4.0, 4.0, 0.0]]))[0, 0] - x
    assert after == pytest.approx(1.5 * before, rel=1e-3)


def test_perspective_is_for_3d_only(scene, session, cube):
    opened(scene, changes.set_view(session, perspective=True))
    assert scene.plotter.camera.parallel_projection
    solid = open_mesh(StepFrame(cube, quality(cube)), None)
    opened(scene, solid)
    assert scene.plotter.camera.parallel_projection
    scene.update(changes.set_view(solid, perspective=True))
    assert not scene.plotter.camera.parallel_projection


def test_the_legend_says_roles_or_shows_the_bar(scene, session):
    session = opened(scene, session)
    assert any(name.startswith("legend:fixed") for name in scene.plotter.actors)
    scene.update(changes.set_view(session, color_by="size"))
    assert list(scene.plotter.scalar_bars.keys()) == ["size"]
    assert not any(name.startswith("legend:") for name in scene.plotter.actors)
    scene.update(changes.set_view(session, legend=False, color_by="size"))
    assert not list(scene.plotter.scalar_bars.keys())


@pytest.mark.parametrize(("height", "count"), [(700, 6), (180, 5), (100, 2)])
def test_the_bar_has_the_numbers_of_its_ends(scene, session, height, count):
    scene.plotter.window_size = 500, height
    session = opened(scene, session)
    scene.update(changes.set_view(session, color_by="size-skew", color_range=(0.946, 0.967)))
    bar = scene.plotter.scalar_bars["size-skew"]
    labels = bar.GetCustomLabels()
    values = [labels.GetValue(row) for row in range(labels.GetNumberOfTuples())]
    assert (values[0], values[-1]) == (0.946, 0.967)
    assert len(values) == count
    assert bar.GetLabelFormat() == "%.3f"
    assert bar.GetTextPad() >= 4, "they do not touch the bar"


def test_the_title_of_the_bar_keeps_away_from_the_edge_in_a_view_of_any_size(scene, session):
    session = opened(scene, session)
    scene.update(changes.set_view(session, color_by="size-skew"))
    for width in (900, 400, 900):
        scene.plotter.window_size = width, 600
        scene.resized()
        bar = scene.plotter.scalar_bars["size-skew"]
        left, wide = bar.GetPosition()[0] * width, bar.GetPosition2()[0] * width
        assert left == pytest.approx(width - 90)
        # The title is in the middle of that, and 68 pixels wide.
        assert width - (left + wide / 2 + 34) > 20


def test_another_mesh_replaces_all_actors(scene, session, cube):
    opened(scene, session)
    opened(scene, open_mesh(StepFrame(cube, quality(cube)), None))
    assert set(scene.drawn) == set(cube.marker_names)
    assert "marker:left" not in scene.plotter.actors
    scene.clear()
    assert not scene.drawn
    assert not [name for name in scene.plotter.actors if name.startswith("marker:")]


def test_the_look_changes_the_background(scene, session):
    opened(scene, session)
    scene.set_scheme(DARK)
    assert image(scene)[-3, 3].max() < 60


def test_a_3d_mesh_without_boundaries_shows_its_outside(scene, cube):
    from dataclasses import replace

    bare = replace(cube, markers=())
    scene.open(open_mesh(StepFrame(bare, quality(bare)), None), find_surfaces(bare))
    picture = image(scene)
    assert np.abs(picture[150, 160] - picture[-3, 3]).max() > 10


def test_surfaces_know_their_cells_and_rims(cube):
    surfaces = {one.name: one for one in find_surfaces(cube)}
    right = surfaces["RIGHT"]
    assert len(right.facets) == len(cube.marker("RIGHT").cells)
    assert len(right.rim) == 4 * 8
    centres = cube.points[cube.cells.by_type[12][1][right.owner]].mean(axis=1)
    assert np.all(centres[:, 0] > 1.0 - 1.0 / 8)
    assert len(surfaces["BLOCK"].rim) == 0


def test_triangles_and_quadrilaterals_become_vtk_faces():
    flat = facet_connectivity(np.array([[0, 1, 2, 2], [1, 2, 3, 4]]))
    assert flat.tolist() == [3, 0, 1, 2, 4, 1, 2, 3, 4]
    assert facet_connectivity(np.array([[5, 6]])).tolist() == [2, 5, 6]


def test_the_legend_is_made_anew_only_when_it_says_something_else(scene, session, monkeypatch):
    from slideviz.scene import legend as module

    session, made = opened(scene, session), []
    for name in ("add_role_legend", "add_color_bar"):
        real = getattr(module, name)

        def counted(*values, real=real):
            made.append(values)
            return real(*values)

        monkeypatch.setattr(module, name, counted)
    steps = (
        (0, lambda s: changes.select(s, ["left"])),
        (1, lambda s: changes.set_role(s, ["left"], "internal")),
        (0, lambda s: changes.set_view(s, edges=False)),
        (1, lambda s: changes.set_view(s, color_by="size-skew")),
        (0, lambda s: changes.set_role(s, ["left"], "fixed")),
        (0, lambda s: changes.set_view(s, legend=False)),
        (1, lambda s: changes.set_view(s, legend=True)),
    )
    for wanted, change in steps:
        made.clear()
        session = change(session)
        scene.update(session)
        assert len(made) == wanted
    made.clear()
    scene.set_scheme(DARK)
    assert len(made) == 1, "its letters have another color"


def legend_actors(plotter):
    return {n: a.GetAddressAsString("") for n, a in plotter.actors.items() if "legend" in n}


@pytest.mark.parametrize("by", ["role", "size-skew"])
def test_in_a_view_of_another_size_the_same_legend_is_where_a_new_one_would_be(cube, by):
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_view(session, color_by=by, points="types")
    pictures = []
    for first, last in (((300, 260), (500, 420)), ((500, 420), (500, 420))):
        plotter = pv.Plotter(off_screen=True, window_size=first)
        scene = Scene(plotter)
        opened(scene, session)
        plotter.window_size = last
        made = legend_actors(plotter)
        scene.resized()
        assert legend_actors(plotter) == made
        pictures.append(image(scene)[:, -100:])
        plotter.close()
    differs = np.abs(pictures[0] - pictures[1]).max(axis=2) > 40
    assert differs.sum() < 40
    assert count(pictures[0], ROLES["fixed"].color) > 20 or by != "role"


def test_another_map_and_another_range_give_other_colors(scene, session):
    session = changes.set_view(opened(scene, session), color_by="size-skew", edges=False)
    scene.update(session)
    highest = np.array(pv.LookupTable("viridis").map_value(1.0)[:3]) * 255
    assert np.abs(pixel(scene, (1.5, 1.5, 0))[:3] - highest).max() < 12
    scene.update(changes.set_view(session, color_range=(0.0, 2.0)))
    middle = np.array(pv.LookupTable("viridis").map_value(0.5)[:3]) * 255
    assert np.abs(pixel(scene, (1.5, 1.5, 0))[:3] - middle).max() < 12
    scene.update(changes.set_view(session, color_map="cividis"))
    highest = np.array(pv.LookupTable("cividis").map_value(1.0)[:3]) * 255
    assert np.abs(pixel(scene, (1.5, 1.5, 0))[:3] - highest).max() < 12


def test_the_displacement_is_colored_from_0_to_the_largest_of_all_runs(scene, session):
    session = opened(scene, session)
    for shift in (0.5, 1.0):
        points = session.mesh.points.copy()
        points[session.mesh.points[:, 1] > 3.5, 1] += shift
        mesh = session.mesh.with_points(points)
        frame = StepFrame(mesh, quality(mesh, session.mesh))
        session = changes.add_frames(changes.start_run(session), [frame])
    assert session.color_range == (0.0, 1.0)
    session = changes.set_view(session, color_by="displacement", edges=False)
    assert session.color_range == (0.0, 1.0)
    scene.update(session)
    top = np.array(pv.LookupTable("viridis").map_value(0.5)[:3]) * 255
    assert np.abs(pixel(scene, (1.5, 3.6, 0))[:3] - top).max() < 12
    session = changes.show_run(session, 1)
    assert session.color_range == (0.0, 1.0)
    scene.update(session)
    half = np.array(pv.LookupTable("viridis").map_value(0.25)[:3]) * 255
    assert np.abs(pixel(scene, (1.5, 3.6, 0))[:3] - half).max() < 12


def test_a_camera_comes_back(scene, session):
    opened(scene, session)
    scene.camera.zoom_at(100, 100, 2.0)
    place = scene.camera.place
    scene.camera.fit()
    assert scene.camera.place != place
    scene.camera.move_to(place)
    assert np.allclose(scene.camera.place, place)


@pytest.mark.parametrize("perspective", [False, True])
def test_a_view_that_was_kept_is_not_cut_in_a_narrower_one(scene, session, cube, perspective):
    solid = open_mesh(StepFrame(cube, quality(cube)), None)
    opened(scene, changes.set_view(solid, perspective=True) if perspective else session)
    view, width = scene.camera.view, scene.plotter.window_size[0]
    scene.plotter.window_size = [260, scene.plotter.window_size[1]]
    scene.camera.move_to(view[:10])
    assert scene.camera.loses_some()
    scene.camera.move_to(view)
    assert not scene.camera.loses_some()
    # In one that is as wide, or wider, it is what it was.
    scene.plotter.window_size = [width, scene.plotter.window_size[1]]
    scene.camera.move_to(view)
    assert scene.camera.place == pytest.approx(view[:10])


def culling(scene):
    return {one.actor.prop.culling for one in scene.drawn.values()}


def test_faces_that_look_away_are_left_out_and_nobody_sees_it(scene, cube):
    session = opened(scene, open_mesh(StepFrame(cube, quality(cube)), None))
    for side in ("iso", "+x", "-z"):
        scene.look_from(side)
        assert culling(scene) == {"back"}
        without = image(scene)
        for one in scene.drawn.values():
            one.actor.prop.culling = "none"
        assert (np.abs(image(scene) - without).max(axis=2) > 8).mean() < 1e-4
        scene.update(session)


@pytest.mark.parametrize(
    "view",
    [
        {"hidden": frozenset({"FRONT"})},
        {"perspective": True},
        {"threshold": (0.0, 0.5)},
    ],
)
def test_where_the_inside_can_be_seen_all_faces_are_drawn(scene, cube, view):
    session = opened(scene, open_mesh(StepFrame(cube, quality(cube)), None))
    assert culling(scene) == {"back"}
    scene.update(changes.set_view(session, **view))
    assert culling(scene) == {"none"}
    scene.update(session)
    assert culling(scene) == {"back"}


def test_boundaries_with_a_hole_show_their_inside(scene, cube):
    from dataclasses import replace

    for gone in ("FRONT", "BLOCK"):
        left = replace(cube, markers=tuple(m for m in cube.markers if m.name != gone))
        assert is_closed(find_surfaces(left)) == (gone == "BLOCK"), gone
    opened(scene, open_mesh(StepFrame(left, quality(left)), None))
    holed = replace(cube, markers=tuple(m for m in cube.markers if m.name != "FRONT"))
    opened(scene, open_mesh(StepFrame(holed, quality(holed)), None))
    assert culling(scene) == {"none"}


def test_a_moving_boundary_inside_is_seen_and_clicked_through_those_around_it(scene, cube):
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = changes.set_role(session, ("BLOCK",), "fixed")
    opened(scene, session)
    scene.look_from("+x")
    (block,) = (one for one in find_surfaces(cube) if one.name == "BLOCK")
    middle = to_display(scene.plotter, cube.points[block.nodes].mean(axis=0)[None])[0]
    across, down = int(middle[0]), 299 - int(middle[1])
    patch = np.s_[down - 8 : down + 9, across - 8 : across + 9]
    front = scene.pick(*middle)
    assert front not in (None, "BLOCK")
    hidden = image(scene)
    moving = changes.set_role(session, ("BLOCK",), "moving")
    scene.update(moving)
    opacity = {name: one.actor.prop.opacity for name, one in scene.drawn.items()}
    assert opacity.pop("BLOCK") == 1.0
    assert set(opacity.values()) == {GLASS}
    assert scene.pick(*middle) == "BLOCK"
    corner = to_display(scene.plotter, cube.points.max(axis=0)[None])[0] - 12.0
    assert scene.pick(*corner) == front, "beside it, the glass"
    for picture, orange in ((image(scene)[patch], True), (hidden[patch], False)):
        assert ((picture[..., 0] > picture[..., 2] + 40).mean() > 0.9) == orange
    # Values are looked at on the boundaries; without what is inside there is no reason for glass.
    for view in ({"color_by": "size-skew"}, {"hidden": frozenset({"BLOCK"})}):
        scene.update(changes.set_view(moving, **view))
        assert {one.actor.prop.opacity for one in scene.drawn.values()} == {1.0}
        assert scene.pick(*middle) == front


def test_a_boundary_that_reaches_the_outside_encloses_nothing_and_is_not_enclosed(cube):
    assert enclosed(find_surfaces(cube), cube.points) == {"BLOCK"}
    (block,) = (one for one in find_surfaces(cube) if one.name == "BLOCK")
    moved = cube.points.copy()
    moved[block.nodes, 0] += cube.points[:, 0].max() - moved[block.nodes, 0].max()
    assert enclosed(find_surfaces(cube), moved) == frozenset()


def test_what_highlights_a_boundary_is_made_when_it_is_selected_and_moves_with_it(scene, session):
    opened(scene, session)
    assert not [name for name in scene.plotter.actors if name.startswith("selected:")]
    chosen = changes.select(session, ("top",))
    scene.update(chosen)
    band = scene.plotter.actors["selected:top"]
    assert band.visibility
    mesh = session.mesh.with_points(session.mesh.points + np.array([0.0, 1.0]))
    moved = changes.add_frames(changes.start_run(chosen), [StepFrame(mesh, quality(mesh))])
    scene.update(changes.show_frame(moved, 1))
    assert np.asarray(band.mapper.dataset.points)[:, 1].min() == 5.0
    scene.update(changes.select(moved, ()))
    assert not band.visibility
