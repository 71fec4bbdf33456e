"""Neighbouring passages: copies of a periodic mesh, shifted or turned by whole periods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Literal

import numpy as np

from slideviz.case.model import Case
from slideviz.case.spans import periodic_pairs
from slideviz.errors import CaseError, SlidevizError
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair, agree, find_pairs
from slideviz.sections.cut import Cutter, transformed
from slideviz.sections.model import Section
from slideviz.sections.polygons import CellsInRange, Polygons
from slideviz.session.opening import guess_by_name
from slideviz.session.state import Session
from slideviz.system.weak_cache import WeakCache

_SAME = 1e-9
"""A section is taken onto itself where it moves by less than this, over its size or distance."""

UNENDING = 2
"""Neighbours drawn on each side if all are wanted of a translational period, which is endless."""


def find_period(
    mesh: Mesh, case: Case | None = None, pairs: Sequence[Pair] | None = None
) -> Pair | None:
    """Return the pair of boundaries whose transformation repeats the mesh, or None.

    None also where zones have different periods; see `find_periods`.
    """
    periods = find_periods(mesh, case, pairs)
    named = case is not None and case.markers_with("periodic")
    if not periods or (not named and len(periods) < len(mesh.parts)):
        return None
    return periods[0] if all(agree(periods[0], one) for one in periods) else None


def find_periods(
    mesh: Mesh, case: Case | None = None, pairs: Sequence[Pair] | None = None
) -> tuple[Pair, ...]:
    """Return for each zone of a mesh the pair of boundaries whose transformation repeats it.

    Of a case with periodic boundaries it is their first pair. Otherwise it is guessed among the
    boundaries that match (``pairs``, if known already): those with names that hint at periodicity
    come first, then rotations; the ends of every straight duct match, too. Zones without a pair
    have none. Raises MeshError if the periodic boundaries of the case do not match.
    """

    def rank(pair: Pair) -> tuple[int, bool]:
        guesses = [guess_by_name(name) for name in (pair.first, pair.second)]
        named = sum(guess is not None and guess.role == "periodic" for guess in guesses)
        return -named, pair.kind != "rotational"

    every: Sequence[Pair] = periodic_pairs(case, mesh) if case is not None else ()
    every = every or sorted(find_pairs(mesh) if pairs is None else pairs, key=rank)
    zones = [mesh.marker_names[part.markers] for part in mesh.parts]
    first = [next((pair for pair in every if pair.first in names), None) for names in zones]
    return tuple(pair for pair in first if pair is not None)


def passages(pair: Pair, count: int | Literal["wheel"]) -> dict[int, FloatArray]:
    """Return the transformation (4, 4) of each passage by its number; 0 is the mesh itself.

    ``count``: neighbours on each side, or all around; on a wheel each passage is there once at
    most. Raises CaseError if it is negative, or copies do not close a wheel.
    """
    around = pair.around
    if count == "wheel" and around is None:
        raise CaseError(
            f"{pair.first!r} and {pair.second!r} repeat by {pair.describe()}, so copies do not "
            "close a wheel; give the number of neighbours on each side"
        )
    if count != "wheel" and count < 0:
        raise CaseError(f"{count} neighbouring passages; give 0 or more")
    if around is not None and (count == "wheel" or 2 * count + 1 > around):
        numbers = range(-((around - 1) // 2), around // 2 + 1)
    else:
        numbers = range(-int(count), int(count) + 1)
    return {number: pair.matrix(number) for number in numbers}


def keeps(section: Section, matrix: FloatArray) -> bool:
    """Return whether a transformation (4, 4) takes a section onto itself."""
    axis = section.basis[2]
    origin = np.asarray(section.origin)
    turned = matrix[:3, :3] @ axis
    step = transformed(origin[None], matrix)[0] - origin
    off = section.keeps(turned, step)
    size = max(section.radius, float(np.linalg.norm(origin)), float(np.linalg.norm(step)))
    return bool(np.linalg.norm(np.cross(turned, axis)) <= _SAME and off <= _SAME * size)


def show_passages(
    cutter: Cutter,
    points: FloatArray,
    section: Section,
    matrices: Mapping[int, FloatArray],
    only: CellsInRange | None = None,
) -> dict[int, Polygons]:
    """Return the cut of a section through each passage (see `Cutter.show`), by number.

    Passages whose transformation takes the section onto itself share one cut, transformed.
    """
    base: Polygons | None = None
    cuts = {}
    for number, matrix in matrices.items():
        if keeps(section, matrix):
            base = cutter.show(points, section, only) if base is None else base
            cuts[number] = base.with_points(transformed(base.points, matrix))
        else:
            cuts[number] = cutter.show(transformed(points, matrix), section, only)
    return cuts


_PERIODS = WeakCache()


def period_of(session: Session) -> Pair | None:
    """Return the pair of boundaries whose period repeats a session's mesh; None without a match.

    None also where zones have different periods.
    """
    return _periods(session)[0]


def periods_of(session: Session) -> tuple[Pair, ...]:
    """Return the pair whose period repeats a session's mesh; those of zones where they differ."""
    return _periods(session)[1]


def _periods(session: Session) -> tuple[Pair | None, tuple[Pair, ...]]:
    case = session.case
    mesh = session.mesh
    pairs = session.pairs
    if mesh is None:
        return None, ()

    def find() -> tuple[Pair | None, tuple[Pair, ...]]:
        with suppress(SlidevizError):  # do not match: said beside the Run button
            pair = find_period(mesh, case, pairs)
            return pair, find_periods(mesh, case, pairs) if pair is None else (pair,)
        return None, ()

    names = case.markers_with("periodic")
    key = pairs, names, case.periodic_type, case.axis, case.origin
    return _PERIODS.of(mesh, key, find)


def matrices(session: Session, pair: Pair | None) -> dict[int, FloatArray]:
    """Return the transformation (4, 4) of each neighbouring passage shown, by its number.

    The number is the power of the period; 0, the mesh itself, is left out.
    """
    count = session.view.passages
    if pair is None or count == 0:
        return {}
    is_wheel = pair.around is not None
    if count < 0 and not is_wheel:
        count = UNENDING
    by_number = passages(pair, "wheel" if count < 0 else count)
    return {number: matrix for number, matrix in by_number.items() if number != 0}
