"""The table of walls: the layers at each boundary before and after a step."""

from __future__ import annotations

from typing import NamedTuple

from slideviz.case.model import Case
from slideviz.session.state import Session, StepFrame
from slideviz.terms import Texts

COLUMNS = ("Boundary", "First height", "Growth", "Equal", "Angle")
"""Titles of the columns in the window; each number is the worst of its boundary."""
TIPS = (
    "Boundaries that are neither periodic nor internal; those with layers of flat cells first.",
    "Lowest distance of the first nodes from the boundary; below it, after over before.",
    "Largest ratio of two successive edges through the layers; these need at most 1.25.",
    "Fewest first edges that are equal within 1 %; boundary layers need two.",
    "Lowest angle of the first edges to the boundary, 90° is best; below it, the largest change.",
)
"""What each column has."""
_NUMBERS = (
    ("first_height", "min", ".4g"),
    ("growth", "max", ".3f"),
    ("equal_layers", "min", ".0f"),
    ("angle", "min", ".1f°"),
)
"""The number of each column after the first, the end of it that is worst, and its format."""


class WallRow(NamedTuple):
    """A boundary in the table, with texts for each column after the first."""

    name: str
    layered: bool  # whether most of its facets have flat cells
    before: Texts
    after: Texts
    change: Texts
    """`before`, `after`, `change`: of the undeformed mesh, the step that is shown, and both."""
    tip: str  # smallest, mean and largest of each number


def _entries(session: Session) -> dict[str, dict]:
    """Return the entries of the report for the frame shown, those with layers first."""
    frame = session.frame
    if frame is None or frame.walls is None:
        return {}
    entries = frame.walls.of(session.case.walls(frame.mesh.marker_names)).summary()
    return dict(sorted(entries.items(), key=lambda item: not item[1]["layered"]))


def wall_rows(session: Session) -> list[WallRow]:
    """Return the rows of the table for the frame shown; none where its walls are not known."""
    rows = []
    for name, entry in _entries(session).items():
        before = tuple(_text(entry[name]["before"][end], form) for name, end, form in _NUMBERS)
        after = tuple(_text(entry[name]["after"][end], form) for name, end, form in _NUMBERS)
        ratio = entry["first_height"]["ratio"]
        turned = entry["angle"]["change"]["max"]
        ends = " to ".join(dict.fromkeys(_text(ratio[end], ".3f") for end in ("min", "max")))
        change = (ends, "", "", _text(turned, ".1f°"))
        rows.append(WallRow(name, entry["layered"], before, after, change, _tip(entry)))
    return rows


def _text(value: float | None, form: str) -> str:
    unit = "°" if form.endswith("°") else ""
    return "–" if value is None else format(value, form.removesuffix(unit)) + unit


def _tip(entry: dict) -> str:
    """Return lines with smallest, mean and largest of each number of a boundary."""
    lines = []
    for state in ("before", "after"):
        for (number, _, _), title in zip(_NUMBERS, COLUMNS[1:], strict=True):
            ends = entry[number][state]
            if ends["min"] is not None:
                numbers = ", ".join(f"{name} {ends[name]:.6g}" for name in ("min", "mean", "max"))
                lines.append(f"{title} {state}: {numbers}")
    return "\n".join(lines)


def height_ratios(frame: StepFrame | None, case: Case) -> tuple[float, float] | tuple[None, None]:
    """Return lowest and highest ratio of first heights, after a step over before.

    Of moving and fixed boundaries with layers, or of sliding ones if there are only these;
    (None, None) where there are none.
    """
    ends = [entry["first_height"]["ratio"] for entry in _layered(frame, case)]
    lows = [end["min"] for end in ends if end["min"] is not None]
    highs = [end["max"] for end in ends if end["max"] is not None]
    return (min(lows), max(highs)) if lows else (None, None)


def angle_change(frame: StepFrame | None, case: Case) -> float | None:
    """Return the largest change of a first edge's angle in degrees, as `height_ratios`."""
    ends = (entry["angle"]["change"]["max"] for entry in _layered(frame, case))
    return max((end for end in ends if end is not None), default=None)


def heights_words(frame: StepFrame | None, case: Case) -> str:
    """Return the ratios of first heights in words: "0.892 to 1.194"; "" where there are none."""
    low, high = height_ratios(frame, case)
    return "" if low is None else f"{low:.3f} to {high:.3f}"


def _layered(frame: StepFrame | None, case: Case) -> list[dict]:
    if frame is None or frame.walls is None:
        return []
    layered = frame.walls.layered
    names = [name for name in case.walls(frame.mesh.marker_names) if name in layered]
    # Flat cells at inflow and outflow are not boundary layers; LAYERS leaves them alone.
    names = [name for name in names if case.roles.get(name) != "sliding"] or names
    return list(frame.walls.of(names).summary().values())


def table_rows(session: Session) -> list[list[object]]:
    """Return a row of titles as ``growth.before.max``, and one of numbers for each boundary."""
    flat = {name: _flat(entry) for name, entry in _entries(session).items()}
    titles = list(next(iter(flat.values()), {}))
    return [["boundary", *titles], *([name, *row.values()] for name, row in flat.items())]


def _flat(entry: dict, prefix: str = "") -> dict[str, object]:
    """Return the entry of a boundary as one row: names of nested values with dots."""
    row: dict[str, object] = {}
    for name, value in entry.items():
        key = prefix + name
        row |= _flat(value, f"{key}.") if isinstance(value, dict) else {key: value}
    return row
