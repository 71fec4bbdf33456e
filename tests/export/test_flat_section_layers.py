"""Sections in the scene and laid flat: which cells are drawn, where, and in which colors."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
import pyvista as pv
from PIL import Image

from slideviz.color_scheme import INVERTED_COLOR, LIGHT
from slideviz.errors import Cancelled, CaseError
from slideviz.export.flat_section import frame_words, save_section
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.export.vector import draw_vector
from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.plots import section_picture
from slideviz.plots.section_picture import SectionStyle
from slideviz.samples.table import sample
from slideviz.scene.actors import VALUES
from slideviz.scene.flat_scene import FlatScene
from slideviz.scene.mesh import looks_inside
from slideviz.scene.pick import to_display
from slideviz.scene.sections import plain_color
from slideviz.sections.cut import transformed
from slideviz.sections.model import Section
from slideviz.session import changes, section_cuts
from slideviz.session.jobs import Job
from slideviz.session.opening import open_mesh
from slideviz.session.passages import find_period
from slideviz.session.section_cuts import CACHE_SIZE, Cuts
from slideviz.session.state import Session, StepFrame

MIDDLE = Section("plane", (0.0, 0.0, 0.46), (0.0, 0.0, 1.0))


@pytest.fixture
def flat_plotter():
    plotter = pv.Plotter(off_screen=True, window_size=[400, 300])
    yield plotter
    plotter.close()


@pytest.fixture(scope="module")
def stator():
    return sample("stator", size=5000)


def opened(scene, mesh, case=None, **view):
    session = open_mesh(StepFrame(mesh, quality(mesh)), None, (), case)
    session = changes.set_view(session, **view)
    scene.open(session, find_surfaces(mesh))
    return session


def stepped(session, points):
    """Return the session at a step with the nodes at these points."""
    mesh = session.mesh.with_points(points)
    frame = StepFrame(mesh, quality(mesh, session.mesh))
    return changes.add_frames(changes.start_run(session), [frame])


def crossing(mesh, axis, at):
    """Return the cells with nodes on both sides, found one after the other."""
    found = []
    for cell in range(len(mesh.cells)):
        low, high = mesh.cells.offsets[cell : cell + 2]
        x = mesh.points[mesh.cells.connectivity[low:high], axis]
        if x.min() < at < x.max():
            found.append(cell)
    return np.array(found)


def cells_of(scene, name="section:0"):
    return np.unique(scene.sections.drawn[name].polygons.cells)


def colors(plotter):
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True)).astype(int)[..., :3].reshape(-1, 3)


def count(plotter, color, within=14):
    rgb = np.array(pv.Color(color).int_rgb)
    return int((np.abs(colors(plotter) - rgb).max(axis=1) <= within).sum())


# In space ---------------------------------------------------------------------------------


@pytest.mark.parametrize("whole", [False, True])
def test_exactly_the_cells_that_are_cut_are_drawn(scene, cube, whole):
    section = Section("plane", (0.0, 0.0, 0.46), (0.0, 0.0, 1.0), whole_cells=whole)
    opened(scene, cube, sections=(section,), color_by="size-skew")
    wanted = crossing(cube, 2, 0.46)
    assert 0 < len(wanted) < len(cube.cells)
    assert cells_of(scene).tolist() == wanted.tolist()
    bounds = scene.plotter.actors["section:0"].bounds
    assert (bounds[5] - bounds[4] > 1e-3) == whole


def test_a_section_has_the_values_of_its_cells(scene, cube):
    session = opened(scene, cube, sections=(MIDDLE,), color_by="size-skew")
    one = scene.sections.drawn["section:0"]
    frame = changes.set_view(session, color_by="skew")
    scene.update(frame)
    wanted = session.first.quality.skew[one.polygons.cells]
    assert one.shown.mapper.scalar_visibility
    assert np.array_equal(one.shown.shape.cell_data[VALUES], wanted)
    scene.update(changes.set_view(frame, color_by="role"))
    assert not one.shown.mapper.scalar_visibility
    assert one.actor.prop.color == pv.Color(plain_color(LIGHT))


def test_a_section_follows_the_step(scene, cube):
    session = opened(scene, cube, sections=(MIDDLE,), color_by="size-skew")
    points = cube.points.copy()
    points[:, 2] = points[:, 2] ** 2
    later = stepped(session, points)
    scene.update(later)
    wanted = crossing(later.frame.mesh, 2, 0.46)
    assert cells_of(scene).tolist() == wanted.tolist()
    assert set(wanted) != set(crossing(cube, 2, 0.46))
    scene.update(changes.show_frame(later, 0))
    assert cells_of(scene).tolist() == crossing(cube, 2, 0.46).tolist()


def test_nothing_is_cut_again_when_only_the_colors_change(scene, cube):
    session = opened(scene, cube, sections=(MIDDLE,), color_by="size-skew")
    before = scene.sections.drawn["section:0"].polygons
    session = changes.set_view(session, color_by="size", edges=False, color_range=(0.2, 0.6))
    scene.update(session)
    assert scene.sections.drawn["section:0"].polygons is before
    assert not scene.plotter.actors["section:0"].prop.show_edges
    session = changes.replace_section(session, 0, MIDDLE.at_position(0.7))
    scene.update(session)
    assert cells_of(scene).tolist() == crossing(cube, 2, 0.7).tolist()


def test_a_section_that_is_hidden_or_removed_is_gone(scene, cube):
    other = Section("plane", (0.3, 0.0, 0.0), (1.0, 0.0, 0.0), shown=False)
    session = opened(scene, cube, sections=(MIDDLE, other))
    assert "section:0" in scene.plotter.actors
    assert "section:1" not in scene.plotter.actors
    assert looks_inside(session)
    session = changes.remove_section(session, 0)
    scene.update(session)
    assert not any(name.startswith("section:") for name in scene.plotter.actors)
    assert not looks_inside(session)
    session = changes.add_section(session, MIDDLE)
    scene.update(session)
    assert cells_of(scene, "section:1").tolist() == crossing(cube, 2, 0.46).tolist()
    scene.clear()
    assert not scene.sections.drawn


def test_a_section_beside_the_mesh_shows_nothing(scene, cube):
    away = Section("plane", (0.0, 0.0, 9.0), (0.0, 0.0, 1.0))
    session = opened(scene, cube, sections=(away,))
    assert not scene.plotter.actors["section:0"].visibility
    scene.update(changes.replace_section(session, 0, MIDDLE))
    assert scene.plotter.actors["section:0"].visibility


@pytest.mark.parametrize("passages", [0, 1])
def test_glass_in_front_of_a_cut_does_not_tint_it(scene, stator, passages):
    """The shell is seen beside it, and is what it was when the section is gone."""
    mesh, section = stator.mesh, Section("cylinder", radius=0.27)
    view = {"color_by": "size-skew", "edges": False, "passages": passages}
    session = opened(scene, mesh, stator.case, **view)
    before = colors(scene.plotter)
    scene.update(changes.add_section(session, section))
    image = colors(scene.plotter)
    one = scene.sections.drawn["section:0"].polygons
    values = session.first.quality.values[one.cells]
    big = np.argsort(-areas(one))[:40]
    at = to_display(scene.plotter, middles(one)[big])
    width, height = scene.plotter.window_size
    seen = image.reshape(height, width, 3)
    wanted = np.array([scene.stage.table(float(value))[:3] for value in values[big]]) * 255
    x, y = at.astype(int).T
    assert np.abs(seen[height - 1 - y, x] - wanted).max() <= 2
    # The rest of the passage is still there, as glass.
    scene.update(changes.set_view(changes.add_section(session, section), hidden=set(scene.drawn)))
    assert (np.abs(colors(scene.plotter) - image).max(axis=1) > 3).mean() > 0.05
    scene.update(session)
    assert np.array_equal(colors(scene.plotter), before)


def middles(polygons):
    """Return the means of the corners of polygons, (q, 3)."""
    sums = np.add.reduceat(polygons.points[polygons.connectivity], polygons.offsets[:-1])
    return sums / polygons.sizes[:, None]


def areas(polygons):
    """Return about how large each polygon is, (q,): the square of its corners' spread."""
    far = polygons.points[polygons.connectivity] - np.repeat(
        middles(polygons), polygons.sizes, axis=0
    )
    return np.add.reduceat((far**2).sum(axis=1), polygons.offsets[:-1])


def test_neighbours_have_the_edges_of_the_mesh_itself(scene, stator):
    """Actors with one mapper have one shader, that of the one drawn first."""
    section = Section("cylinder", radius=0.27)
    opened(scene, stator.mesh, stator.case, sections=(section,), passages=1)
    own = scene.plotter.actors
    twins = [actor for name, actor in own.items() if name.startswith("section:0:")]
    assert len(twins) == 2
    shader = own["section:0"].GetShaderProperty()
    assert all(twin.GetShaderProperty() is shader for twin in twins)
    passages = {
        actor.name: actor
        for actor in scene.plotter.renderer.GetActors()
        if getattr(actor, "name", "").startswith("copy:1:")
    }
    assert passages
    for name, copy in passages.items():
        base = own[f"marker:{name.split(':', 2)[2]}"]
        assert copy.GetShaderProperty() is base.GetShaderProperty()
        assert copy.GetForceOpaque() == base.GetForceOpaque() == 1


def halved(session):
    """Return the session with a range that leaves about half of the cells, and which these are."""
    values = session.first.quality.values
    low, high = float(values.min()), float(np.median(values))
    kept = np.flatnonzero((values >= low) & (values <= high))
    return changes.set_view(session, threshold=(low, high)), kept


@pytest.mark.parametrize("whole", [False, True])
def test_a_range_leaves_its_cells_of_a_section_only(scene, cube, whole):
    section = replace(MIDDLE, whole_cells=whole)
    session = opened(scene, bent(cube), sections=(section,), color_by="size-skew")
    cut, full = cells_of(scene), scene.sections.drawn["section:0"].polygons
    some, kept = halved(session)
    scene.update(some)
    assert 0 < len(np.intersect1d(cut, kept)) < len(cut)
    assert cells_of(scene).tolist() == np.intersect1d(cut, kept).tolist()
    if whole:
        # Cells have sides where their neighbours are left out.
        here = scene.sections.drawn["section:0"].polygons
        assert len(here) > np.isin(full.cells, kept).sum()
    scene.update(changes.set_view(some, threshold=(-1.0, -0.5)))
    assert not scene.plotter.actors["section:0"].visibility
    scene.update(session)
    assert cells_of(scene).tolist() == cut.tolist()


def bent(cube):
    """Return the cube with cells of different qualities in every layer."""
    points = cube.points.copy()
    points[:, 0] += 0.05 * np.sin(3.0 * points[:, 0]) * points[:, 1]
    return cube.with_points(points)


def test_a_click_on_a_section_is_none_on_the_glass_before_it(scene, cube):
    session = opened(scene, cube, color_by="size-skew")
    scene.look_from("iso")
    on, beside = to_display(scene.plotter, np.array([[0.2, 0.2, 0.46], [0.9, 0.9, 0.99]]))
    assert scene.pick(*on)
    cut = changes.add_section(session, MIDDLE)
    scene.update(cut)
    assert scene.pick(*on) is None
    assert scene.pick(*beside), "glass alone is still found"
    scene.update(session)
    assert scene.pick(*on)
    scene.update(changes.set_view(session, threshold=(0.0, 2.0)))
    assert scene.pick(*on) is None, "nor are cells of a range"


def test_a_click_on_a_section_of_a_neighbour_is_none_on_glass(scene, stator):
    section = Section("cylinder", radius=0.27)
    session = opened(scene, stator.mesh, stator.case, passages=1, color_by="size-skew")
    scene.update(changes.add_section(session, section))
    twin = scene.plotter.actors["section:0:1"]
    points = transformed(
        middles(scene.sections.drawn["section:0"].polygons), np.array(twin.user_matrix)
    )
    asked = []
    for x, y in to_display(scene.plotter, points)[::7]:
        scene.update(session)
        glass = scene.pick(x, y)
        scene.update(changes.add_section(session, section))
        asked.append((glass, scene.pick(x, y)))
    assert any(glass for glass, _ in asked), "some are behind the mesh's own boundaries"
    assert all(found is None for _, found in asked)


def test_inverted_cells_are_red_in_a_section(scene, cube):
    session = opened(scene, cube, sections=(MIDDLE,), color_by="size-skew", edges=False)
    scene.look_from("+z")
    assert count(scene.plotter, INVERTED_COLOR, 30) == 0
    points = cube.points.copy()
    inside = ((points > 0.3) & (points < 0.7)).all(axis=1)
    points[inside] = 1.0 - points[inside]
    scene.update(stepped(session, points))
    assert count(scene.plotter, INVERTED_COLOR, 30) > 50


def test_the_cell_under_the_mouse_is_that_of_the_section(scene, cube):
    opened(scene, cube, sections=(MIDDLE,), color_by="size-skew")
    scene.look_from("+z")
    x, y = to_display(scene.plotter, np.array([[0.2, 0.2, 0.46]]))[0]
    assert scene.pick_cell(x, y) in crossing(cube, 2, 0.46)


LINE = Section("plane", (0.0, 1.5, 0.0), (0.0, 1.0, 0.0))
WHOLE = replace(LINE, whole_cells=True)


def test_in_2d_a_plane_is_a_line_or_the_cells_on_it(scene, square):
    session = opened(scene, square, sections=(LINE,), color_by="size-skew")
    one = scene.sections.drawn["section:0"]
    assert one.shown.shape.n_lines == 4
    assert one.shown.mapper.scalar_visibility
    wanted = session.first.quality.values[one.polygons.cells]
    assert np.array_equal(one.shown.shape.cell_data[VALUES], wanted)
    whole = changes.replace_section(session, 0, WHOLE)
    scene.update(whole)
    assert cells_of(scene).tolist() == crossing(square, 1, 1.5).tolist()
    assert one.shown.mapper.scalar_visibility
    # Below cells that may be smaller than pixels is a line in their colors.
    assert scene.sections.drawn["band:0"].shown.shape.n_lines == 4
    assert len(scene.sections.pickable()) == 1


def test_in_2d_the_other_cells_step_back_while_a_section_is_shown(scene, square):
    session = opened(scene, square, sections=(WHOLE,), color_by="size-skew")
    cells = scene.plotter.actors["cells"]
    assert cells.prop.opacity < 0.5
    scene.update(changes.replace_section(session, 0, replace(WHOLE, shown=False)))
    assert cells.prop.opacity == 1.0
    # One that cannot be drawn leaves them as they are.
    across = Section("cylinder", direction=(1.0, 0.0, 0.0), radius=1.0)
    scene.update(changes.replace_section(session, 0, across))
    assert cells.prop.opacity == 1.0
    assert "section:0" not in scene.plotter.actors


def test_the_cutting_line_goes_on_in_holes_and_beside_the_mesh(scene, square):
    session = opened(scene, square, sections=(WHOLE,), color_by="size-skew")
    left, right = scene.plotter.actors["line:0"].bounds[:2]
    assert left < 0.0
    assert right > 4.0
    assert scene.plotter.actors["line:0"].prop.color == pv.Color(LIGHT.text)
    circle = Section("cylinder", (2.0, 2.0, 0.0), radius=1.5)
    scene.update(changes.add_section(session, circle))
    assert scene.plotter.actors["line:1"].bounds[:4] == pytest.approx((0.5, 3.5, 0.5, 3.5))
    assert cells_of(scene, "section:1").size > 3
    later = stepped(session, square.points * (3.0, 1.0))
    scene.update(later)
    assert "line:1" not in scene.plotter.actors
    assert scene.plotter.actors["line:0"].bounds[1] > 12.0
    scene.update(changes.remove_section(later, 0))
    kinds = {name.partition(":")[0] for name in scene.plotter.actors}
    assert kinds.isdisjoint({"section", "band", "rim", "line"})


def test_neighbours_show_the_section_too(scene, stator):
    cylinder = Section("cylinder", radius=0.27)
    plane = Section("plane", (0.27, 0.0, 0.0), (1.0, 0.2, 0.0))
    session = opened(
        scene, stator.mesh, stator.case, sections=(cylinder, plane), passages=1, color_by="size"
    )
    base, twin = scene.sections.drawn["section:0"].shown, scene.plotter.actors["section:0:1"]
    assert twin.GetMapper() is base.mapper
    pair = find_period(stator.mesh, stator.case)
    turned = transformed(np.asarray(base.shape.points), np.array(twin.user_matrix))
    angle = np.arctan2(turned[:, 1], turned[:, 0]).mean()
    own = np.arctan2(*np.asarray(base.shape.points)[:, 1::-1].T).mean()
    assert angle - own == pytest.approx(pair.angle, rel=1e-6)
    # A plane along the axis cuts each passage at another place.
    assert "section:1:1" in scene.sections.drawn
    assert set(cells_of(scene, "section:1:1")) != set(cells_of(scene, "section:1"))
    assert len(scene.sections.pickable()) == 2
    scene.update(changes.set_view(session, passages=0))
    assert {"section:0", "section:1"} == {
        name for name in scene.plotter.actors if name.startswith("section:")
    }


# What was cut -----------------------------------------------------------------------------


def test_cuts_are_remembered_for_the_frame_only(cube):
    cuts = Cuts()
    first = cuts.of(cube, MIDDLE)
    assert cuts.of(cube, Section("plane", MIDDLE.origin, MIDDLE.direction, name="mine")) is first
    for z in np.linspace(0.1, 0.2, CACHE_SIZE):
        cuts.of(cube, MIDDLE.at_position(z))
    assert cuts.of(cube, MIDDLE) is not first
    shifted = cube.with_points(cube.points + 0.1)
    assert cuts.of(shifted, MIDDLE).cell_ids.tolist() == crossing(shifted, 2, 0.46).tolist()
    other = Mesh(cube.points, Cells.from_blocks([(12, cube.cells.by_type[12][1][:5])]))
    assert cuts.of(other, MIDDLE).cell_ids.max(initial=0) < 5


# Where sections start ---------------------------------------------------------------------


def test_a_first_plane_cuts_the_longest_extent_in_the_middle(square):
    mesh = square.with_points(square.points * (3.0, 1.0))
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    plane = section_cuts.first_section("plane", session)
    assert plane.direction == (1.0, 0.0, 0.0)
    assert plane.position == 6.0
    assert plane.whole_cells


def test_a_first_cylinder_has_the_axis_of_the_period(stator):
    mesh = stator.mesh
    session = open_mesh(StepFrame(mesh, quality(mesh)), None, (), stator.case)
    pair = find_period(mesh, stator.case)
    cylinder = section_cuts.first_section("cylinder", session, pair)
    assert np.cross(cylinder.direction, (0, 0, 1)) == pytest.approx(0.0)
    radii = np.unique(np.hypot(*mesh.points[:, :2].T).round(9))
    low, high = radii[0], radii[-1]
    middle = (low + high) / 2.0
    assert np.abs(radii - middle).min() < 1e-8, "a layer of nodes lies halfway"
    # Along it rounding would say which cells are cut: the middle of the next ones is.
    assert np.abs(radii - cylinder.radius).min() > 1e-3 * (high - low)
    assert abs(cylinder.radius - middle) < np.diff(radii).max()
    assert section_cuts.first_section("cylinder", session, None).direction == stator.case.axis


def test_positions_move_a_plane_along_its_normal():
    plane = Section("plane", (1.0, 2.0, 3.0), (0.0, 3.0, 4.0))
    assert plane.position == pytest.approx(3.6)
    there = plane.at_position(4.6)
    assert there.origin == pytest.approx((1.0, 2.6, 3.8))
    low, high = section_cuts.position_range(plane, np.array([[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]]))
    assert (low, high) == pytest.approx((0.0, 3.0))
    with pytest.raises(CaseError, match="radius -1 is not positive"):
        Section("cylinder", radius=1.0).sized(-1.0)


def test_a_turned_plane_still_cuts(cube):
    points = section_cuts.cell_points(cube)
    outside = Section("plane", (0.0, 5.0, 0.3), (0.0, 0.0, 1.0))
    within = section_cuts.with_direction(outside, (0.0, 1.0, 0.0), points).origin[1]
    assert within == pytest.approx(0.5, abs=0.1)
    kept = section_cuts.with_direction(MIDDLE, (0.0, 1.0, 1.0), points)
    assert kept.origin == MIDDLE.origin


# Flat -------------------------------------------------------------------------------------


def test_a_flat_cylinder_has_z_and_r_theta(scene, flat_plotter, stator):
    section = Section("cylinder", radius=0.27)
    session = opened(scene, stator.mesh, stator.case, sections=(section,), color_by="size-skew")
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    flat.update(session, section)
    flat.fit()
    drawn = scene.sections.drawn["section:0"].polygons
    assert flat.polygons.cell_ids.tolist() == drawn.cell_ids.tolist()
    low, high = flat.bounds()
    assert (low[0], high[0]) == pytest.approx((drawn.points[:, 2].min(), drawn.points[:, 2].max()))
    angle = np.arctan2(drawn.points[:, 1], drawn.points[:, 0])
    assert high[1] - low[1] == pytest.approx(0.27 * np.ptp(angle), rel=1e-9)
    assert [label.short for label in flat.labels] == ["z", "r θ"]
    across, upright = flat.ranges()
    assert across[0] < low[0] < high[0] < across[1]
    assert upright[0] < low[1] < high[1] < upright[1]
    # The same scale both ways.
    assert np.ptp(across) / np.ptp(upright) == pytest.approx(400 / 300)


def test_a_flat_section_says_what_it_cuts_and_what_is_under_the_mouse(scene, flat_plotter, cube):
    session = opened(scene, cube, sections=(MIDDLE,))
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    assert flat.bounds() is None
    flat.update(session, MIDDLE)
    flat.fit()
    cells = crossing(cube, 2, 0.46)
    values = session.first.quality.values[cells]
    assert flat.summary == (
        f"size-skew: min {values.min():.4f}, mean {values.mean():.4f}; {len(cells)} cells cut"
    )
    x, y = to_display(flat_plotter, np.array([[0.2, 0.2, 0.0]]))[0]
    assert flat.pick_cell(x, y) in cells
    assert flat.pick_cell(2, 2) is None
    away = Section("plane", (0.0, 0.0, 9.0), (0.0, 0.0, 1.0))
    flat.update(session, away)
    flat.fit()
    assert flat.summary == "it cuts no cell"
    assert flat.pick_cell(x, y) is None


@pytest.mark.parametrize("whole", [False, True])
def test_a_flat_section_has_the_cells_of_the_range_and_says_so(scene, flat_plotter, cube, whole):
    section = replace(MIDDLE, whole_cells=whole)
    session = opened(scene, bent(cube), sections=(section,), color_by="size-skew")
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    flat.update(session, section)
    bounds, every = flat.bounds(), flat.polygons.cell_ids
    some, kept = halved(session)
    flat.update(some, section)
    mine = np.intersect1d(every, kept)
    assert flat.polygons.cell_ids.tolist() == mine.tolist()
    values = session.first.quality.values[mine]
    low, high = some.view.threshold
    assert flat.summary == (
        f"size-skew: min {values.min():.4f}, mean {values.mean():.4f}; "
        f"{len(mine)} of {len(every)} cells cut (shown: {low:.3g} to {high:.3g})"
    )
    assert np.allclose(flat.bounds(), bounds), "the section stays where it was"
    flat.update(changes.set_view(session, threshold=(-1.0, -0.5)), section)
    assert flat.summary == f"none of {len(every)} cells cut is shown: inverted cells"


def test_the_undeformed_section_is_an_outline_in_the_flat_view(scene, flat_plotter, stator):
    section = Section("cylinder", radius=0.27)
    session = opened(scene, stator.mesh, stator.case, sections=(section,), passages=1)
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    flat.update(session, section)
    before = flat.polygons
    turned = stepped(session, transformed(stator.mesh.points, pair_matrix(0.01)))
    flat.update(turned, section)
    line = flat_plotter.actors["undeformed"]
    assert not line.visibility
    shown = changes.set_view(turned, undeformed=True)
    flat.update(shown, section)
    assert line.visibility
    assert flat.summary.endswith("cells cut; line: undeformed")
    corners = line.mapper.dataset.points
    assert np.ptp(corners, axis=0)[:2] == pytest.approx(np.ptp(before.points, axis=0)[:2])
    assert corners.mean(axis=0)[1] != pytest.approx(flat.polygons.points.mean(axis=0)[1], rel=1e-3)
    assert sum(name.startswith("undeformed:") for name in flat_plotter.actors) == 2
    flat.update(changes.show_frame(shown, 0), section)
    assert not line.visibility
    assert "line" not in flat.summary


def pair_matrix(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def test_flat_neighbours_can_be_picked(scene, flat_plotter, stator):
    section = Section("cylinder", radius=0.27)
    session = opened(scene, stator.mesh, stator.case, sections=(section,), passages=1)
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    flat.update(session, section)
    flat.fit()
    big = int(np.argmax(areas(flat.polygons)))
    twin = np.array(flat_plotter.actors["flat:1"].user_matrix)
    at = transformed(middles(flat.polygons)[big][None], twin)
    assert flat.pick_cell(*to_display(flat_plotter, at)[0]) == flat.polygons.cells[big]


def test_flat_neighbours_lie_one_period_on(scene, flat_plotter, stator):
    section = Section("cylinder", radius=0.27)
    session = opened(scene, stator.mesh, stator.case, sections=(section,), passages=1)
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    flat.update(session, section)
    one = flat.polygons.points
    low, high = flat.bounds()
    pitch = 0.27 * find_period(stator.mesh, stator.case).period
    assert high[1] - low[1] == pytest.approx(np.ptp(one[:, 1]) + 2 * pitch)
    z = float(stator.mesh.points[:, 2].mean())
    flat.update(session, Section("plane", (0.0, 0.0, z), (0.0, 0.0, 1.0)))
    twins = {n: a for n, a in flat_plotter.actors.items() if n.startswith("flat:")}
    assert len(twins) == 2
    radii = [
        np.hypot(*transformed(flat.polygons.points, np.array(twin.user_matrix))[:, :2].T)
        for twin in twins.values()
    ]
    own = np.hypot(*flat.polygons.points[:, :2].T)
    assert all(np.allclose(each, own) for each in radii)


def test_the_marked_cell_has_a_rim_in_the_flat_view(scene, flat_plotter, cube):
    session = opened(scene, cube, sections=(MIDDLE,))
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    cell = int(crossing(cube, 2, 0.46)[7])
    flat.update(changes.mark_cell(session, cell), MIDDLE)
    mark = flat_plotter.actors["marked"]
    assert mark.visibility
    drawn = flat.polygons.points[
        flat.polygons.take(np.flatnonzero(flat.polygons.cells == cell)).connectivity
    ]
    assert mark.bounds[:2] == pytest.approx((drawn[:, 0].min(), drawn[:, 0].max()))
    flat.update(changes.mark_cell(session, 0), MIDDLE)
    assert mark.visibility == (0 in crossing(cube, 2, 0.46))


def test_a_fold_is_seen_in_the_flat_view(scene, flat_plotter, cube):
    session = opened(scene, cube, sections=(MIDDLE,), color_by="size-skew", edges=False)
    points = cube.points.copy()
    inside = ((points > 0.3) & (points < 0.7)).all(axis=1)
    points[inside] = 1.0 - points[inside]
    later = stepped(session, points)
    flat = FlatScene(flat_plotter, scene.sections.cuts)
    flat.update(session, MIDDLE)
    flat.fit()
    assert count(flat_plotter, INVERTED_COLOR, 30) == 0
    flat.update(later, MIDDLE)
    assert count(flat_plotter, INVERTED_COLOR, 30) > 50
    assert "inverted" in flat.summary


# As a file --------------------------------------------------------------------------------


def test_a_section_is_saved_as_the_view_shows_it(stator, tmp_path):
    session = open_mesh(StepFrame(stator.mesh, quality(stator.mesh)), None, (), stator.case)
    session = changes.set_view(session, passages=1, color_by="skew", color_range=(0.2, 0.9))
    section = Section("cylinder", radius=0.27)
    told = []
    one, three = tmp_path / "one.svg", tmp_path / "three.svg"
    going = (SectionStyle((1600, 1000)), Job(told.append))
    assert save_section(three, session, section, *going) == three
    save_section(one, changes.set_view(session, passages=0), section, *going)
    assert three.stat().st_size > 2 * one.stat().st_size
    assert [type(each).__name__ for each in told] == ["JobProgress"] * 4
    with pytest.raises(CaseError, match="no mesh is open"):
        save_section(one, Session(), section, *going)
    with pytest.raises(CaseError, match="a section is drawn as"):
        save_section(tmp_path / "one.bmp", session, section, *going)
    with pytest.raises(Cancelled):
        save_section(
            one, session, section, SectionStyle((1600, 1000)), Job(told.append, lambda: True)
        )


def test_the_picture_of_a_section_has_the_colors_of_the_view_and_says_which_run_it_is_of(
    cube, tmp_path, monkeypatch
):
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    section = Section("plane", (0.5, 0.5, 0.52))
    assert frame_words(session) == "undeformed"
    moved = cube.with_points(cube.points * (1.0, 1.0, 1.2))
    session = changes.set_case(session, sliding="ds")
    for _ in range(2):
        frames = [StepFrame(moved, quality(moved, cube))] * 3
        session = changes.end_run(changes.add_frames(changes.start_run(session), frames), "done")
    session = changes.set_view(
        session, color_by="size", color_range=(0.2, 0.9), color_map="cividis"
    )
    session = changes.show_frame(session, 2)
    drawn = []
    real = section_picture.draw_section
    monkeypatch.setattr(
        section_picture, "draw_section", lambda *v: drawn.append(real(*v)) or drawn[-1]
    )
    file = tmp_path / "a.png"
    paper = SectionStyle.of_cm(8.5, 6.4)
    save_section(file, session, section, paper, Job())
    figure = drawn[0]
    said = figure.get_suptitle().split("\n")
    assert "run 2, direct sliding, step 2, plane z = 0.52" in said
    assert all(text.get_window_extent().x0 >= 0 for text in figure.texts)
    shapes = figure.axes[0].collections[0]
    values = session.frame.quality.size[shapes_cells(session, section)]
    share = np.clip((values - 0.2) / 0.7, 0.0, 1.0)
    wanted = mpl.colormaps["cividis"](share)
    found = shapes.get_facecolor()
    assert np.allclose(np.unique(found, axis=0), np.unique(wanted, axis=0), atol=0.01)
    with Image.open(file) as image:
        assert image.size == paper.size == (1004, 756)
        assert image.info["dpi"] == pytest.approx((300.0, 300.0), abs=0.1)


def test_the_picture_of_a_section_has_the_cells_of_the_range(cube, tmp_path, monkeypatch):
    mesh = bent(cube)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = changes.set_view(session, color_by="size-skew")
    some, kept = halved(session)
    drawn = []
    real = section_picture.draw_section
    monkeypatch.setattr(
        section_picture, "draw_section", lambda *v: drawn.append(real(*v)) or drawn[-1]
    )
    going = (SectionStyle((1600, 1000)), Job())
    save_section(tmp_path / "a.png", some, MIDDLE, *going)
    figure = drawn[0]
    cut = shapes_cells(session, MIDDLE)
    assert len(figure.axes[0].collections[0].get_paths()) == np.isin(cut, kept).sum() < len(cut)
    assert any("shown: " in text.get_text() for text in figure.texts)
    nothing = changes.set_view(session, threshold=(-1.0, -0.5))
    with pytest.raises(CaseError, match=r"cuts no cell that is shown \(inverted cells\)"):
        save_section(tmp_path / "b.png", nothing, MIDDLE, *going)


@pytest.mark.parametrize("whole", [False, True])
def test_sections_of_a_drawing_have_the_cells_of_the_range(square, whole):
    session = open_mesh(StepFrame(square, quality(square)), None)
    session = changes.set_view(
        session, color_by="size-skew", sections=(replace(LINE, whole_cells=whole),)
    )

    def colored():
        axes = draw_vector(renderer, PictureOptions((400, 300), legend=False)).axes[0]
        above = [each for each in axes.collections if 1.0 < each.get_zorder() < 2.0]
        return [each for each in above if each.get_array() is not None]

    with OffscreenRenderer(session, find_surfaces(square)) as renderer:
        assert colored()
        renderer.session = changes.set_view(session, threshold=(2.0, 3.0))
        assert not colored()


def shapes_cells(session, section):
    """Return the cells that a section shows."""
    return Cuts().of(session.frame.mesh, section).cells
