"""A case that fits its mesh: names are resolved, and every check is done once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

from slideviz.case.check import check_case, motion_doubts
from slideviz.case.model import Case
from slideviz.case.moving_nodes import by_zone
from slideviz.case.zone_cases import with_marker_names, zone_cases
from slideviz.errors import CaseError, DeformError, Doubt, doubts_of, raise_all
from slideviz.mesh.model import Mesh


@dataclass(frozen=True, eq=False)
class Prepared:
    """A case, and the mesh that it fits."""

    case: Case  # with the names of the boundaries that the mesh has
    mesh: Mesh

    @cached_property
    def doubts(self) -> tuple[Doubt, ...]:
        """What hardly does what is meant."""
        return *doubts_of(self.case.warnings), *motion_doubts(self.case, self.mesh)

    @cached_property
    def alone(self) -> Case:
        """The case in which no motion joins several zones (`by_zone`)."""
        return by_zone(self.case, self.mesh)

    @cached_property
    def zones(self) -> tuple[Prepared, ...]:
        """Each zone with its case; of a mesh of one zone, that."""
        cases = zone_cases(self.alone, self.mesh)
        each = zip(cases, self.mesh.parts, strict=True)
        return tuple(Prepared(case, part.mesh) for case, part in each)


@contextmanager
def beginning_with(doubts: tuple[Doubt, ...]) -> Iterator[None]:
    """Context whose errors begin with some doubts, since these may be the cause."""
    try:
        yield
    except (CaseError, DeformError) as problem:
        problem.args = tuple(dict.fromkeys((*doubts, *problem.args)))
        raise


def prepare(case: Case, mesh: Mesh) -> Prepared:
    """Return a case with a mesh that it fits.

    Raises CaseError with a line for each problem where it does not fit.
    """
    case = with_marker_names(case, mesh)
    raise_all(check_case(case, mesh))
    return Prepared(case, mesh)
