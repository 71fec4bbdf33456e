"""Blades moved over span: curves, and sections laid flat between cylinders, with known answers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from slideviz.errors import MeshError
from slideviz.machine.blade import (
    ANGLE,
    CAMBER,
    CHORD,
    LEAN,
    SWEEP,
    TOTALS,
    BladeSections,
    change_of,
    curve_at,
)
from slideviz.machine.span_field import find_span
from slideviz.mesh.cached_boundary import boundary_of
from tests.builders import passage

AXIS, ORIGIN = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
AT = np.linspace(0.0, 1.0, 41)
curves = st.lists(
    st.tuples(st.integers(0, 20), st.floats(-9, 9)),
    min_size=2,
    max_size=6,
    unique_by=lambda p: p[0],
).map(lambda points: np.array(sorted(points)) / (20.0, 1.0))


@given(curves)
def test_curves_are_those_of_scipy_and_constant_beyond_their_ends(points):
    x, y = points.T
    value, slope = curve_at(x, y, AT)
    with np.errstate(over="ignore"):  # in SciPy, where values are close to the smallest number
        expected = PchipInterpolator(x, y)(np.clip(AT, x[0], x[-1]))
    assert value == pytest.approx(expected, abs=1e-12)
    assert value.min() >= y.min() - 1e-12
    assert value.max() <= y.max() + 1e-12
    assert slope.sum(axis=1) == pytest.approx(1.0, abs=1e-9)  # raised as a whole


@pytest.mark.parametrize("seed", range(5))
def test_derivatives_of_curves_agree_with_differences(seed):
    rng = np.random.default_rng(seed)
    x, y, change = np.linspace(0.1, 1.0, 2 + seed), *rng.normal(size=(2, 2 + seed))
    slope = curve_at(x, y, AT)[1]
    step = 1e-6 * change
    difference = (curve_at(x, y + step, AT)[0] - curve_at(x, y - step, AT)[0]) / 2e-6
    assert slope @ change == pytest.approx(difference, abs=1e-7)


def test_a_single_value_holds_for_all_spans_in_the_units_of_totals():
    row, value, slope = change_of("stagger", (0.0,), (90.0,), AT)
    assert row == ANGLE
    assert value == pytest.approx(np.pi / 2)
    assert slope == pytest.approx(np.pi / 180)
    row, value, slope = change_of("chord", (0.3,), (1.1,), AT)
    assert row == CHORD
    assert np.exp(value) == pytest.approx(1.1)
    assert slope == pytest.approx(1 / 1.1)


@pytest.fixture(scope="module")
def block():
    """The block in a sheared annular passage, with its triangles and meridional coordinates."""
    mesh = passage((4, 6, 8))
    x, y, z = mesh.points.T
    turned = (x + 1j * y) * np.exp(0.2j * z)
    return laid_flat(mesh.with_points(np.stack([turned.real, turned.imag, z], axis=1)))


def laid_flat(mesh):
    nodes = mesh.marker("blade").nodes
    field = find_span(mesh, "hub", "shroud", AXIS, ORIGIN, np.radians(30.0))
    boundary = boundary_of(mesh)
    facets = boundary.facets[boundary.marker == boundary.names.index("blade")]
    triangles = np.searchsorted(nodes, np.concatenate([facets[:, :3], facets[:, [0, 2, 3]]]))
    points = mesh.points[nodes]
    return field, points, triangles, field.meridional(points)


def moved(block, row, value, stack=None):
    field, points, triangles, before = block
    sections = BladeSections(field, points, triangles, stack)
    totals = np.zeros((TOTALS, len(points)))
    assert np.abs(sections.moved(totals)[0] - points).max() < 1e-14
    totals[row] = value
    after = field.meridional(sections.moved(totals)[0])
    assert np.abs(after[:, 1] - before[:, 1]).max() < 1e-14
    return before, after, after - before


def test_sections_turn_in_the_plane_of_m_prime_and_theta(block):
    angle = 0.3
    before, after, _ = moved(block, ANGLE, angle)
    for radius in np.unique(before[:, 1].round(9)):
        here = np.abs(before[:, 1] - radius) < 1e-9
        flat, turned = ((x[here, 0] / radius) + 1j * x[here, 2] for x in (before, after))
        assert (
            np.abs(turned - turned.mean() - np.exp(1j * angle) * (flat - flat.mean())).max() < 1e-12
        )
        # The stacking line is fitted to the centroids, which here are on a radial line.
        assert turned.mean() == pytest.approx(flat.mean(), abs=1e-6)


def test_a_point_of_the_stacking_line_stays_in_place(block):
    before, after, _ = moved(block, ANGLE, 0.3, block[1][0])
    assert np.abs(after[0] - before[0]).max() < 1e-12
    assert np.linalg.norm(after - before, axis=1).max() > 0.05


def about_z(points, angles):
    x, y, z = np.moveaxis(points, -1, 0)
    turned = (x + 1j * y) * np.exp(1j * angles)
    return np.stack([turned.real, turned.imag, z], axis=-1)


@pytest.mark.parametrize("side", [-1, 0, 1])
def test_a_blade_cut_by_periodic_sides_moves_as_the_whole_one_from_either_side(block, side):
    field, points, triangles, before = block
    period = np.radians(30.0)
    turns = np.where(before[:, 2] < before[:, 2].mean(), period, 0.0)
    totals = np.zeros((TOTALS, len(points)))
    totals[ANGLE] = 0.3
    whole = BladeSections(field, points, triangles, points[0]).moved(totals)[0]
    stack = about_z(points[0], side * period)
    parts = BladeSections(field, about_z(points, -turns), triangles, stack, turns).moved(totals)[0]
    assert np.abs(parts - about_z(whole, -turns)).max() < 1e-12


def test_lean_and_sweep_are_lengths_and_chord_is_a_factor(block):
    before, _, change = moved(block, LEAN, 0.02)
    assert change[:, 2] * before[:, 1] == pytest.approx(0.02, abs=1e-12)
    assert np.abs(change[:, 0]).max() < 1e-12
    _, _, change = moved(block, SWEEP, 0.02)
    assert change[:, 0] == pytest.approx(0.02, abs=1e-9)
    assert np.abs(change[:, 2]).max() < 1e-12
    before, after, _ = moved(block, CHORD, np.log(1.2))
    for column in (0, 2):
        assert np.ptp(after[:, column]) == pytest.approx(1.2 * np.ptp(before[:, column]))


def test_camber_bends_the_middle_by_its_part_of_the_chord_and_keeps_the_edges(block):
    before, after, _ = moved(block, CAMBER, 0.1)
    radius = before[:, 1].min()
    here = np.abs(before[:, 1] - radius) < 1e-9
    flat, bent = ((x[here, 0] / radius) + 1j * x[here, 2] for x in (before, after))
    # The block's edges are two opposite corners of its rectangle.
    away = np.abs(flat[:, None] - flat)
    ends = list(np.unravel_index(np.argmax(away), away.shape))
    first, last = sorted(flat[ends], key=np.real)
    place = ((flat - first) / (last - first)).real
    expected = 0.1 * 4.0 * place * (1.0 - place) * 1j * (last - first)
    assert np.abs(bent - flat - expected).max() < 1e-5
    assert np.abs(bent - flat)[ends].max() < 1e-5


def test_rounding_does_not_choose_one_of_the_diagonals_of_a_blunt_section():
    mesh = passage((4, 6, 8))
    results = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        points = mesh.points * (1.0 + 1e-14 * rng.normal(size=mesh.points.shape))
        field, at, triangles, before = laid_flat(mesh.with_points(points))
        results.append(moved((field, at, triangles, before), CAMBER, 0.1)[2])
    assert np.ptp(results, axis=0).max() < 1e-9
    # Camber bends both long sides alike: along theta, as the middle line.
    assert np.abs(results[0][:, 2]).max() > 0.01
    assert np.abs(results[0][:, 0]).max() < 1e-9


def test_what_has_no_sections_is_refused(block):
    field, points, _, _ = block
    level = np.abs(field.meridional(points)[:, 1] - 0.75) < 1e-9
    assert level.sum() > 3
    with pytest.raises(MeshError, match="has one span everywhere"):
        BladeSections(field, points[level], np.zeros((0, 3), int))
