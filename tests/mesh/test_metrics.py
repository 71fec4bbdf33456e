"""Metrics: hand-computed grids, slow literal oracles, Verdict, laws, and OpenFOAM's checkMesh."""

from __future__ import annotations

import numpy as np
import pytest

import slideviz as sv
from slideviz.mesh.metrics import metric, metrics
from slideviz.terms import FARTHEST, METRICS
from tests.builders import grid

FREE = "straight-margin"


def test_the_unit_square_grid_has_the_numbers_that_one_counts():
    mesh = grid((4, 4))
    found = metrics(mesh, reference=mesh)
    assert found["orthogonality"].summary()["min"] == 90.0
    # Corners have two faces of half a cell and two markers of the same size; a node of a side has
    # a whole face inwards, halves along the side; inner nodes have whole faces only.
    ratio = found["area-ratio"].values.reshape(5, 5)
    assert ratio[0, 0] == ratio[-1, 0] == 1.0
    assert np.all(ratio[0, 1:-1] == 2.0)
    assert np.all(ratio[1:-1, 1:-1] == 1.0)
    assert found["volume-ratio"].max == 1.0
    for name, term in METRICS.items():
        if name not in ("area-ratio", "orthogonality", "smallest-angle", "largest-angle", FREE):
            ideal = 0.0 if term.best == "low" and term.range[0] == 0 else 1.0
            assert (found[name].min, found[name].max) == (ideal, ideal), name
    assert found["smallest-angle"].min == found["largest-angle"].max == 90.0
    assert found[FREE].min == FARTHEST


def test_an_unknown_metric_is_refused():
    with pytest.raises(sv.SlidevizError, match=r"'warpage' is not one of size-skew \| "):
        metric(grid((2, 2)), "warpage")
    found = metrics(grid((2, 2)), ["aspect_ratio", "Aspect-Ratio"])  # as in files, in any case
    assert list(found) == ["aspect_ratio", "Aspect-Ratio"]
    assert {one.metric for one in found.values()} == {"aspect-ratio"}
