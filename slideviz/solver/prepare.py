"""A case that fits its mesh: names are resolved, and every check is done once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property

from slideviz.argument_types import record
from slideviz.case.check import check_case, motion_doubts
from slideviz.case.model import Case
from slideviz.case.moving_nodes import by_zone
from slideviz.case.zone_cases import with_marker_names, zone_cases
from slideviz.errors import CaseError, DeformError, Doubt, doubts_of, raise_all
from slideviz.formats.files import read
from slideviz.mesh.model import Mesh, Skin
from slideviz.mesh.zones import zones_of

NOT_STREAMED = (
    "REFERENCE_FILENAME needs both meshes in memory and cannot be streamed; leave it out, or run "
    "without --stream"
)


@record
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
        return tuple(map(Prepared, cases, zones_of(self.mesh)))


@contextmanager
def beginning_with(doubts: tuple[Doubt, ...]) -> Iterator[None]:
    """Context whose errors begin with some doubts, since these may be the cause."""
    try:
        yield
    except (CaseError, DeformError) as problem:
        problem.args = tuple(dict.fromkeys((*doubts, *problem.args)))
        raise


def referenced(case: Case, mesh: Mesh) -> Mesh:
    """Return the mesh with the reference that a case names, unless it has one.

    Raises MeshError if that cannot be read, or has other cells.
    """
    if case.reference_file is None or mesh.reference is not None:
        return mesh
    if isinstance(mesh, Skin):
        raise CaseError(NOT_STREAMED)
    return mesh.with_reference(read(case.reference_file, zone=case.zone))


def prepare(case: Case, mesh: Mesh) -> Prepared:
    """Return a case with a mesh that it fits, which has the reference that the case names.

    Raises CaseError with a line for each problem where it does not fit, and MeshError if the
    reference cannot be read, or has other cells.
    """
    mesh = referenced(case, mesh)
    case = with_marker_names(case, mesh)
    raise_all(check_case(case, mesh))
    return Prepared(case, mesh)
