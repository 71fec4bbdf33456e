"""The handle: what is under the mouse stays there, in both projections; snapped and typed numbers.

Nothing is drawn: a view is a matrix here, and a mouse is a pixel.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.case.motions.box import Ffd, boxes_for
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.moving_nodes import displacements
from slideviz.mesh.quality import quality
from slideviz.scene.handle import Drag, control_at, nice, on_path, part_at, parts_of, rounded
from slideviz.scene.pick import Projection
from slideviz.session import changes
from slideviz.session.motions import Ghosts
from slideviz.session.opening import open_mesh
from slideviz.session.placed import placed
from slideviz.session.section_cuts import Cuts, first_section
from slideviz.session.state import StepFrame
from tests.builders import grid, ring
from tests.scenes import square_mesh

SIZE = np.array([900, 700])


def look(towards, perspective, centre=(0.5, 0.5, 0.5), half=1.0):
    """A view of 900 x 700 pixels from a direction."""
    back = np.asarray(towards, float) / np.linalg.norm(towards)
    right = np.cross([0.0, 0.0, 1.0] if abs(back[2]) < 0.9 else [0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    turn = np.eye(4)
    turn[:3, :3] = np.stack([right, np.cross(back, right), back])
    away = 4.0
    turn[:3, 3] = -turn[:3, :3] @ (np.asarray(centre) + away * back)
    wide = SIZE[0] / SIZE[1]
    if perspective:
        slope = away / half
        lens = np.array(
            [
                [slope / wide, 0, 0, 0],
                [0, slope, 0, 0],
                [0, 0, -(9.0 + 1.0) / 8.0, -2.0 * 9.0 / 8.0],
                [0, 0, -1, 0],
            ]
        )
    else:
        lens = np.diag([1.0 / (half * wide), 1.0 / half, -0.25, 1.0])
        lens[2, 3] = -1.25
    return Projection(lens @ turn, SIZE)


VIEWS = [
    look(towards, perspective)
    for towards in ((1.0, -1.0, 0.8), (0.2, -1.0, 0.3), (-0.5, 0.4, 1.0))
    for perspective in (False, True)
]


def handle_of(session):
    ghosts = Ghosts(session.mesh).moved(session.case)
    return placed(session, ghosts, Cuts())


def first_marker(session):
    return session.case.markers_with("moving")[0]


@pytest.fixture(scope="module")
def body():
    """A cube of which one boundary moves, and is selected."""
    mesh = grid((3, 3, 3))
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = changes.set_role(session, mesh.marker_names, "fixed")
    session = changes.set_role(session, mesh.marker_names[:1], "moving")
    return changes.select(session, mesh.marker_names[:1])


def take(now, view, grip, start=None):
    """The drag that begins at a part of the handle."""
    part = next(part for part in parts_of(now, view, 1.0) if part.grip == grip)
    start = part.line[len(part.line) // 2] if start is None else start
    point = view.on_plane(start, part.point, view.sight(part.point))
    return Drag(now, view, *grip, point, start, start)


def ended(drag, by, **keys):
    return drag.moved_to(drag.start + by, **{"fine": False, "snaps": False} | keys)


SHIFTS = st.tuples(st.floats(-150.0, 150.0), st.floats(-150.0, 150.0))


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(VIEWS), SHIFTS)
def test_what_is_held_stays_under_the_mouse(body, view, by):
    drag = ended(take(handle_of(body), view, ("move", ())), by)
    session = drag.result().session
    shift = np.array(session.case.motions[0].vector)
    (seen,) = view.pixels((drag.point + shift)[None])
    assert seen == pytest.approx(drag.now, abs=1.0)
    moved = handle_of(session)
    assert moved.origin == pytest.approx(drag.result().origin, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(VIEWS), st.sampled_from([(0, 1), (1, 2), (0, 2)]), SHIFTS)
def test_in_a_plane_two_numbers_change_and_it_stays_under_the_mouse(body, view, axes, by):
    now = handle_of(body)
    if ("move", axes) not in [part.grip for part in parts_of(now, view, 1.0)]:
        return
    drag = ended(take(now, view, ("move", axes)), 0.3 * np.array(by))
    shift = np.array(drag.result().session.case.motions[0].vector)
    (other,) = {0, 1, 2} - {*axes}
    assert shift[other] == 0.0
    (seen,) = view.pixels((drag.point + shift)[None])
    assert seen == pytest.approx(drag.now, abs=2.0)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(VIEWS), st.integers(0, 2), st.floats(-150.0, 150.0))
def test_along_an_axis_it_is_as_near_to_the_mouse_as_the_axis_allows(body, view, axis, by):
    drag = take(handle_of(body), view, ("move", (axis,)))
    way = np.diff(view.pixels(drag.point + np.array([[0.0], [1e-3]]) * np.eye(3)[axis]), axis=0)[0]
    way /= np.linalg.norm(way)
    across = np.array([-way[1], way[0]])
    drag = ended(drag, by * way + 7.0 * across)
    shift = np.array(drag.result().session.case.motions[0].vector)
    assert np.delete(shift, axis) == pytest.approx(0.0)
    (seen,) = view.pixels((drag.point + shift)[None])
    assert abs((seen - drag.now) @ way) < 1.0
    words = drag.result().words
    assert float(words.split(": ")[1]) == shift[axis], "the number in the status line is the case's"


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(VIEWS), st.integers(0, 2), st.floats(-80.0, 80.0))
def test_a_ring_turns_what_is_held_to_the_mouse(body, view, axis, angle):
    now = handle_of(body)
    drag = take(now, view, ("turn", (axis,)))
    number = now.turn(axis)
    there = number.path(angle, view.on_plane(drag.start, now.origin, now.axes[axis]))
    drag = replace(drag, now=view.pixels(there[None])[0])
    turned = drag.result().session.case.motions[0]
    assert turned.angle_deg == pytest.approx(angle, abs=0.051)
    assert turned.axis == tuple(np.eye(3)[axis])
    assert turned.point == "centroid"


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_box_enlarges_along_its_axis(body, view, axis):
    drag = take(handle_of(body), view, ("grow", (axis,)))
    there = drag.placed.grow(axis).path(1.3, drag.point)
    drag = replace(drag, now=view.pixels(there[None])[0])
    factors = drag.result().session.case.motions[0].factors
    assert factors[axis] == pytest.approx(1.3, abs=0.02)
    assert np.delete(factors, axis) == pytest.approx(1.0)


@pytest.mark.parametrize("view", VIEWS)
def test_of_a_turned_boundary_what_is_held_stays_under_the_mouse(body, view):
    name = first_marker(body)
    session = changes.add_motion(body, Translate(name, (0.1, 0.0, 0.0)))
    session = changes.add_motion(session, Rotate(name, 50.0, (0.0, 0.0, 0.0), (0.0, 0.3, 1.0)))
    session = changes.add_motion(session, Scale(name, (1.2, 1.0, 0.7)))
    drag = ended(take(handle_of(session), view, ("move", ())), (70.0, -50.0))
    now = drag.result()
    assert len(now.session.case.motions) == 3
    moved = handle_of(now.session)
    assert moved.origin == pytest.approx(now.origin, abs=1e-9)
    before, after = view.pixels(np.stack([drag.placed.origin, moved.origin]))
    plane = view.sight(drag.placed.origin)
    assert (moved.origin - drag.placed.origin) @ plane == pytest.approx(0.0, abs=5e-3)
    assert after - before == pytest.approx((70.0, -50.0), abs=2.0)


def test_each_act_changes_the_motion_of_its_kind_and_adds_none_twice(body):
    view = VIEWS[0]
    session = body
    for grip in (("move", (0,)), ("turn", (2,)), ("grow", (1,)), ("move", (1,)), ("turn", (2,))):
        session = ended(take(handle_of(session), view, grip), (40.0, 30.0)).result().session
    kinds = [type(motion) for motion in session.case.motions]
    assert kinds == [Translate, Rotate, Scale]
    assert session.motion_index == 1
    moved, turned, _ = session.case.motions
    assert moved.vector[0] != 0.0 != moved.vector[1]
    # About another axis it is another motion, as one has one axis.
    other = ended(take(handle_of(session), view, ("turn", (0,))), (0.0, 40.0)).result().session
    assert other.case.motions[1] == turned
    assert other.case.motions[3].axis == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("target", ["", ("x_m", "gone")])
def test_a_name_that_the_mesh_lacks_leaves_the_handle_of_the_others(body, target):
    session = changes.add_motion(body, Translate(target, (0.1, 0.0, 0.0)))
    roles = {**session.case.roles, "gone": "moving"}
    lacking = replace(session, case=session.case.change(roles=roles))
    there = changes.add_motion(body, Translate("x_m", (0.1, 0.0, 0.0)))
    assert np.array_equal(handle_of(lacking).origin, handle_of(there).origin)


def test_a_typed_number_is_that_of_the_case(body):
    drag = take(handle_of(body), VIEWS[1], ("move", ()))
    typed = replace(drag, axes=(1,), typed="-0.25").result()
    assert typed.session.case.motions[0].vector == (0.0, -0.25, 0.0)
    assert typed.words == "Move y: -0.25"
    again = take(handle_of(typed.session), VIEWS[1], ("move", ()))
    assert replace(again, axes=(1,), typed=".5").result().session.case.motions[0].vector[1] == 0.5
    turned = replace(drag, act="turn", axes=(2,), typed="5").result()
    assert turned.session.case.motions[0].angle_deg == 5.0
    grown = replace(drag, act="grow", axes=(), typed="1.1").result()
    assert grown.session.case.motions[0].factors == pytest.approx((1.1, 1.1, 1.1))
    # What is no number yet leaves it to the mouse.
    assert replace(drag, typed="-").result().session.case.motions[0].vector == (0.0, 0.0, 0.0)


def test_numbers_snap_and_go_finely(body):
    drag = take(handle_of(body), VIEWS[0], ("move", (0,)))
    snapped = ended(drag, (60.0, -31.0), snaps=True).result().session.case.motions[0].vector[0]
    least = nice(20.0 * VIEWS[0].pixel_length(drag.placed.origin))
    assert snapped / least == pytest.approx(round(snapped / least))
    assert snapped
    whole = ended(drag, (60.0, -31.0)).result().session.case.motions[0].vector[0]
    fine = ended(drag, (60.0, -31.0), fine=True).result().session.case.motions[0].vector[0]
    assert fine == pytest.approx(0.1 * whole, rel=0.02)
    ring = take(handle_of(body), VIEWS[0], ("turn", (2,)))
    angle = ended(ring, (31.0, 20.0), snaps=True).result().session.case.motions[0].angle_deg
    assert angle % 5.0 == 0.0


def test_where_nothing_is_moved_along_an_axis_it_says_zero(body):
    motion = Translate(first_marker(body), (3.06162e-17, 0.0, 0.0))
    moved = changes.set_case(body, motions=(motion,))
    here = handle_of(moved)
    (start,) = VIEWS[0].pixels(here.origin[None])
    still = Drag(here, VIEWS[0], "move", (), here.origin, start, start).result()
    assert still.words == "Move: (0, 0, 0)"


def test_a_turn_goes_on_beyond_half_a_turn(body):
    now = handle_of(body)
    view = look((0.0, 0.0, 1.0), False)
    drag = take(now, view, ("turn", (2,)))
    (middle,) = view.pixels(now.origin[None])
    arm = drag.start - middle
    for angle in np.radians(np.arange(0.0, 401.0, 40.0)):
        way = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        drag = replace(drag, now=middle + way @ arm)
        drag = replace(drag, before=drag.result().turned)
    assert drag.result().session.case.motions[0].angle_deg == pytest.approx(400.0, abs=0.1)


def test_no_more_digits_than_the_mouse_can_aim_at(body):
    drag = ended(take(handle_of(body), VIEWS[0], ("move", ())), (33.0, 21.0))
    assert all(len(repr(value)) < 8 for value in drag.result().session.case.motions[0].vector)
    assert rounded(0.123456, 0.01) == 0.12
    assert rounded(-0.0001, 0.01) == 0.0


def test_the_mouse_takes_the_middle_before_the_arrows_and_nothing_far_away(body):
    now = handle_of(body)
    parts = parts_of(now, VIEWS[0], 1.0)
    (middle,) = VIEWS[0].pixels(now.origin[None])
    assert part_at(parts, middle + 3.0, 1.0).grip == ("move", ())
    arrow = next(part for part in parts if part.grip == ("move", (2,)))
    assert part_at(parts, arrow.line[1] + (2.0, 1.0), 1.0).grip == ("move", (2,))
    assert part_at(parts, middle + 300.0, 1.0) is None


def test_along_the_line_of_sight_there_is_no_arrow_and_upwards_is_more(body):
    view = look((1.0, 0.0, 0.0), False)
    now = handle_of(body)
    grips = [part.grip for part in parts_of(now, view, 1.0)]
    assert ("move", (0,)) not in grips
    assert ("move", (1, 2)) in grips
    number = now.along(0)
    at = view.pixels(now.origin[None])[0] + (0.0, 30.0)
    value, _ = on_path(view, lambda to: number.path(to, now.origin), 0.0, at)
    assert value == pytest.approx(30.0 * view.pixel_length(now.origin))


def test_a_push_from_an_axis_follows_the_mouse(body):
    name = first_marker(body)
    push = Radial(name, 1.0, 0.0, (0.0, 0.0, 1.0), (0.2, 0.5, 0.0))
    session = changes.add_motion(body, push)
    now = handle_of(session)
    for view in VIEWS:
        drag = take(now, view, ("grow", ()))
        there = now.grow(None).path(0.2, drag.point)
        drag = replace(drag, now=view.pixels(there[None])[0])
        assert drag.result().session.case.motions[0].distance == pytest.approx(0.2, abs=3e-3)


# Sections ---------------------------------------------------------------------------------
def with_section(mesh, section, **view):
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    return changes.show_handle(changes.add_section(session, section), "section")


@pytest.mark.parametrize("view", VIEWS)
def test_a_plane_is_pushed_by_its_middle_and_turned_by_its_rings(view):
    mesh = grid((4, 4, 4))
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = with_section(mesh, first_section("plane", session))
    (before,) = session.view.sections
    drag = take(handle_of(session), view, ("move", (3,)))
    there = drag.placed.along(3).path(before.position + 0.2, drag.point)
    pushed = replace(drag, now=view.pixels(there[None])[0]).result().session.view.sections[0]
    assert pushed.position == pytest.approx(before.position + 0.2, abs=3e-3)
    assert pushed.direction == before.direction
    ball = replace(drag, axes=(), now=view.pixels(there[None])[0])
    assert ball.result().session.view.sections[0].position == pytest.approx(pushed.position)
    tilted = replace(drag, act="turn", axes=(4,), typed="30").result().session.view.sections[0]
    assert np.dot(tilted.direction, before.basis[2]) == pytest.approx(
        np.cos(np.radians(30)), abs=1e-4
    )
    assert tilted.origin == before.origin


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("kind", ["cylinder", "cone"])
def test_a_section_about_an_axis_is_pulled_to_another_size(view, kind):
    mesh = grid((4, 6, 5), place=ring((4, 6, 5), 0.5, 1.0, 60.0, 20.0))
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = with_section(mesh, first_section(kind, session))
    (before,) = session.view.sections
    now = handle_of(session)
    assert abs(before.distance(now.origin[None])[0]) < 1e-12
    drag = take(now, view, ("grow", ()))
    wanted = 1.15 * before.size
    there = now.grow(None).path(wanted, drag.point)
    steep = np.linalg.norm(np.subtract(*view.pixels(np.stack([there, drag.point])))) < 5.0
    pulled = replace(drag, now=view.pixels(there[None])[0]).result().session.view.sections[0]
    if not steep:
        assert pulled.size == pytest.approx(wanted, rel=0.01)
    assert (pulled.origin, pulled.direction) == (before.origin, before.direction)
    far = replace(drag, typed="-5").result().session.view.sections[0]
    assert 0.0 < far.size < before.size


def test_lines_and_circles_of_a_2d_mesh():
    view = look((0.0, 0.0, 1.0), False, (2.0, 2.0, 0.0), 3.0)
    mesh = square_mesh(4)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    line = with_section(mesh, first_section("plane", session))
    drag = take(handle_of(line), view, ("move", ()))
    moved = ended(drag, (40.0, 25.0)).result().session.view.sections[0]
    unit = view.pixel_length(drag.placed.origin)
    start = line.view.sections[0].origin
    assert np.subtract(moved.origin, start) == pytest.approx((40 * unit, 25 * unit, 0.0), abs=unit)
    turned = replace(take(handle_of(line), view, ("turn", (2,))), typed="45").result()
    assert np.abs(turned.session.view.sections[0].direction) == pytest.approx((0.7071, 0.7071, 0.0))
    circle = with_section(mesh, first_section("cylinder", session))
    grown = replace(take(handle_of(circle), view, ("grow", ())), typed="0.7").result()
    assert grown.session.view.sections[0].radius == 0.7
    pulled = ended(take(handle_of(circle), view, ("grow", ())), (20.0, 20.0)).result()
    radius = circle.view.sections[0].radius
    more = pulled.session.view.sections[0].radius - radius
    assert more == pytest.approx(20.0 * np.sqrt(2.0) * unit, abs=unit)


# Boxes ------------------------------------------------------------------------------------
def boxed(mesh, degrees=(2, 2, 2), system="CARTESIAN"):
    """A mesh with a box of the case around the first boundary, and a motion of it."""
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = changes.set_role(session, mesh.marker_names, "fixed")
    session = changes.set_role(session, mesh.marker_names[:1], "moving")
    name = mesh.marker_names[0]
    session = changes.add_motion(session, Ffd(name, "", (0, 0, 0), (0.0, 0.0, 0.0)))
    session = changes.add_box(session, 0)
    return changes.shape_box(session, 0, degrees, system)


def about_x():
    """A sector of a ring about x."""
    mesh = grid((4, 6, 5), place=ring((4, 6, 5), 0.5, 1.0, 60.0, -30.0))
    points = mesh.points[:, [2, 0, 1]]
    return replace(mesh, points=points)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("system", ["CARTESIAN", "CYLINDRICAL"])
def test_a_control_point_stays_under_the_mouse(view, system):
    mesh = grid((3, 3, 3)) if system == "CARTESIAN" else about_x()
    session = boxed(mesh, (2, 2, 2), system)
    session = changes.choose_control(session, "BOX", (1, 2, 1))
    now = handle_of(session)
    box = boxes_for(session.case, session.mesh)["BOX"]
    assert now.origin == pytest.approx(box.points[1, 2, 1])
    drag = ended(take(now, view, ("move", ())), (40.0, -25.0))
    moved = drag.result()
    assert len(moved.session.case.motions) == 1
    after = handle_of(moved.session)
    assert after.origin == pytest.approx(moved.origin)
    shift = view.pixels(np.stack([now.origin, after.origin]))
    assert shift[1] - shift[0] == pytest.approx((40.0, -25.0), abs=1.5)
    for axis in range(3):
        typed = replace(drag, axes=(axis,), typed="0.05").result().session.case.motions[0]
        assert typed.vector == pytest.approx(0.05 * np.eye(3)[axis])


def test_in_cylindrical_coordinates_an_arrow_goes_around_the_axis():
    view = look((1.0, 0.0, 0.0), False, (0.5, 0.7, 0.0))
    session = changes.choose_control(boxed(about_x(), (2, 2, 2), "CYLINDRICAL"), "BOX", (2, 1, 1))
    now = handle_of(session)
    assert now.names == "rta"
    drag = take(now, view, ("move", (1,)))
    there = now.along(1).path(0.3, drag.point)
    vector = replace(drag, now=view.pixels(there[None])[0]).result().session.case.motions[0].vector
    assert vector == pytest.approx((0.0, 0.3, 0.0), abs=5e-3)
    box = boxes_for(session.case, session.mesh)["BOX"]
    around = now.along(1).path(0.3, now.origin)
    assert np.linalg.norm(around[1:]) == pytest.approx(np.linalg.norm(box.points[2, 1, 1][1:]))


def test_a_box_around_a_boundary_has_its_nodes_and_other_degrees_keep_its_corners():
    for mesh, system in ((grid((3, 3, 3)), "CARTESIAN"), (about_x(), "CYLINDRICAL")):
        session = boxed(mesh, (3, 1, 2), system)
        case = session.case
        assert case.ffd_degrees == ((3, 1, 2),)
        assert case.ffd_system == system
        motion = replace(case.motions[0], index=(-1, -1, -1), vector=(0.1, 0.0, 0.0))
        found = displacements(case.change(motions=(motion,)), mesh)
        assert (np.linalg.norm(found.vectors, axis=1) > 0.09).all()
        other = changes.shape_box(session, 0, (1, 1, 1), None).case
        assert other.ffd_boxes == case.ffd_boxes


def test_control_points_are_chosen_by_one_by_row_and_by_plane():
    session = boxed(grid((3, 3, 3)))
    box = boxes_for(session.case, session.mesh)["BOX"]
    view = VIEWS[3]
    at = view.pixels(box.points[2, 0, 1][None])[0]

    def picked(now, pixel, row):
        return control_at(now, view, pixel, 8.0, row=row)

    assert picked(session, at + 3.0, False) == ("BOX", (2, 0, 1))
    assert picked(session, at + 400.0, False) is None
    beside = view.pixels((0.4 * box.points[2, 0, 1] + 0.6 * box.points[2, 0, 2])[None])[0]
    assert picked(session, beside, True) == ("BOX", (2, 0, -1))
    seen = []
    for _ in range(4):
        name, index = picked(session, beside, True)
        session = changes.choose_control(session, name, index)
        assert len(session.case.motions) == 1, "what moves nothing yet is taken again"
        seen.append(index)
    assert seen == [(2, 0, -1), (-1, 0, -1), (2, -1, -1), (2, 0, -1)]
    moved = changes.replace_motion(session, 0, replace(session.case.motions[0], vector=(0.1, 0, 0)))
    more = changes.choose_control(moved, "BOX", (0, 0, 0))
    assert [motion.index for motion in more.case.motions] == [(2, 0, -1), (0, 0, 0)]
    again = changes.choose_control(more, "BOX", (2, 0, -1))
    assert again.motion_index == 0
    assert len(again.case.motions) == 2
    hidden = changes.set_view(session, ffd=False)
    assert picked(hidden, at, False) is None


def test_a_point_of_a_2d_box_is_both_layers():
    mesh = square_mesh(4)
    session = boxed(mesh, (2, 1, 0))
    view = look((0.0, 0.0, 1.0), False, (2.0, 2.0, 0.0), 3.0)
    box = boxes_for(session.case, mesh)["BOX"]
    at = view.pixels(box.points[1, 1, 0][None] * [1.0, 1.0, 0.0])[0]
    name, index = control_at(session, view, at, 8.0, row=False)
    assert (name, index) == ("BOX", (1, 1, -1))
    session = changes.choose_control(session, name, index)
    drag = ended(take(handle_of(session), view, ("move", ())), (20.0, 10.0))
    vector = drag.result().session.case.motions[0].vector
    assert vector[2] == 0.0
    unit = view.pixel_length(drag.placed.origin)
    assert vector[:2] == pytest.approx((20.0 * unit, 10.0 * unit), abs=unit)
