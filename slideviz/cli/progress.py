"""A progress bar on the terminal; silent when the output is no terminal."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from slideviz.staircase import Progress

_PHASES = {
    "classify": "sorting nodes",
    "select": "choosing control nodes",
    "solve": "solving",
    "evaluate": "moving nodes",
    "project": "sliding",
}
_EVERY = 0.1


class Bar:
    """``with Bar() as bar: deform(case, mesh, bar)``; wipes itself away at the end."""

    def __init__(self, enabled: bool = True) -> None:
        self.enabled = enabled and sys.stderr.isatty()
        self._next = 0.0
        self._start = time.monotonic()

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.enabled:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    def __call__(self, progress: Progress) -> None:
        """Draw the bar, at most ten times a second."""
        now = time.monotonic()
        if not self.enabled or now < self._next:
            return
        self._next = now + _EVERY
        done = (progress.step - 1) / progress.total
        left = ""
        if progress.step > 1:
            rest = (now - self._start) / done * (1 - done)
            left = f", about {rest:.0f} s left"
        word = _PHASES.get(progress.phase, progress.phase)
        self._draw(done, f"step {progress.step} of {progress.total}: {word}{left}")

    def count(self, done: int, total: int, what: str) -> None:
        """Draw the bar for ``done`` of ``total`` things."""
        if self.enabled:
            self._draw(done / total, f"{what} {done} of {total}")

    def _draw(self, done: float, text: str) -> None:
        filled = round(24 * done)
        bar = f"[{'#' * filled}{'.' * (24 - filled)}] {text}"
        print(f"\r\033[K{bar}", end="", file=sys.stderr, flush=True)
