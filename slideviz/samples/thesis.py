"""The thesis's cases on its structured grids, and what moves their block (chapter 4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, FromFile, Motion, Rotate, Translate
from slideviz.case.motion import displacement_of
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.samples.grid import grid_mesh, layout, polar_points, square_points
from slideviz.terms import Role

DIMENSIONS = {"square": 2, "polar": 2, "hexahedron": 3, "cylindrical": 3}
PERIODIC = ("LOWER", "UPPER")
SHIFT = (-0.2, -0.3, 0.2)
"""Of the block of square and cube, after its turn by 60 degrees about z (Figures 4.3, 4.15)."""
TRANSLATION = (-0.35, -0.43)
"""Of the block in the test of robustness, in five steps (Figure 4.4)."""
FILE = Path("displacement.txt")


def thesis_case(name: str, size: int, variant: str) -> tuple[Mesh, Case, Displacements | None]:
    """Return mesh, case and, unless ``variant`` is ``motion``, the displacement file's content.

    ``variant`` is one of ``samples.VARIANTS[name]``.

    Raises
    ------
    CaseError
        The size is below 3.
    """
    grid = layout(size, DIMENSIONS[name])
    polar = name in ("polar", "cylindrical")
    points = polar_points(grid) if polar else square_points(grid)
    mesh, nodes = grid_mesh(name, grid, points), grid.block_nodes()
    motions = _motions(grid.dim, variant)
    case = Case(
        roles=_roles(mesh),
        motions=motions if variant == "motion" else (FromFile(FILE),),
        sliding="ps",
        periodic="moving",
        periodic_type="rotational" if polar else "translational",
        steps=5 if variant == "translate" else 20,
    )
    if variant == "motion":
        return mesh, case, None
    block = mesh.points[nodes]
    vectors = _polar_shift(block) if polar else displacement_of(motions, block)
    return mesh, case, Displacements(nodes, vectors)


def _roles(mesh: Mesh) -> dict[str, Role]:
    """Return the roles of sliding sides with periodic displacement (Figures 4.6 and 4.17)."""
    roles: dict[str, Role] = dict.fromkeys(mesh.marker_names, "sliding")
    return roles | dict.fromkeys(PERIODIC, "periodic") | {"BLOCK": "moving"}


def _motions(dim: int, variant: str) -> tuple[Motion, ...]:
    """Return what moves the block of the square (dim 2) or the cube (dim 3)."""
    if variant == "translate":
        return (Translate("BLOCK", TRANSLATION),)
    shift = (*SHIFT[:2], 0.0) if variant == "flat" else SHIFT[:dim]
    return (Rotate("BLOCK", 60.0, (0.5,) * dim), Translate("BLOCK", shift))


def _polar_shift(points: FloatArray) -> FloatArray:
    """Return the displacement by 0.2 in r, -10 degrees and, in 3D, 0.2 in z: (k, d).

    A shift in r turns its direction with the angle, so no sequence of motions is the same.
    """
    x, y = points[:, :2].T
    radius, angle = np.hypot(x, y) + 0.2, np.arctan2(y, x) - np.radians(10.0)
    moved = [radius * np.cos(angle) - x, radius * np.sin(angle) - y]
    return np.column_stack([*moved, np.full((len(x), points.shape[1] - 2), 0.2)])
