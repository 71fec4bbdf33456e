"""One step of a deformation with everything discrete kept, for any displacement.

The same mathematics as in `slideviz.rbf.methods` and `slideviz.solver.stepping`, on a tape;
without a variable it computes values only. Discrete choices are made when the step runs first, at
the reference design, and kept: rows of the systems, primitives that nodes are projected on,
nearest boundary nodes and radius of the correction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from dataclasses import field as made_by
from typing import Any

import numpy as np

from slideviz.baselines.elastic import Body
from slideviz.baselines.idw import Weights
from slideviz.design.frozen.baselines import Elasticity, Weighting
from slideviz.design.frozen.interpolation import Interpolation
from slideviz.design.frozen.loops import keep_undeformed, shift
from slideviz.design.frozen.method import Method
from slideviz.design.frozen.operations import coords as coords_of
from slideviz.design.frozen.operations import points
from slideviz.design.frozen.tape import Array, multiply, put, recorded, take, transform, value
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.rbf.problem import Levels
from slideviz.solver.setup import Setup
from slideviz.terms import Sliding


@dataclass(frozen=True, eq=False)
class StepState:
    """The state of a deformation after some steps."""

    coords: Array
    """(..., n, d): positions in the frame."""
    carried: Array | None = None
    """(..., b, d) or None: the errors that the interpolants of all steps so far left at the
    boundary nodes ``of`` (b,); None without data reduction."""
    of: IntArray = made_by(default_factory=lambda: np.empty(0, np.int64))
    max_error: FloatArray = made_by(default_factory=lambda: np.zeros(()))
    lost: FloatArray = made_by(default_factory=lambda: np.zeros(()))
    error_estimate: FloatArray = made_by(default_factory=lambda: np.zeros(()))
    """`max_error`, `lost`, `error_estimate` (...,): as of a ``Solution``."""
    points: Array = made_by(default_factory=lambda: np.empty((0, 0)))
    """(..., n, d): Cartesian positions; empty before the first step."""


@dataclass(frozen=True, eq=False)
class ChoiceCache:
    """A store of objects that are made once, by name."""

    items: dict[str, Any] = made_by(default_factory=dict)

    def __call__(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the object of this name; ``make`` makes it the first time."""
        if name not in self.items:
            self.items[name] = make()
        return self.items[name]


@dataclass(frozen=True, eq=False)
class FrozenStep:
    """One step with its choices."""

    setup: Setup
    mesh: Mesh
    """Undeformed."""
    sliding: Sliding
    part: float
    """Part of the whole displacement that is made after this step, up to 1."""
    first: bool
    """Whether positions are those of the undeformed mesh, the same for all designs."""
    stages: tuple[Levels, ...]
    """Rows of the systems."""
    dropped: IntArray
    """(m,): nodes that the pivot guard left out of the systems."""
    condition: float
    """Estimated condition number of the last system, at the reference."""
    refined: float = 0.0
    """Where systems are solved with twice the digits, as at the reference: the estimated error of
    ordinary solutions, as of a ``Solution``; else 0."""
    error_estimate: float = 0.0
    """As of a ``Solution``, at the reference."""
    weights: Weights | None = None
    """Settings of inverse distance weighting, if that is the method."""
    body: Body | None = None
    """The elastic body, if the method is linear elasticity."""
    reuse: bool = False
    """Whether a later step keeps the factors of the last positions that it began at."""
    choices: ChoiceCache = made_by(default_factory=ChoiceCache)
    constants: ChoiceCache = made_by(default_factory=ChoiceCache)
    """`choices`, `constants`: discrete choices; and, used in the first step only, what depends on
    positions only."""
    last: ChoiceCache = made_by(default_factory=ChoiceCache)
    """The last positions that a later step began at, and its factors there."""

    def factors(self, coords: FloatArray) -> ChoiceCache:
        """Return the store of the factors of systems at positions ``coords`` (n, d).

        An optimiser asks for points, ``jvp`` and ``vjp`` of one design: factors are most of the
        work of each.
        """
        if self.first:
            return self.constants
        at, kept = self.last.items.get("at", (None, ChoiceCache()))
        if at is None or not np.array_equal(at, coords):
            kept = ChoiceCache()
        if self.reuse:
            self.last.items["at"] = coords.copy(), kept
        return kept

    def run(self, before: StepState, target: Array) -> StepState:
        """Return the state after this step.

        Parameters
        ----------
        target : (..., a, d)
            The whole displacement of the known nodes, after the last step, in the frame.
        """
        state = self.moved(before, target)
        coords, at = self._with_points(state.coords)
        return replace(state, coords=coords, points=at)

    def moved(self, before: StepState, target: Array, out: FloatArray | None = None) -> StepState:
        """Return the state after this step, without points, and with copies in a halo not moved.

        Parameters
        ----------
        out : (..., n, d), optional
            Where the coordinates are written, if nothing is a variable.
        """
        setup = self.setup
        goal = _shifted(setup.coords[setup.known], multiply(target, np.array([[self.part]])))
        solved = self._method(self, before, goal, out).run()
        displacement = solved.displacement
        if len(setup.images):
            first, second = setup.images.T
            displacement = put(displacement, second, take(displacement, first), overwrite=True)
        on = np.flatnonzero(setup.axis)
        if len(on):
            held = np.ones(setup.coords.shape[1])
            held[:2] = 0.0
            still = multiply(take(displacement, on), held[None])
            displacement = put(displacement, on, still, overwrite=True)
        moved = _shifted(before.coords, displacement, overwrite=True)
        moved = put(moved, setup.known, goal, overwrite=True)
        return StepState(
            moved,
            solved.carried,
            solved.of,
            solved.max_error,
            solved.lost,
            error_estimate=solved.error_estimate,
        )

    @property
    def _method(self) -> type[Method]:
        """Return the class of the method."""
        if self.weights is not None:
            return Weighting
        return Interpolation if self.body is None else Elasticity

    def _with_points(self, moved: Array) -> tuple[Array, Array]:
        """Return coordinates and Cartesian points, with copies in a halo moved, too."""
        setup, frame = self.setup, self.setup.frame
        at = _at_rest(points(frame, moved), moved, setup.coords, self.mesh.points)
        halo = self.mesh.halo
        if halo is None:
            return moved, at
        rows = setup.copies
        donors, copies = halo.donors[rows], halo.receivers[rows]
        donor, start = self.mesh.points[donors], self.mesh.points[copies]
        follow = transform(halo.rotations[rows], take(at, donors) - donor)
        overwrite = at is not moved
        at = put(at, copies, _shifted(start, follow), overwrite=overwrite)
        return put(moved, copies, coords_of(frame, take(at, copies)), overwrite=overwrite), at


def _shifted(start: Array, by: Array, *, overwrite: bool = False) -> Array:
    """Return start + by, written to ``by`` with ``overwrite``; adding zero keeps every bit."""
    x, u = value(start), value(by)
    out = shift(x, u if overwrite else u.copy())
    return recorded(out, (start, lambda t: t, lambda g: g), (by, lambda t: t, lambda g: g))


def _at_rest(at: Array, moved: Array, start: FloatArray, before: FloatArray) -> Array:
    """Return points ``at``; those with coordinates ``moved`` as at the start become ``before``."""
    if at is moved:
        return at
    keep_undeformed(value(at), value(moved), start, before)
    return at
