"""Numbers of motions as design variables, as of curves over span, with exact derivatives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slideviz.argument_types import check_types
from slideviz.case.model import Case
from slideviz.case.motions.kinds import FAMILIES
from slideviz.case.moving_nodes import displacements
from slideviz.design.sweeps.table import numbers_of
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray, IntArray, Mesh


class SpanVariables:
    """The numbers of all motions of a case that have derivatives, as design variables.

    These are the values at the points of all `SpanMotion` curves.

    `displacement` is what a `Deformer` of the same mesh and case takes, and `vjp` continues what
    its ``vjp`` returns, so that an optimiser has the gradient by the variables.

    Attributes
    ----------
    names : tuple of str
        A name for each variable, as of a column of `slideviz.sweep`: ``BLADE.twist.0.5``.
    values : (k,) float64
        The values of the case.
    nodes : (m,) int64
        The nodes of the moving markers, ascending; those of a `Deformer`.

    Notes
    -----
    Derivatives are exact where curves over span are smooth: not where two slopes in turn change
    their sign. Other motions keep their values.

    Examples
    --------
    >>> import numpy as np
    >>> import slideviz as sv
    >>> from slideviz.samples.table import sample
    >>> row = sample("impeller", 3000)
    >>> design = sv.SpanVariables(row.mesh, row.case)
    >>> design.names
    ('BLADE.twist.0', 'BLADE.twist.0.5', 'BLADE.twist.1', 'BLADE.lean.0', 'BLADE.lean.1')
    >>> moved = design.displacement(2.0 * design.values)
    >>> gradient = design.vjp(2.0 * design.values, np.ones_like(moved))
    >>> gradient.shape
    (5,)
    """

    @check_types
    def __init__(self, mesh: Mesh, case: Case) -> None:
        """Find the variables.

        Raises
        ------
        CaseError
            The case has no motion with derivatives, or a rotation, scale or push after one; or it
            does not fit the mesh.
        """
        known = [k for k, motion in enumerate(case.motions) if motion.has_derivatives]
        if not known:
            raise CaseError("the case has no motion with derivatives; add one, as SpanMotion(...)")
        _require_last(case, known[0])
        moved = displacements(case, mesh)
        self.mesh = mesh
        self.case = case
        self.nodes = moved.nodes
        self._at = {name: at for name, at in numbers_of(case).items() if at.motion in known}
        self.names = tuple(self._at)
        self.values = np.array([at.of(case) for at in self._at.values()])

    @check_types
    def case_of(self, values: FloatArray) -> Case:
        """Return the case with other values (k,) of the variables."""
        given = self._checked("values", values)
        motions = list(self.case.motions)
        for at, value in zip(self._at.values(), given.tolist(), strict=True):
            at.put(motions, value)
        return self.case.change(motions=tuple(motions))

    @check_types
    def displacement(self, values: FloatArray) -> FloatArray:
        """Return the displacement (m, d) of the moving nodes for values (k,) of the variables."""
        return displacements(self.case_of(values), self.mesh).vectors

    @check_types
    def jvp(self, values: FloatArray, direction: FloatArray) -> FloatArray:
        """Return the derivative (m, d) of the displacement at ``values`` in a direction (k,)."""
        out = np.zeros((len(self.nodes), self.mesh.dim))
        change = self._checked("direction", direction)
        for rows, columns, by_number, slope in self._slopes(values):
            out[rows] += by_number * (slope @ change[columns])[:, None]
        return out

    @check_types
    def vjp(self, values: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the gradient (k,) of ``(weights * displacement).sum()``; weights (m, d)."""
        out = np.zeros(len(self.values))
        shape = len(self.nodes), self.mesh.dim
        adjoint = np.asarray(weights, np.float64)
        if adjoint.shape != shape:
            raise CaseError(
                f"weights has the shape {adjoint.shape}; expected {shape}, a row for each node of "
                "`nodes`"
            )
        for rows, columns, by_number, slope in self._slopes(values):
            out[columns] += np.sum(adjoint[rows] * by_number, axis=1) @ slope
        return out

    def _checked(self, name: str, values: FloatArray) -> FloatArray:
        """Return numbers (k,) for the variables, or raise CaseError."""
        given = np.asarray(values, np.float64)
        if given.shape != self.values.shape:
            raise CaseError(
                f"{name} has the shape {given.shape}; expected {self.values.shape}: a number each "
                f"for {', '.join(self.names)}"
            )
        finite = np.isfinite(given)
        if not finite.all():
            at = int(np.argmin(finite))
            raise CaseError(f"{name}: {self.names[at]} is {given[at]:g}; expected a finite number")
        return given

    def _slopes(
        self, values: FloatArray
    ) -> Iterator[tuple[IntArray, list[int], FloatArray, FloatArray]]:
        """Yield for each motion its rows of nodes, its variables, and `Motion.derivatives`."""
        case = self.case_of(values)
        on = {name: self.mesh.marker(name).nodes for name in case.markers_with("moving")}
        for family in FAMILIES:
            for place, nodes, by_number, slope in family.derivatives(case, self.mesh, on):
                columns = [k for k, at in enumerate(self._at.values()) if at.motion == place]
                yield np.searchsorted(self.nodes, nodes), columns, by_number, slope


def _require_last(case: Case, first: int) -> None:
    """Raise CaseError if a motion of moved places follows ``first``, which has derivatives."""
    for place, motion in enumerate(case.motions[first:], start=first + 1):
        if motion.depends_on_place:
            raise CaseError(
                f"motion {place} turns or scales nodes that motion {first + 1} has moved, which "
                "has no derivatives; put it before that motion"
            )
