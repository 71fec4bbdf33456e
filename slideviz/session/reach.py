"""How far a motion may go: in words, and as a curve of the lowest quality."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slideviz.mesh.margin import SafeFraction, reach_words
from slideviz.mesh.model import FloatArray
from slideviz.mesh.quality import quality
from slideviz.session.motion_scale import factor_of
from slideviz.session.state import Run, Session, StepFrame, result_settings
from slideviz.system.weak_cache import WeakCache

SAMPLES = 17  # fractions at which the curve is computed, besides steps
FARTHEST_SHOWN = 3.0  # largest fraction of the curve


@dataclass(frozen=True, eq=False)
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
