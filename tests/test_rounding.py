"""Another processor rounds differently; it must not choose other control nodes."""

from __future__ import annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.model import Case
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
