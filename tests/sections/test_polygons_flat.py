"""Sections laid flat: the unrolled cylinder, the plane seen along its normal."""

import numpy as np
import pytest

from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from tests.builders import cube, grid, passage, ring
from tests.sections.test_model_section import areas


def flatten(polygons, section, near=None):
    return section.flatten(polygons, near, near)


def turned(mesh, degrees):
    """The mesh turned about z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return mesh.with_points(mesh.points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))


def widest(flat):
    """The largest extent of a polygon in both flat directions."""
    x = flat.points[flat.connectivity, :2]
    low = np.minimum.reduceat(x, flat.offsets[:-1])
    return (np.maximum.reduceat(x, flat.offsets[:-1]) - low).max(axis=0)


def test_the_outline_of_polygons_is_what_one_of_them_has_alone():
    mesh = grid((4, 3, 2))
    cut = Cutter(mesh).cut(mesh.points, Section("plane", (0.0, 0.0, 0.3)))
    lines = cut.outline()
    assert set(lines.sizes) == {2}
    assert len(lines) == 2 * (4 + 3)
    ends = lines.points[lines.connectivity].reshape(-1, 2, 3)
    assert np.linalg.norm(np.diff(ends, axis=1), axis=2).sum() == pytest.approx(4.0)
    at_rim = np.isin(lines.cells, cut.cells) & (np.abs(ends[..., :2] - 0.5).max(axis=(1, 2)) > 0.4)
    assert at_rim.all()
    assert not len(cut.take(np.arange(0)).outline())


@pytest.mark.parametrize("start", [0, 75, 165, 170, 180, 275, 350])
@pytest.mark.parametrize("kind", ["plain", "simplex"])
def test_a_sector_unrolls_to_a_rectangle_wherever_it_lies(start, kind):
    shape = (4, 6, 5)
    mesh = grid(shape, kind=kind, place=ring(shape, 0.5, 1.0, 30.0, start))
    section = Section("cylinder", radius=0.7)
    cut = Cutter(mesh).cut(mesh.points, section)
    flat = flatten(cut, section)
    span = np.ptp(flat.points, axis=0)
    assert span == pytest.approx([1.0, 0.7 * np.radians(30), 0.0], abs=1e-12)
    assert areas(flat).sum() == pytest.approx(0.7 * np.radians(30), abs=1e-12)
    wanted = np.radians(start + 15)
    assert np.cos(section.middle_angle(cut) - wanted) == pytest.approx(1.0)


def test_a_whole_ring_is_opened_once_and_no_polygon_is_torn():
    shape = (3, 24, 4)
    mesh = grid(shape, wrap=1, place=ring(shape, 0.5, 1.0, 360.0))
    section = Section("cylinder", radius=0.7)
    cut = Cutter(mesh).cut(mesh.points, section)
    flat = flatten(cut, section)
    assert flat.cells.tolist() == cut.cells.tolist()
    assert areas(flat).sum() == pytest.approx(0.7 * 2 * np.pi, abs=1e-12)
    assert widest(flat)[1] == pytest.approx(0.7 * 2 * np.pi / 24)
    # The points on the seam are there twice.
    assert len(flat.points) == len(cut.points) + 5


def test_the_seam_is_in_the_empty_part():
    shape = (3, 30, 2)
    mesh = grid(shape, place=ring(shape, 0.5, 1.0, 300.0, 100.0))
    section = Section("cylinder", radius=0.8)
    flat = flatten(Cutter(mesh).cut(mesh.points, section), section)
    assert np.ptp(flat.points[:, 1]) == pytest.approx(0.8 * np.radians(300))


def test_copies_are_laid_beside_each_other():
    mesh = passage()
    section = Section("cylinder", radius=0.7)
    cutter = Cutter(mesh)
    near, tops = None, []
    for number in range(9):
        points = turned(mesh, 30 * number).points
        cut = cutter.cut(points, section)
        flat = flatten(cut, section, near)
        near = section.middle_angle(cut, near) + np.radians(30)
        tops.append(flat.points[:, 1].max())
    assert np.diff(tops) == pytest.approx(0.7 * np.radians(30))


def test_axis_and_centre_do_not_change_the_unrolled_shape():
    mesh = passage()
    section = Section("cylinder", radius=0.7)
    flat = flatten(Cutter(mesh).cut(mesh.points, section), section)
    # x to y to z to x, and away from the origin.
    shift = np.array([3.0, -1.0, 2.0])
    points = np.roll(mesh.points, 1, axis=1) + shift
    other = Section("cylinder", tuple(shift), (5.0, 0, 0), 0.7)
    again = flatten(Cutter(mesh).cut(points, other), other)
    assert areas(again) == pytest.approx(areas(flat))
    assert np.ptp(again.points, axis=0) == pytest.approx(np.ptp(flat.points, axis=0), abs=1e-12)
    # Positions along the axis are coordinates.
    assert again.points[:, 0].min() == pytest.approx(3.0)
    assert [label.full for label in other.flat_labels()] == ["x", "r θ"]


def test_the_sign_of_an_axis_does_not_matter():
    mesh = passage()
    one, other = (Section("cylinder", (0, 0, 0), (0, 0, s), 0.7) for s in (1, -1))
    flat = [flatten(Cutter(mesh).cut(mesh.points, s), s) for s in (one, other)]
    assert flat[0].points == pytest.approx(flat[1].points)


def test_whole_cells_keep_their_distance_from_the_cylinder():
    mesh = passage()
    section = Section("cylinder", radius=0.7, whole_cells=True)
    cut = Cutter(mesh).show(mesh.points, section)
    flat = flatten(cut, section)
    radii = np.unique(np.hypot(cut.points[:, 0], cut.points[:, 1]).round(9))
    assert np.unique(flat.points[:, 2].round(9)) == pytest.approx(radii - 0.7)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("normal", "labels"),
    [((0, 0, 1), ("x", "y")), ((0, 1, 0), ("x", "z")), ((1, 0, 0), ("y", "z"))],
)
def test_planes_along_the_axes_show_coordinates(normal, labels, sign):
    mesh = cube(4, block=False)
    points = mesh.points + np.array([10.0, 20.0, 30.0])
    section = Section("plane", (10.4, 20.4, 30.4), tuple(sign * v for v in normal))
    cut = Cutter(mesh).cut(points, section)
    flat = flatten(cut, section)
    assert tuple(label.short for label in section.flat_labels()) == labels
    wanted = cut.points[:, ["xyz".index(label) for label in labels]]
    assert flat.points[:, :2] == pytest.approx(wanted)
    assert np.abs(flat.points[:, 2]).max() < 1e-12


def test_an_oblique_plane_keeps_lengths_and_has_z_upwards():
    mesh = cube(4, block=False)
    section = Section("plane", (0.5, 0.5, 0.5), (1, 2, 0.5))
    cut = Cutter(mesh).cut(mesh.points, section)
    assert areas(flatten(cut, section)) == pytest.approx(areas(cut))
    axes = section.axes
    assert axes.rows @ axes.rows.T == pytest.approx(np.eye(3))
    assert np.linalg.det(axes.rows) == pytest.approx(1.0)
    assert axes.rows[1, 2] > 0.9
    assert axes.labels[0] == ("along (0.894, -0.447, 0)", "x′")
