"""The safe fraction of a motion: how far one may go until the first cell folds."""

from __future__ import annotations

from slideviz.argument_types import check_types
from slideviz.case.model import Case
from slideviz.mesh.jacobians import check_cells
from slideviz.mesh.margin import SafeFraction, step_safety
from slideviz.mesh.model import Mesh, checked_reference
from slideviz.solver.deform import deform
from slideviz.solver.steps import safe_fraction_of


@check_types
def safe_fraction(deformed: Mesh | Case, reference: Mesh) -> SafeFraction:
    """Return how far a motion may go until the first cell is no longer proved valid.

    On the way from a mesh to a deformed one each node goes straight on; in a run, in each step. All
    cells are proved valid at each point of this way below the returned ``fraction``: 1 is the
    deformed mesh, and beyond it nodes go straight on, up to 10 times as far. For triangles,
    quadrilaterals, tetrahedra and pyramids the fraction is exact, for prisms and hexahedra at most
    0.2 % too small as a rule. The metric ``straight-margin`` has the number of each cell on
    straight lines between two meshes.

    Parameters
    ----------
    deformed : Mesh or Case
        The deformed mesh, or a case that is run. Each step of a run is a straight way, to its
        repaired mesh where REPAIR mends it; the fraction is of the whole motion, and beyond 1 the
        last step goes straight on. So it can differ from that of the run's deformed mesh.
    reference : Mesh
        The undeformed mesh.

    Raises
    ------
    MeshError
        The reference is another mesh, or has no cells or unusable ones.
    CaseError, DeformError
        As of `slideviz.deform`.

    Examples
    --------
    A triangle whose tip goes down by 40 % of its height folds at 2.5 times this motion:

    >>> import slideviz as sv
    >>> mesh = sv.Mesh([[0, 0], [1, 0], [0, 1]], sv.Cells.from_types([5], [0, 1, 2]))
    >>> moved = mesh.with_points([[0, 0], [1, 0], [0, 0.6]])
    >>> safe = sv.safe_fraction(moved, mesh)
    >>> round(safe.fraction, 6), safe.cell
    (2.5, 0)
    >>> safe.words
    'the motion could go 2.49 times as far, until cell 0 (triangle) at (0.3333, 0.3333) folds'
    """
    if isinstance(deformed, Case):
        found = safe_fraction_of(deform(deformed, reference, certify=True))
        assert found is not None
        return found
    check_cells(reference)
    return step_safety(reference, deformed, checked_reference(reference, deformed))
