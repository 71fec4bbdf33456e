"""How far a streamed run is, and an estimate of the seconds that are left of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import monotonic

from slideviz.solver.steps import Progress

SECONDS = {"text": 4.3, "read": 1.0, "solve": 5.0, "evaluate": 3.2, "quality": 2.7, "write": 3.0}
"""Seconds of the stages of a run, measured with two million hexahedra on two cores.

Only their ratios matter. ``text`` is reading a text mesh, ``read`` a binary one, ``solve`` all that
is done with the boundary alone.
"""
SURE = 0.1
"""Least evidence for an estimate. From this part of a stage on, the rest of it is estimated from
its own pace. Before stages worth so many seconds of `SECONDS` are done, nothing is estimated."""


class RemainingTime:
    """The stages of a streamed run: passes each `Progress` on, with the seconds that are left.

    All stages but ``solve`` go through all points or cells. So the time that those took which are
    done, over their `SECONDS`, is the pace of the others. ``solve`` depends on the boundary alone.

    Parameters
    ----------
    tell : callable
        Called with each `Progress`, its ``left`` filled in.
    stages : str
        Names of `SECONDS`, in order.
    """

    def __init__(self, tell: Callable[[Progress], None], *stages: str) -> None:
        self._tell, self._rest = tell, list(stages)
        self._spent = self._usual = 0.0
        self._begin, self._part = monotonic(), 0.0

    def next(self) -> None:
        """Begin the next stage."""
        done = self._rest.pop(0)
        if done != "solve":
            self._spent += monotonic() - self._begin
            self._usual += SECONDS[done]
        self._begin, self._part = monotonic(), 0.0

    def __call__(self, progress: Progress) -> None:
        """Pass a progress on, with the seconds that are left."""
        stage = self._rest[0]
        if stage == "solve":
            self._part = (progress.step - 1) / progress.total
            if progress.phase == "classify":  # which is done once, and not for each step
                self._begin = monotonic()
        elif progress.phase == ("read" if stage == "text" else stage):
            self._part = max(self._part, progress.fraction)
        self._tell(replace(progress, left=self._left()))

    def _left(self) -> float | None:
        """Return an estimate of the seconds that are left; None before there is enough evidence."""
        stage, now = self._rest[0], monotonic() - self._begin
        spent, usual = self._spent, self._usual
        if stage != "solve":
            spent, usual = spent + now, usual + SECONDS[stage] * self._part
        if usual < SURE:
            return None
        pace = spent / usual
        own = max(pace * SECONDS[stage] - now, 0.0)
        if self._part >= SURE:
            own = now * (1.0 - self._part) / self._part
        return own + pace * sum(SECONDS[later] for later in self._rest[1:])
