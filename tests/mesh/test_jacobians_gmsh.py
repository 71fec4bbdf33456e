"""Valid and inverted cells, and repaired ones, by Gmsh's Jacobians, where it is installed."""

import numpy as np
import pytest

from slideviz.mesh.jacobians import INVERTED, UNPROVEN, VALID
from slideviz.mesh.orientation import reference_of
from slideviz.mesh.quality import quality
from slideviz.mesh.repair.freedom import Freedom
from slideviz.mesh.repair.repair import repair_mesh
from tests.builders import grid
from tests.mesh.test_margin import random_cells
from tests.mesh.test_repair import SHAPES, held_boundary, scrambled
from tests.oracles import quality as oracle
from tests.oracles.gmsh_jacobians import smallest_jacobians

gmsh = pytest.importorskip("gmsh")


@pytest.mark.parametrize("vtk", oracle.IDEAL)
def test_random_cells_are_valid_where_gmsh_says_so(vtk):
    rng, size = np.random.default_rng(vtk), len(oracle.IDEAL[vtk])
    mesh = random_cells(vtk, 2000)[0]
    shaken = rng.uniform(-1, 1, mesh.points.shape) * rng.uniform(0, 1, 2000).repeat(size)[:, None]
    moved = mesh.with_points(mesh.points + shaken)
    status = quality(moved, mesh).status
    theirs = smallest_jacobians(gmsh, moved)
    assert (status == VALID).mean() > 0.05
    assert (status == INVERTED).mean() > 0.05
    assert (status == UNPROVEN).mean() < 0.01
    assert (theirs[status == VALID] > 0).all()
    # A hexahedron or prism may have a negative Jacobian so near to zero that neither tells.
    assert (theirs[status == INVERTED] <= 1e-12).all()


@pytest.mark.parametrize(("shape", "kind"), SHAPES)
def test_repaired_cells_are_valid_for_gmsh(shape, kind):
    mesh = grid(shape, kind=kind)
    held = held_boundary(mesh)
    folded = scrambled(mesh, held)
    signs = reference_of(mesh)[1]
    before = signs * smallest_jacobians(gmsh, folded)
    assert ((before > 0) == (quality(folded, mesh).status == VALID)).mean() > 0.99
    result = repair_mesh(folded, Freedom.within(mesh.dim, held), mesh)
    theirs = signs * smallest_jacobians(gmsh, folded.with_points(result.points))
    assert (theirs > 0).all()
