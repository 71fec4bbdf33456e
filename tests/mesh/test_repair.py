"""Repair of folded cells: all types are mended, and everything else keeps its bits."""

import numpy as np
import pytest

from slideviz.mesh.jacobians import VALID
from slideviz.mesh.quality import quality
from slideviz.mesh.repair.freedom import Freedom
from slideviz.mesh.repair.repair import repair
from tests.builders import grid

SHAPES = [
    ((12, 12), "plain"),
    ((12, 12), "simplex"),
    ((12, 12), "mixed"),
    ((6, 6, 6), "plain"),
    ((5, 5, 5), "simplex"),
    ((5, 5, 5), "prism"),
    ((6, 5, 5), "mixed"),
]


def held_boundary(mesh):
    held = np.zeros(len(mesh.points), bool)
    for marker in mesh.markers:
        held[marker.nodes] = True
    return held


def scrambled(mesh, held, seed=1):
    rng = np.random.default_rng(seed)
    return mesh.with_points(np.where(held[:, None], mesh.points, rng.random(mesh.points.shape)))


@pytest.mark.parametrize(("shape", "kind"), SHAPES)
def test_scrambled_nodes_are_put_in_order(shape, kind):
    mesh = grid(shape, kind=kind)
    held = held_boundary(mesh)
    folded = scrambled(mesh, held)
    before = quality(folded, mesh)
    assert (before.status != VALID).mean() > 0.25
    result = repair(folded, Freedom.within(mesh.dim, held), mesh)
    after = quality(folded.with_points(result.points), mesh)
    assert (after.status == VALID).all()
    assert after.min >= 0.1
    assert not len(result.bad_after)
    assert np.array_equal(result.points[held], mesh.points[held])
