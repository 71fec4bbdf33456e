"""The period of a mesh in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slideviz.case.motion_words import direction_words
from slideviz.mesh.periodic import Pair
from slideviz.session.state import Session


def period_text(pair: Pair) -> str:
    """Return the period of a pair in a few words: λ or θ, and along or about what."""
    if pair.kind == "rotational":
        return f"θ = {math.degrees(pair.period):.6g}° about {_axis(pair.axis)}"
    return f"λ = {pair.period:.6g} along {_axis((pair.vector / pair.period).tolist())}"


def _axis(direction: Sequence[float]) -> str:
    """Return an axis in words: which of its two ways it is told does not matter."""
    return direction_words(direction).removeprefix("-")


def found_text(session: Session) -> str:
    """Return the period of the periodic boundaries that matched, in words."""
    names = session.case.markers_with("periodic")
    lines = [
        f"Found: {pair.first} → {pair.second}, {period_text(pair)}"
        for pair in session.pairs
        if pair.first in names and pair.second in names
    ]
    paired = {
        end
        for p in session.pairs
        if {p.first, p.second} <= set(names)
        for end in (p.first, p.second)
    }
    alone = [name for name in names if name not in paired]
    if alone and len(names) >= 2 and session.mesh is not None:
        lines.append(f"No match found yet for {' and '.join(alone)}; the run will try.")
    return "\n".join(lines)
