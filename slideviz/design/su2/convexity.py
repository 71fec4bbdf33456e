"""CONVEXITY_CHECK: a design is scaled back until no cell of the deformed mesh is inverted.

SU2's bisection, which is for quadrilaterals and FFD variables; here it is for all cells and all
variables that have values, and ends with the largest part of the design that it found to be valid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.variables import WITHOUT_VALUE, DesignVariable
from slideviz.errors import CaseError, DeformError
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import quality

Attempt = TypeVar("Attempt")


def scaled(config: Su2Config, part: float) -> Su2Config:
    """Return a configuration with ``part`` of its design."""
    variables = tuple(_scaled(variable, part) for variable in config.variables)
    return replace(config, variables=variables)


def _scaled(variable: DesignVariable, part: float) -> DesignVariable:
    # The value that moves nothing.
    neutral = 1.0 if variable.kind in ("SCALE", "SCALE_GRID") else 0.0
    return replace(variable, values=tuple(neutral + part * (v - neutral) for v in variable.values))


def convex_part(
    config: Su2Config,
    mesh: Mesh,
    attempt: Callable[[Su2Config], Attempt],
    deformed: Callable[[Attempt], Mesh],
) -> tuple[float, Attempt, Sequence[str]]:
    """Return the part of the design that CONVEXITY_CHECK leaves, its deformation, and warnings.

    Parameters
    ----------
    config : Su2Config
    mesh : Mesh
        The undeformed mesh.
    attempt, deformed : callable
        Deforms the mesh by a configuration; returns the mesh of what that returned.

    Raises
    ------
    CaseError, DeformError
        Not even the smallest part that is tried can be done.
    """
    if config.words["CONVEXITY_CHECK"].upper() != "YES":
        return 1.0, attempt(config), ()
    least, kind = quality(mesh).inverted, config.variables[0]
    impossible: list[CaseError | DeformError] = []

    def tried(config: Su2Config) -> tuple[Attempt | None, int]:
        try:
            found = attempt(config)
        except (CaseError, DeformError) as problem:  # a boundary goes through another one
            impossible.append(problem)
            return None, 1
        return found, max(0, quality(deformed(found), reference=mesh).inverted - least)

    full, first = tried(config)
    if full is not None and not first:
        return 1.0, full, ()
    if kind.group in WITHOUT_VALUE and full is not None:
        note = f"CONVEXITY_CHECK scales values, which {kind.kind} has none of: all of it is done"
        return 1.0, full, (note,)
    best: tuple[float, Attempt] | None = None
    part, step, depth, valid = 1.0, 1.0, 0, False
    for _ in range(_count(config, "ITER")):
        step /= 2.0
        part += step if valid else -step
        found, inverted = tried(scaled(config, part))
        valid = found is not None and not inverted
        if found is not None and valid:  # which is larger than the one before
            best, depth = (part, found), depth + 1
        if depth == _count(config, "DEPTH"):
            break
    note = f"CONVEXITY_CHECK: all of the design would invert {first} more cells"
    note = f"CONVEXITY_CHECK: {impossible[0]}" if full is None else note
    if best is None and full is None:
        raise impossible[0]
    if best is None:
        assert full is not None
        return 1.0, full, (f"{note}, and so does the smallest part that was tried, {part:g}",)
    return *best, (f"{note}; {best[0]:g} of it is done: its values times {best[0]:g}",)


def _count(config: Su2Config, name: str) -> int:
    return int(float(config.words[f"CONVEXITY_CHECK_{name}"]))
