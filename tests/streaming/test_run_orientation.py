"""How often surfaces wind around points."""

import numpy as np
import pytest

from slideviz.mesh.cached_boundary import boundary_of
from slideviz.solver.intersection import winding_number
from tests.builders import airfoil, annulus, cube, passage, sphere_in_box, square

MESHES = (square(), cube(4), cube(3, "mixed"), cube(3, "simplex"), passage(), sphere_in_box())


@pytest.mark.parametrize("mesh", [*MESHES, annulus(), airfoil()], ids=lambda mesh: mesh.name)
def test_it_is_1_in_every_cell_and_0_elsewhere(mesh):
    sums = np.add.reduceat(mesh.points[mesh.cells.connectivity], mesh.cells.offsets[:-1], axis=0)
    middles = sums / np.diff(mesh.cells.offsets)[:, None]
    facets = boundary_of(mesh).facets
    for middle in middles[::3]:
        assert winding_number(mesh.points, facets, middle) == pytest.approx(1.0, abs=1e-9)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    for outside in (low - 0.1, high + 0.3, 3 * low - 2 * high):
        assert winding_number(mesh.points, facets, outside) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("mesh", [square(), cube(6)], ids=lambda mesh: mesh.name)
def test_it_is_0_in_a_body(mesh):
    centre = mesh.points[mesh.marker("BLOCK").nodes].mean(axis=0)
    assert winding_number(mesh.points, boundary_of(mesh).facets, centre) == pytest.approx(0.0)
