"""Cylinders through 3D meshes: the part in the mesh, where it is held, and dragged to."""

import numpy as np
import pytest

from slideviz.scene.axis_handle import dragged_size, frame_of, patch_in, pixel_and_slope
from slideviz.sections.model import Section
from slideviz.session.section_cuts import Cuts
from tests.builders import grid, ring

SHAPE = (4, 6, 5)
CUT = Section("cylinder", radius=0.7)


def sector(start, degrees=30.0):
    return grid(SHAPE, place=ring(SHAPE, 0.5, 1.0, degrees, start))


@pytest.mark.parametrize("start", [0, 75, 165, 170, 275, 350])
def test_the_middle_of_a_sector_is_in_it_wherever_it_lies(start):
    patch = patch_in(CUT, sector(start), Cuts())
    assert np.ptp(patch.angles) == pytest.approx(np.radians(30.0))
    assert patch.along == pytest.approx((0.0, 1.0))
    (ball,) = CUT.surface(np.array([patch.middle]), 0.7)
    middle = np.radians(start + 15.0)
    assert ball == pytest.approx((0.7 * np.cos(middle), 0.7 * np.sin(middle), 0.5))
    lines = frame_of(CUT, patch)
    assert len(lines) == 4
    every = np.concatenate(lines)
    assert np.hypot(*every[:, :2].T) == pytest.approx(0.7)
    # Around the patch, and near to it.
    assert every[:, 2].min() < 0.0 < 1.0 < every[:, 2].max()
    assert np.ptp(every[:, 2]) < 1.1


def test_a_whole_ring_has_two_circles():
    mesh = grid((3, 24, 4), wrap=1, place=ring((3, 24, 4), 0.5, 1.0, 360.0))
    patch = patch_in(CUT, mesh, Cuts())
    assert patch.is_full_ring
    low, high = frame_of(CUT, patch)
    assert low[0] == pytest.approx(low[-1])
    assert high[0] == pytest.approx(high[-1])


def test_it_is_not_held_in_a_hole():
    angle, along = np.meshgrid(np.radians(np.linspace(0, 30, 31)), np.linspace(0, 1, 31))
    places = np.column_stack([angle.ravel(), along.ravel()])
    away = np.abs(places - (np.radians(15.0), 0.5)) * (0.7, 1.0)
    points = CUT.surface(places[np.linalg.norm(away, axis=1) > 0.15], 0.7)
    patch = CUT.patch(points)
    (ball,) = CUT.surface(np.array([patch.middle]), 0.7)
    assert np.linalg.norm(points - ball, axis=1).min() < 1e-9


def test_where_nothing_is_cut_it_is_beside_the_mesh():
    patch = patch_in(Section("cylinder", radius=2.0), sector(40), Cuts())
    assert patch.angles == pytest.approx(tuple(np.radians([40.0, 70.0])))


def test_from_outside_the_axis_is_to_the_right():
    section = Section("cylinder", (1.0, 2.0, 3.0), (0.0, 1.0, 0.0), 0.7)
    points = np.array([[1.7, 2.0, 3.0], [1.69, 2.5, 3.1]])
    right, up, to_eye = section.facing(points)
    assert right == pytest.approx((0.0, 1.0, 0.0))
    assert np.cross(right, up) == pytest.approx(to_eye)
    assert to_eye[0] > 0.99


def parallel(points):
    """Seen along z, a hundred pixels for a unit."""
    return 100.0 * points[:, :2]


def perspective(points):
    """Seen from z = 4."""
    return 400.0 * points[:, :2] / (4.0 - points[:, 2:])


@pytest.mark.parametrize("seen", [parallel, perspective])
def test_the_ball_follows_the_mouse(seen):
    leaning = Section("cylinder", (0.1, 0.0, 0.0), (1.0, 0.0, 0.5), 0.7)
    for section in (CUT, leaning):
        place = (0.5, 0.25)
        ends = (section.surface(np.array([place]), radius) for radius in (0.7, 1.1))
        start, end = (seen(point)[0] for point in ends)
        # Wherever in the ball the mouse has it.
        held = np.array([3.0, -2.0])
        assert dragged_size(
            seen, section, place, start=start + held, now=end + held
        ) == pytest.approx(1.1)
        assert (
            dragged_size(seen, section, place, start=start, now=start - 1e6 * (end - start)) > 0.0
        )


def test_along_the_radius_upwards_is_outwards():
    section = Section("cylinder", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.7)
    points = np.array([[0.0, 0.0, 0.7], [1.0, 0.0, 0.7]])
    place = section.patch(points).middle
    at, way, steep = pixel_and_slope(parallel, section, place, 0.7)
    assert steep
    assert way == pytest.approx((0.0, 100.0))
    now = at + np.array([5.0, 20.0])
    assert dragged_size(parallel, section, place, start=at, now=now) == pytest.approx(0.9)
