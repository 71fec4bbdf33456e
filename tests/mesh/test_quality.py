"""Size-skew quality: against literal formulas, VTK, and the laws it must keep."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slideviz.errors import CaseError, MeshError
from slideviz.mesh.model import Cells, Mesh
from slideviz.mesh.quality import INVERTED, VALID, corner_jacobians, quality
from slideviz.system import threads
from tests.oracles import quality as oracle

TYPES = (5, 9, 10, 12, 13, 14)
SOLID = (10, 12, 13, 14)


def soup(vtk, cells):
    """Mesh of cells that share no node, from coordinates (m, n, d)."""
    cells = np.asarray(cells, float)
    m, n, d = cells.shape
    nodes = np.arange(m * n).reshape(m, n)
    return Mesh(cells.reshape(-1, d), Cells.from_blocks([(vtk, nodes)]), name="soup")


def one(vtk, points, reference=None, metric="knupp"):
    before = None if reference is None else soup(vtk, [reference])
    found = quality(soup(vtk, [points]), before, metric)
    return found.values[0], found.size[0], found.skew[0]


def shaken(vtk, m, amount, seed=0):
    rng = np.random.default_rng(seed)
    ideal = np.array(oracle.IDEAL[vtk])
    return ideal + rng.uniform(-amount, amount, (m, *ideal.shape))


def rotation(d, seed=3):
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(d, d)))
    turn[0] *= np.linalg.det(turn)
    return turn


def sheared_cube(angle_deg):
    cube = np.array(oracle.IDEAL[12], float)
    angle = np.radians(angle_deg)
    return cube @ [[1, 0, 0], [np.cos(angle), np.sin(angle), 0], [0, 0, 1]]


@pytest.mark.parametrize("metric", ["knupp", "rbf-slide"])
@pytest.mark.parametrize("vtk", TYPES)
def test_ideal_cells_have_quality_one(vtk, metric):
    found = quality(soup(vtk, [oracle.IDEAL[vtk]]), metric=metric)
    assert found.values[0] == pytest.approx(1, abs=1e-14)
    assert found.skew[0] == pytest.approx(1, abs=1e-14)
    assert found.size[0] == 1
    assert found.status[0] == VALID


@pytest.mark.parametrize("vtk", TYPES)
def test_rounding_lifts_no_ideal_cell_above_one(vtk):
    ideal = np.array(oracle.IDEAL[vtk], float)
    found = quality(soup(vtk, [ideal @ rotation(ideal.shape[1], seed) for seed in range(200)]))
    assert found.skew.max() == 1
    assert found.histogram()[0].sum() == 200


@pytest.mark.parametrize("metric", ["knupp", "rbf-slide"])
@pytest.mark.parametrize("vtk", TYPES)
def test_random_cells_agree_with_the_literal_formulas(vtk, metric):
    cells, before = shaken(vtk, 150, 0.3), shaken(vtk, 150, 0.1, seed=1)
    found = quality(soup(vtk, cells), soup(vtk, before), metric)
    expected = np.array(
        [oracle.size_skew(vtk, *pair, metric) for pair in zip(cells, before, strict=True)]
    )
    clear = (found.status == VALID) | (expected[:, 0] == 0)
    assert clear.sum() > 140
    assert (found.status == VALID).sum() > 50
    np.testing.assert_allclose(found.values[clear], expected[clear, 0], rtol=1e-12, atol=0)
    np.testing.assert_allclose(found.size[clear], expected[clear, 1], rtol=1e-12, atol=0)
    np.testing.assert_allclose(found.skew[clear], expected[clear, 2], rtol=1e-12, atol=0)


@pytest.mark.parametrize("vtk", TYPES)
def test_only_cells_with_positive_corners_have_a_value(vtk):
    cells = shaken(vtk, 200, 0.6)
    mesh, before = soup(vtk, cells), soup(vtk, np.repeat([oracle.IDEAL[vtk]], 200, axis=0))
    found = quality(mesh, before)
    bad = np.array([min(oracle.jacobians(vtk, points)) <= 0 for points in cells])
    assert 10 < bad.sum() < 190
    assert (found.status[bad] == INVERTED).all()
    assert (found.values[found.status != INVERTED] > 0).all()
    for array in (found.values, found.size, found.skew):
        assert (array[bad] == 0).all()
        assert ((array >= 0) & (array <= 1)).all()


@pytest.mark.parametrize("vtk", [5, 10])
def test_simplex_skew_is_the_shape_of_vtk(vtk):
    pv = pytest.importorskip("pyvista")
    mesh = soup(vtk, shaken(vtk, 200, 0.15, seed=2))
    found = quality(mesh)
    assert found.valid == 200
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dim)))
    grid = pv.UnstructuredGrid({vtk: mesh.cells.by_type[vtk][1]}, points)
    shape = grid.cell_quality("shape").cell_data["shape"]
    np.testing.assert_allclose(found.skew, shape, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("angle_deg", "knupp", "rbf_slide"),
    [(90, 1, 1), (45, 0.5 ** (1 / 3), 0.5**0.5), (30, 0.25 ** (1 / 3), 0.5)],
)
def test_sheared_hexahedron_tells_the_metrics_apart(angle_deg, knupp, rbf_slide):
    cell = sheared_cube(angle_deg)
    assert one(12, cell)[2] == pytest.approx(knupp, abs=1e-14)
    assert one(12, cell, metric="rbf-slide")[2] == pytest.approx(rbf_slide, abs=1e-14)


def test_sheared_hexahedron_has_the_published_digits():
    assert round(one(12, sheared_cube(45))[2], 4) == 0.7937
    assert round(one(12, sheared_cube(45), metric="rbf-slide")[2], 4) == 0.7071


@pytest.mark.parametrize("vtk", [5, 9, 10, 13, 14])
def test_metrics_differ_for_hexahedra_only(vtk):
    mesh = soup(vtk, shaken(vtk, 20, 0.1))
    np.testing.assert_array_equal(quality(mesh).values, quality(mesh, metric="rbf-slide").values)


@pytest.mark.parametrize("height", [1e-4, 0.3, 1.0, 50.0])
def test_right_prism_on_equal_sides_has_skew_one_at_any_height(height):
    cell = np.array(oracle.IDEAL[13]) * [1, 1, height]
    assert one(13, cell)[2] == pytest.approx(1, abs=1e-13)


@pytest.mark.parametrize("height", [0.25, 4.0])
def test_pyramid_skew_is_lower_for_another_height(height):
    assert one(14, np.array(oracle.IDEAL[14]) * [1, 1, height])[2] < 0.8


@pytest.mark.parametrize("vtk", TYPES)
def test_size_is_the_smaller_ratio_of_the_volumes(vtk):
    cell = np.array(oracle.IDEAL[vtk])
    d = cell.shape[1]
    value, size, skew = one(vtk, 2 * cell, cell)
    assert size == pytest.approx(2.0**-d, rel=1e-13)
    assert skew == pytest.approx(1, abs=1e-13)
    assert value == pytest.approx(2.0 ** (-d / 2), rel=1e-13)
    assert one(vtk, cell, 2 * cell)[1] == size


def test_size_takes_the_ratio_of_the_sums_not_the_sum_of_the_ratios():
    before = [(0, 0), (1, 0), (1, 1), (0, 1)]
    after = [(0, 0), (1, 0), (1.5, 1.5), (0, 1)]
    assert one(9, after, before)[1] == pytest.approx(1 / 1.5, rel=1e-14)


@pytest.mark.parametrize("vtk", TYPES)
def test_motion_and_scale_of_both_meshes_change_nothing(vtk):
    cells, before = shaken(vtk, 60, 0.25), shaken(vtk, 60, 0.05, seed=1)
    d = cells.shape[2]
    expected = quality(soup(vtk, cells), soup(vtk, before))
    assert expected.valid > 0
    for scale, shift in ((1.0, 3.0), (1e-3, 0.0), (1e4, -7.0)):
        turn = scale * rotation(d)
        found = quality(soup(vtk, cells @ turn + shift), soup(vtk, before @ turn + shift))
        np.testing.assert_allclose(found.values, expected.values, rtol=0, atol=1e-9)
        np.testing.assert_array_equal(found.status, expected.status)


@pytest.mark.parametrize("vtk", TYPES)
def test_renumbering_a_cell_changes_nothing(vtk):
    cells, before = shaken(vtk, 60, 0.25), shaken(vtk, 60, 0.05, seed=1)
    expected = quality(soup(vtk, cells), soup(vtk, before))
    for turn in (*oracle.TURNS[vtk], oracle.MIRRORS[vtk]):
        found = quality(soup(vtk, cells[:, turn]), soup(vtk, before[:, turn]))
        np.testing.assert_allclose(found.values, expected.values, rtol=1e-11, atol=0)
        np.testing.assert_array_equal(found.status, expected.status)


@pytest.mark.parametrize("vtk", TYPES)
def test_opposite_numbering_is_not_inversion(vtk):
    cells = shaken(vtk, 10, 0.05)
    cells[::2] = cells[::2][:, oracle.MIRRORS[vtk]]
    found = quality(soup(vtk, cells))
    assert found.valid == 10
    np.testing.assert_array_equal(found.signs, [-1, 1] * 5)


@pytest.mark.parametrize("vtk", TYPES)
def test_reference_tells_the_orientation(vtk):
    cell = np.array(oracle.IDEAL[vtk], float)
    mirrored = cell * ([-1] + [1] * (cell.shape[1] - 1))
    found = quality(soup(vtk, [mirrored, cell]), soup(vtk, [cell, cell]))
    np.testing.assert_array_equal(found.status, [INVERTED, VALID])
    np.testing.assert_array_equal(found.values, [0, found.values[1]])


@pytest.mark.parametrize("vtk", TYPES)
@pytest.mark.parametrize("kind", ["flat", "point"])
def test_cells_without_volume_are_inverted_without_warning(vtk, kind):
    cell = np.array(oracle.IDEAL[vtk], float)
    flat = cell * (0 if kind == "point" else [1] * (cell.shape[1] - 1) + [0])
    with np.errstate(all="raise"):
        for reference in (None, cell, flat):
            assert one(vtk, flat, reference) == (0, 0, 0)


@pytest.mark.parametrize("vtk", TYPES)
def test_size_is_zero_where_the_reference_has_no_volume(vtk):
    cell = np.array(oracle.IDEAL[vtk], float)
    value, size, skew = one(vtk, cell, 0 * cell)
    assert (value, size) == (0, 0)
    assert skew == pytest.approx(1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_cell_with_a_coordinate_that_is_no_number_is_inverted(bad):
    cells = np.repeat([oracle.IDEAL[12]], 2, axis=0).astype(float)
    moved = cells.copy()
    moved[1, 3, 1] = bad
    with np.errstate(invalid="ignore"):
        found = quality(soup(12, moved), soup(12, cells))
    np.testing.assert_array_equal(found.status, [VALID, INVERTED])
    np.testing.assert_array_equal(found.values, [1, 0])


@pytest.mark.parametrize("vtk", TYPES)
@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_values_lie_between_zero_and_one_for_any_coordinates(vtk, data):
    shape = (3, *np.shape(oracle.IDEAL[vtk]))
    numbers = st.floats(-1e30, 1e30, allow_subnormal=False)
    cells = data.draw(arrays(float, shape, elements=numbers))
    before = data.draw(arrays(float, shape, elements=numbers))
    found = quality(soup(vtk, cells), soup(vtk, before))
    for array in (found.values, found.size, found.skew):
        assert ((array >= 0) & (array <= 1)).all()
    assert found.valid + found.inverted + found.unproven == 3


def test_mixed_cells_keep_their_order():
    blocks = [(vtk, np.array(oracle.IDEAL[vtk], float)) for vtk in (14, 12, 10, 12, 13)]
    blocks[1] = (12, sheared_cube(45))
    points = np.concatenate(
        [points + np.array([3 * i, 0, 0]) for i, (_, points) in enumerate(blocks)]
    )
    first = np.cumsum([0] + [len(points) for _, points in blocks])
    cells = Cells.from_types([vtk for vtk, _ in blocks], np.arange(first[-1]))
    found = quality(Mesh(points, cells))
    np.testing.assert_allclose(found.values, [1, 0.5 ** (1 / 3), 1, 1, 1], atol=1e-14)


@pytest.mark.parametrize("vtk", [9, 12])
def test_chunk_size_does_not_matter(vtk, monkeypatch):
    mesh, before = soup(vtk, shaken(vtk, 50, 0.3)), soup(vtk, shaken(vtk, 50, 0.1, seed=1))
    whole = quality(mesh, before)
    for chunk in (1, 7, 49, 50):
        monkeypatch.setattr(threads, "PART", chunk)
        parts = quality(mesh, before)
        np.testing.assert_array_equal(parts.values, whole.values)
        np.testing.assert_array_equal(parts.status, whole.status)


def test_numbers_of_a_report():
    square = np.array(oracle.IDEAL[9], float)
    cells = [2 * square, square, square[[0, 2, 1, 3]], 2 * square, 3 * square]
    found = quality(soup(9, cells), soup(9, [square] * 5))
    np.testing.assert_allclose(found.values, [0.5, 1, 0, 0.5, 1 / 3])
    assert found.min == 0
    assert found.mean == pytest.approx(2.3333333333 / 5)
    assert (found.inverted, found.unproven, found.valid, len(found)) == (1, 0, 4, 5)
    np.testing.assert_array_equal(found.worst(4), [2, 4, 0, 3])
    np.testing.assert_array_equal(found.worst(99), [2, 4, 0, 3, 1])
    assert len(found.worst(0)) == 0
    assert len(found.worst(-1)) == 0
    counts, edges = found.histogram(4)
    np.testing.assert_array_equal(counts, [1, 1, 2, 1])
    np.testing.assert_array_equal(edges, [0, 0.25, 0.5, 0.75, 1])
    assert len(found.histogram()[0]) == 20
    assert found.summary() == {
        "min": 0.0,
        "mean": found.mean,
        "inverted": 1,
        "unproven": 0,
        "valid": 4,
        "cells": 5,
    }
    assert {type(value) for value in found.summary().values()} == {int, float}


def test_quality_cannot_be_changed():
    found = quality(soup(5, [oracle.IDEAL[5]]))
    for name in ("values", "size", "skew", "status", "signs"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(found, name)[0] = 0
    with pytest.raises(dataclasses.FrozenInstanceError, match="metric"):
        found.metric = "rbf-slide"


@pytest.mark.parametrize("vtk", TYPES)
def test_corner_jacobians_of_one_cell(vtk):
    cells = shaken(vtk, 4, 0.2)
    cells[2] = cells[2][list(oracle.MIRRORS[vtk])]
    mesh = soup(vtk, cells)
    for i, points in enumerate(cells):
        expected = oracle.jacobians(vtk, points)
        np.testing.assert_allclose(corner_jacobians(mesh, i), expected, rtol=1e-12)
        np.testing.assert_allclose(corner_jacobians(mesh, i, -1), np.negative(expected), rtol=1e-12)
    assert (corner_jacobians(mesh, 2, quality(mesh).signs[2]) > 0).all()


@pytest.mark.parametrize("cell", [-1, 1])
def test_corner_jacobians_need_a_cell_of_the_mesh(cell):
    with pytest.raises(MeshError, match=f"no cell {cell}; soup has the cells 0 to 0"):
        corner_jacobians(soup(5, [oracle.IDEAL[5]]), cell)


def test_mesh_without_cells_is_an_error():
    empty = Mesh(np.zeros((3, 2)), Cells.from_blocks([]), name="empty.su2")
    with pytest.raises(MeshError, match=r"empty\.su2 has no cells"):
        quality(empty)


def test_reference_must_have_the_same_cells():
    mesh, square = soup(9, [oracle.IDEAL[9]]), np.array(oracle.IDEAL[9])
    for other in (
        soup(9, [square, square]),
        Mesh(square, Cells.from_blocks([(9, [[1, 2, 3, 0]])]), name="soup"),
        Mesh(square, Cells.from_blocks([(5, [[0, 1, 2], [0, 2, 3]])]), name="soup"),
        Mesh(np.vstack((square, square)), mesh.cells, name="soup"),
    ):
        with pytest.raises(
            MeshError, match=r"soup .* cannot be the reference of soup .*same cells"
        ):
            quality(mesh, other)


def test_cells_must_have_the_dimension_of_the_mesh():
    flat = Mesh(np.eye(3), Cells.from_blocks([(5, [[0, 1, 2]])]), name="shell")
    with pytest.raises(MeshError, match=r"cell 0 of shell is a triangle .* dimension 3"):
        quality(flat)


@pytest.mark.parametrize("node", [-1, 3])
def test_nodes_must_be_in_range(node):
    mesh = Mesh(np.zeros((3, 2)), Cells.from_blocks([(5, [[0, 1, node]])]), name="torn")
    with pytest.raises(MeshError, match=f"torn has 3 points, but a cell has node {node} "):
        quality(mesh)


def test_metric_must_be_known():
    with pytest.raises(
        CaseError, match="quality metric 'shape' is unknown; use knupp or rbf-slide"
    ):
        quality(soup(5, [oracle.IDEAL[5]]), metric="shape")
