"""Another processor rounds differently; it must not choose other control nodes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.model import Case
from slideviz.errors import point_words
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import write_sample
from tests.slow import one_of_each_fast


@pytest.mark.parametrize(
    ("sliding", "selection"), one_of_each_fast(["ps", "ds"], ["block", "one", "double"])
)
@pytest.mark.parametrize(
    ("name", "periodic"), [("polar", "periodic"), ("hexahedron", "moving"), ("cylindrical", "none")]
)
def test_rounding_changes_no_selection(tmp_path, name, periodic, sliding, selection):
    """Symmetric meshes have many candidates with the same error but for the last digits."""
    write_sample(name, tmp_path, 25 if name == "polar" else 9)
    mesh = sv.read(tmp_path / "mesh.su2")
    case = Case.read(tmp_path / f"{name}.cfg").change(
        sliding=sliding,
        periodic=periodic,
        steps=2,
        reduction=Reduction(tolerance=1e-4, selection=selection),
    )
    *_, exact = sv.deform(case, mesh)
    noise = np.random.default_rng(1)
    for _ in range(2):
        rounding = 1 + 1e-15 * noise.standard_normal(mesh.points.shape)
        *_, rounded = sv.deform(case, mesh.with_points(mesh.points * rounding))
        assert rounded.control_nodes == exact.control_nodes
        np.testing.assert_allclose(rounded.mesh.points, exact.mesh.points, atol=1e-10)


@given(
    st.floats(1e-6, 1e6),
    st.floats(1e-3, 1.0),
    st.floats(-1e-14, 1e-14),
    st.integers(0, 2),
)
def test_in_words_coordinates_are_rounded_to_the_size_of_the_mesh(extent, part, rounding, axis):
    """Where sin(pi) is meant, nobody wants to read 1.22e-16; a mesh may be tiny, though."""
    place = np.full(3, extent * rounding)
    assert point_words(place, extent) == "0, 0, 0"
    place[axis] = extent * part
    words = point_words(place, extent).split(", ")
    assert float(words[axis]) == pytest.approx(extent * part, rel=1e-5)
    assert words == point_words(place).split(", "), "the largest of them will do"
    assert sorted(words)[:2] == ["0", "0"]


def test_in_words_a_node_of_a_circle_is_where_it_is_meant():
    angles = np.pi * np.array([0.5, 1.0])
    (up, left) = 0.5 * np.column_stack([np.cos(angles), np.sin(angles)])
    assert point_words(up) == "0, 0.5"
    assert point_words(left, 1.0) == "-0.5, 0"
