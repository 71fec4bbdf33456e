"""Facets of a comparison's plots: axes, each with some of the rows as lines.

Where both methods and periodic modes vary, each method has a facet and each mode a line, as in
the thesis (Figures 5.5, 5.7, 5.8), or the other way round where there are fewer modes; otherwise
there is one facet with a line for each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from slideviz.case.model import Case
from slideviz.errors import CaseError, MeshError
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import pair_up
from slideviz.plots.spanwise import Profile, along, along_radius
from slideviz.study.combinations import COMPARED_METHODS, MODES, CombinationRow, Result

Span = Literal["r", "x", "y", "z"]


@dataclass(frozen=True, eq=False)
class FacetLine:
    """A line in a facet: its name, its number ``series`` (which sets its look), and its row."""

    label: str
    series: int
    row: CombinationRow


@dataclass(frozen=True, eq=False)
class Facet:
    """Lines that are drawn in one plot; ``title`` is empty where there is one facet only."""

    title: str
    lines: tuple[FacetLine, ...]


def facets(rows: Sequence[CombinationRow]) -> tuple[Facet, ...]:
    """Return facets of the rows that have a result; lines of one name look alike in all facets."""
    asked = [list(dict.fromkeys(_titles(row)[axis] for row in rows)) for axis in (0, 1)]
    done = [row for row in rows if row.result is not None]
    methods, modes = (len({_titles(row)[axis] for row in done}) for axis in (0, 1))
    # 0: each method is a line, each mode a facet; 1: the other way round.
    lined = 0 if modes == 1 or modes < methods else 1
    other = 1 - lined
    found: dict[str, list[FacetLine]] = {title: [] for title in asked[other]}
    for row in done:
        titles = _titles(row)
        line = FacetLine(titles[lined], asked[lined].index(titles[lined]), row)
        found[titles[other]].append(line)
    several = len(found) > 1
    made = [Facet(title if several else "", tuple(lines)) for title, lines in found.items()]
    return tuple(facet for facet in made if facet.lines)


def _titles(row: CombinationRow) -> tuple[str, str]:
    """Return the names of method and mode of a row."""
    return COMPARED_METHODS[row.combination.method][0], MODES[row.combination.periodic]


Profiler = Callable[[FacetLine], Profile]
"""Returns the profile of a line's quality along the span."""


def result_of(line: FacetLine) -> Result:
    """Return the result of a line; lines always have one."""
    assert line.row.result is not None
    return line.row.result


def profiler(case: Case, mesh: Mesh, span: Span | None = None) -> Profiler | None:
    """Return the function that makes profiles along the span; None without a span.

    Parameters
    ----------
    case : Case
    mesh : Mesh
        The undeformed mesh. Cells are assigned to places along the span by it, so that a layer of
        cells stays together when it bends.
    span : {"r", "x", "y", "z"}, optional
        When left out: the radius of a 3D mesh that repeats by rotation, z of another 3D mesh,
        no span for a 2D mesh.
    """
    axis, origin, turns = case.axis, case.origin, False
    names = case.markers_with("periodic")
    if names and span in (None, "r"):
        try:
            first = pair_up(mesh, names, case.periodic_type, case.axis, case.origin)[0]
            turns = first.kind == "rotational"
            axis, origin = (first.axis, first.origin) if turns else (axis, origin)
        except (MeshError, CaseError):
            pass  # the rows say it
    if span is None and mesh.dim == 2:
        return None
    where = span or ("r" if turns else "z")

    def profile(line: FacetLine) -> Profile:
        values = result_of(line).quality.values
        if where == "r":
            made = along_radius(mesh, values, axis, origin, label=line.label)
        else:
            made = along(mesh, values, where, label=line.label)
        return replace(made, series=line.series)

    return profile
