"""Cylinders through 3D meshes: the part in the mesh, where their handle is."""

import numpy as np
import pytest

from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session.placed import points_near
from slideviz.session.section_cuts import Cuts
from tests.builders import grid, ring

SHAPE = (4, 6, 5)
CUT = Section("cylinder", radius=0.7)


def sector(start, degrees=30.0):
    return grid(SHAPE, place=ring(SHAPE, 0.5, 1.0, degrees, start))


@pytest.mark.parametrize("start", [0, 75, 165, 170, 275, 350])
def test_the_middle_of_a_sector_is_in_it_wherever_it_lies(start):
    mesh = sector(start)
    patch = CUT.patch(Cutter(mesh).cut(mesh.points, CUT).points)
    assert np.ptp(patch.angles) == pytest.approx(np.radians(30.0))
    assert patch.along == pytest.approx((0.0, 1.0))
    (ball,) = CUT.surface(np.array([patch.middle]), 0.7)
    middle = np.radians(start + 15.0)
    assert ball == pytest.approx((0.7 * np.cos(middle), 0.7 * np.sin(middle), 0.5))


def test_it_is_not_held_in_a_hole():
    angle, along = np.meshgrid(np.radians(np.linspace(0, 30, 31)), np.linspace(0, 1, 31))
    places = np.column_stack([angle.ravel(), along.ravel()])
    away = np.abs(places - (np.radians(15.0), 0.5)) * (0.7, 1.0)
    points = CUT.surface(places[np.linalg.norm(away, axis=1) > 0.15], 0.7)
    patch = CUT.patch(points)
    (ball,) = CUT.surface(np.array([patch.middle]), 0.7)
    assert np.linalg.norm(points - ball, axis=1).min() < 1e-9


def test_where_nothing_is_cut_it_is_beside_the_mesh():
    section = Section("cylinder", radius=2.0)
    patch = section.patch(points_near(section, sector(40), Cuts()))
    assert patch.angles == pytest.approx(tuple(np.radians([40.0, 70.0])))


def test_from_outside_the_axis_is_to_the_right():
    section = Section("cylinder", (1.0, 2.0, 3.0), (0.0, 1.0, 0.0), 0.7)
    points = np.array([[1.7, 2.0, 3.0], [1.69, 2.5, 3.1]])
    right, up, to_eye = section.facing(points)
    assert right == pytest.approx((0.0, 1.0, 0.0))
    assert np.cross(right, up) == pytest.approx(to_eye)
    assert to_eye[0] > 0.99
