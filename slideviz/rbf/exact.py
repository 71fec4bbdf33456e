"""The exact fit: every constraint is in the system (thesis sections 2.1 and 2.4)."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray
from slideviz.rbf.evaluate import matrix
from slideviz.rbf.problem import Cycle, Problem, Rows, Watch
from slideviz.rbf.solve import factorise


class ExactFit:
    """Solves ``G w = b`` with G_ab = phi_ab (n_a . n_b) anew whenever rows are added.

    Attributes
    ----------
    controls : (c,) int64
        The nodes that carry coefficients.
    weights : (c, d) float64
        Coefficients alpha of Eq. 2.6, ``sum_a w_a n_a`` over the constraints of each node.
    dropped : (m,) int64
        Nodes of which the pivot guard left out a constraint.
    """

    def __init__(self, problem: Problem, watch: Watch) -> None:
        self._problem, self._watch = problem, watch
        self._rows: Rows | None = None
        self.history: tuple[Cycle, ...] = ()
        self.controls: IntArray = np.empty(0, np.int64)
        self.weights: FloatArray = np.empty((0, problem.values.shape[1]))
        self.dropped: IntArray = np.empty(0, np.int64)

    def add(self, rows: Rows) -> None:
        """Solve with these rows and all before them."""
        if self._rows is not None:
            rows = Rows(
                np.concatenate([self._rows.nodes, rows.nodes]),
                None,
                np.concatenate([self._rows.right, rows.right]),
            )
        self._rows = rows
        problem = self._problem
        with self._watch.phase("solve") as tick:
            place = problem.features[:, rows.nodes], rows.normals
            factor = factorise(matrix(problem.basis, place, tick=tick), tick)
            weights = factor.solve(rows.right)
        self.dropped = np.unique(rows.nodes[factor.dropped])
        self.controls, self.weights = rows.nodes, weights
        if rows.normals is not None:
            self.controls, group = np.unique(rows.nodes, return_inverse=True)
            self.weights = np.zeros((len(self.controls), rows.normals.shape[1]))
            np.add.at(self.weights, group, weights * rows.normals)
