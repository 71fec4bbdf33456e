"""How far a streamed run is, and how long all that is left of it may take."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import monotonic

from slideviz.deformation.steps import Progress

SECONDS = {"text": 4.3, "read": 1.0, "solve": 5.0, "evaluate": 3.2, "quality": 2.7, "write": 3.0}
"""What the stages of a run take, of two million hexahedra on two cores; only ratios count.

``text`` is reading a text, ``solve`` all that is done with the boundary alone.
"""
SURE = 0.1
"""From this part of a stage on its own pace tells how long it takes; the first one says nothing
of the others before so many of the seconds above are done of it."""


class Course:
    """The stages of a streamed run, told as they pass with the seconds that are left of all.

    All but the stage ``solve``, which is of the boundary alone and has a pace of its own, are of
    as many points and cells, so that those that are done tell how long the others may take.

    Parameters
    ----------
    tell : callable
        Called with each `Progress`, which has ``left`` then.
    stages : str
        In order, of `SECONDS`.
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
        """Tell a progress with the time that is left."""
        stage = self._rest[0]
        if stage == "solve":
            self._part = (progress.step - 1) / progress.total
            if progress.phase == "classify":  # which is done once, and not for each step
                self._begin = monotonic()
        elif progress.phase == ("read" if stage == "text" else stage):
            self._part = max(self._part, progress.fraction)
        self._tell(replace(progress, left=self._left()))

    def _left(self) -> float | None:
        """Return the seconds that are left, None where nothing tells."""
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
