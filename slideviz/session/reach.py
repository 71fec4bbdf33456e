"""How far a motion goes: scaled, compared with another, and how far it may go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from slideviz.argument_types import record
from slideviz.case.motions.motion import Motion
from slideviz.mesh.margin import SafeFraction, reach_words
from slideviz.mesh.model import FloatArray
from slideviz.mesh.quality import quality
from slideviz.session.state import Run, Session, StepFrame, result_settings
from slideviz.system.weak_cache import WeakCache

DIGITS = 10  # significant digits of a scaled value


def can_scale(motions: Sequence[Motion]) -> bool:
    """Return whether motions can be scaled: displacements in files cannot."""
    return not any(motion.lists_nodes for motion in motions)


def scaled(motions: Sequence[Motion], part: float) -> tuple[Motion, ...] | None:
    """Return motions that go ``part`` times as far; None where not all can (`can_scale`)."""
    if not can_scale(motions):
        return None
    changed = ({k: _times(v, part, rest) for k, v, rest in motion.amounts()} for motion in motions)
    return tuple(replace(motion, **new) for motion, new in zip(motions, changed, strict=True))


def moves_nothing(motion: Motion) -> bool:
    """Return whether a motion leaves its boundary in place; False for displacement files."""
    far = [one for _, value, rest in motion.amounts() for one in _list(value, rest)]
    return bool(far) and not any(far)


def factor_of(motions: Sequence[Motion], others: Sequence[Motion]) -> float | None:
    """Return the common scale factor of two motion lists; None if they differ in more."""
    at_rest = scaled(motions, 0.0)
    if at_rest is None or at_rest != scaled(others, 0.0):
        return None
    now = _amounts(motions)
    before = _amounts(others)
    if now.shape != before.shape or not before.any():
        return None
    factor = float(now @ before / (before @ before))
    alike = np.abs(now - factor * before).max() <= 1e-6 * np.abs(now).max()
    return factor if alike and factor > 0 else None


def _amounts(motions: Sequence[Motion]) -> FloatArray:
    amounts = [amount for motion in motions for amount in motion.amounts()]
    return np.array([number for _, value, rest in amounts for number in _list(value, rest)])


def _list(value: Any, rest: float) -> list[float]:
    return [one - rest for one in (value if isinstance(value, tuple) else (value,))]


def _times(value: Any, part: float, rest: float) -> Any:
    found = tuple(float(f"{rest + part * one:.{DIGITS}g}") for one in _list(value, rest))
    return found if isinstance(value, tuple) else found[0]


SAMPLES = 17  # fractions at which the curve is computed, besides steps
FARTHEST_SHOWN = 3.0  # largest fraction of the curve


@record
class Reach:
    """The lowest quality of a run along its steps, and straight on."""

    fractions: FloatArray  # (k,): of the motion, ascending
    lowest: FloatArray  # (k,): 0 where a cell is inverted
    safe: SafeFraction


_REACHES = WeakCache()


def reach_run(session: Session) -> Run | None:
    """Return the run that is shown, if it is known how far it may go and it is in memory."""
    run = session.run_shown
    return run if run is not None and run.safe is not None and not session.lacks_cells else None


def reach_of(session: Session) -> Reach:
    """Return the curve of the run that is shown, which `reach_run` has; cached."""
    run = reach_run(session)
    assert run is not None
    assert run.safe is not None
    assert run.last is not None
    safe = run.safe
    return _REACHES.of(run.last, None, lambda: _reach(session.frames, run, safe))


def _reach(frames: Sequence[StepFrame], run: Run, safe: SafeFraction) -> Reach:
    parts = [0.0, *(frame.step.part for frame in run.frames if frame.step is not None)]
    end = float(np.clip(1.15 * safe.fraction, 1.0, FARTHEST_SHOWN))
    limit = min(safe.fraction, end)
    fractions = np.unique([*parts, *np.linspace(0.0, end, SAMPLES), limit])
    lowest = [_lowest(frames, parts, float(at)) for at in fractions]
    return Reach(fractions, np.array(lowest), safe)


def _lowest(frames: Sequence[StepFrame], parts: Sequence[float], at: float) -> float:
    """Return the lowest quality at a fraction of the motion, between or beyond the frames."""
    if at in parts:
        return frames[parts.index(at)].quality.min
    ends = list(pairwise(parts))
    k = next((k for k, (_, end) in enumerate(ends) if at < end), len(ends) - 1)
    low, high = ends[k]
    first = frames[k].mesh.points
    undeformed = frames[0].mesh
    points = first + (at - low) / (high - low) * (frames[k + 1].mesh.points - first)
    return quality(undeformed.with_points(points), undeformed, frames[-1].quality.metric).min


TYPED_TIP = (
    "All cells are proved valid up to there on that run's own path: straight in each step, beyond "
    "the last step straight on. A new run in one step has the path of a run in one step for "
    "translations, if control nodes and support radius stay the same and no cell is repaired. "
    "Rotations and several steps lead to other paths, so run it to be sure."
)


def typed_words(session: Session) -> str:
    """Return how far the motion in the panel may go, by the run that is shown; "" if unknown."""
    run = session.run_shown
    safe = run.safe if run is not None else None
    if run is None or safe is None or safe.fraction == 0:
        return ""
    case = session.case.change(motions=run.case.motions)
    factor = factor_of(session.case.motions, run.case.motions)
    if factor is None or result_settings(case) != result_settings(run.case):
        return ""
    more = " or more" if safe.cell is None else ""
    part = "" if factor == 1 else f" ({100 * factor:.3g} % of its motion)"
    return f"By {run.label}{part}, it {reach_words(safe.fraction / factor)}{more}."
