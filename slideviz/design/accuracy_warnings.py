"""Notes and warnings of a deformer about its accuracy."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from slideviz.case.words import counted, wrong_by
from slideviz.design.frozen.solve import REMEDY
from slideviz.design.frozen.step import FrozenStep
from slideviz.errors import ConditionWarning, Note, ToleranceWarning
from slideviz.mesh.model import FloatArray
from slideviz.rbf.refine import NOTED, TRUSTED

BADLY_CONDITIONED = 1e14
"""Above this condition number, the effect of moving a single node has few correct digits."""


def largest_condition(steps: Sequence[FrozenStep]) -> float:
    """Return the largest condition number of the steps' systems at the reference; or 1.0."""
    return max((step.condition for step in steps), default=1.0)


def note_of_refinement(steps: Sequence[FrozenStep]) -> tuple[str, ...]:
    """Return a note about systems that are solved with twice the digits; empty if none is."""
    refined = max((step.refined for step in steps), default=0.0)
    if not refined:
        return ()
    return (
        Note(
            f"the system is nearly singular (condition number {largest_condition(steps):.0e}): "
            f"between the boundary nodes designs would be wrong by up to {100 * refined:.2g} % "
            "of the largest displacement, so all are solved with twice the digits; a "
            "ConditionWarning names those for which that does not suffice"
        ),
    )


def warn_of_condition(steps: Sequence[FrozenStep]) -> None:
    """Warn where designs that are less smooth than the reference may have few digits."""
    worst = max((step.condition for step in steps if not step.refined), default=0.0)
    error_estimate = max((step.error_estimate for step in steps), default=0.0)
    if error_estimate > TRUSTED:
        worst = largest_condition(steps)
        amount = f"may be wrong by {wrong_by(error_estimate, bounded=False)}"
    elif worst > BADLY_CONDITIONED:  # that of a method without a system is NaN
        amount = "may have few correct digits"
    else:
        return
    said = (
        f"the condition number of the system is {worst:.0e}, so that derivatives by single "
        "nodes, and displacements between the boundary nodes where neighbours move very "
        f"differently, {amount}; {REMEDY}"
    )
    little = TRUSTED < error_estimate <= NOTED
    warnings.warn(Note(said) if little else said, ConditionWarning, stacklevel=3)


def warn_of_error_estimate(steps: Sequence[FrozenStep], error_estimate: FloatArray) -> bool:
    """Warn if the doubt (...,) of a design is above `TRUSTED`; return whether it is."""
    worst = float(error_estimate.max(initial=0.0))
    if worst <= TRUSTED:
        return False
    of = (
        ""
        if error_estimate.ndim == 0
        else f" of {counted(int((error_estimate > TRUSTED).sum()), 'design')}"
    )
    said = (
        f"the condition number of the system is {largest_condition(steps):.0e}: derivatives may "
        f"have few correct digits, and displacements{of} between the boundary nodes may be wrong "
        f"by {wrong_by(worst, bounded=all(step.refined for step in steps))}; {REMEDY}"
    )
    warnings.warn(said if worst > NOTED else Note(said), ConditionWarning, stacklevel=3)
    return True


def warn_of_errors(
    errors: FloatArray, allowed: FloatArray, reference: NDArray[np.bool_], *, reduced: bool
) -> None:
    """Warn where designs miss what they must do by more than is allowed.

    Parameters
    ----------
    errors, allowed : (...,)
    reference : (...,) bool
        Whether a design is one that all was chosen for.
    reduced
        Whether control nodes were chosen, beside the facets of sliding nodes.
    """
    above = errors > allowed
    if not above.any():
        return
    worst = np.unravel_index(int(np.argmax(errors - allowed)), errors.shape)
    chosen = "control nodes and facets" if reduced else "the facets that nodes slide on"
    of = "" if errors.ndim == 0 else f" of {counted(int(above.sum()), 'design')}"
    why = f": {chosen} are those of another displacement; renew them with `deformer = "
    why += "deformer.refresh(displacement)`"
    if reference[worst]:
        why = f", with {chosen} chosen for this displacement; use more STEPS, a less smooth "
        why += "RBF_KERNEL such as wendland-c0, or a smaller displacement"
    warnings.warn(
        f"the largest error{of} at the boundary is {errors[worst]:.3g}, above the tolerance of "
        f"{allowed[worst]:.3g}{why}",
        ToleranceWarning,
        stacklevel=3,
    )
