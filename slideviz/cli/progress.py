"""Progress on the terminal: a progress bar, and a line when Numba compiles loops."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING

from slideviz.cli.terminal import control
from slideviz.terms import PHASES

if TYPE_CHECKING:
    from slideviz.solver.deform import Progress

_BEFORE = ("read", "convert", "classify")  # phases in which a run can still be refused
_EVERY = 0.1
_WIPE = "\r\033[K"  # control sequence that clears the line of a bar


@contextmanager
def note_compilation(quiet: bool) -> Iterator[None]:
    """Context that prints one line to stderr when Numba begins to compile; none if ``quiet``."""
    if quiet:
        yield
        return
    # Late: Numba takes 0.3 s, and a command that is wrong needs none.
    from slideviz.system.jit_cache import compilation_watched

    noted: list[bool] = []

    def note() -> None:
        if not noted:
            noted.append(True)
            say_compiling()

    with compilation_watched(note):
        yield


def say_compiling() -> None:
    """Print to stderr that loops are being compiled."""
    words = "compiling loops that are used for the first time: up to half a minute, once"
    control(f"{_WIPE if sys.stderr.isatty() else ''}slideviz: {words}\n")


class Bar:
    """A progress bar on stderr: ``with Bar() as bar: deform(case, mesh, bar)``.

    It is drawn only where stderr is a terminal, and cleared at the end. ``head``: text before the
    words of the bar. ``expected``: estimate of all seconds, where known; used until the first step
    is done. ``begun``: called when nothing can be refused any more.
    """

    def __init__(
        self,
        enabled: bool = True,
        head: str = "",
        expected: float | None = None,
        begun: Callable[[], None] = lambda: None,
    ) -> None:
        self._begun = begun
        self.enabled = enabled and sys.stderr.isatty()
        self._head = head
        self._expected = expected
        self._next = 0.0
        self._phase = ""
        self._first = self._filled = 0.0
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
            control(_WIPE)

    def __call__(self, progress: Progress) -> None:
        """Draw the bar by the steps that are done, at most ten times a second."""
        if progress.phase not in _BEFORE:
            self._begun()
        now = time.monotonic()
        if not self.enabled or now < self._next:
            return
        self._next = now + _EVERY
        done = (progress.step - 1) / progress.total
        remaining = None
        if progress.step > 1:
            remaining = (now - self._start) / done * (1 - done)
        elif self._expected is not None:
            remaining = max(self._expected - (now - self._start), 0.0)
        left = "" if remaining is None else f", about {remaining:.0f} s left"
        word = PHASES[progress.phase].name
        steps = f"step {progress.step} of {progress.total}: {word}{progress.of_zone}{left}"
        self._draw(done, f"{self._head}{steps}")

    def phase(self, progress: Progress) -> None:
        """Draw the bar for the current phase, with the seconds left of all or, else, of it."""
        if progress.phase not in _BEFORE:
            self._begun()
        now = time.monotonic()
        self._first = self._first or now
        if progress.phase != self._phase or not progress.fraction:
            self._phase = progress.phase
            self._start = now
        if not self.enabled or now < self._next:
            return
        self._next = now + _EVERY
        done = filled = progress.fraction
        left = f", about {(now - self._start) / done * (1 - done):.0f} s left" if done else ""
        if progress.left is not None:
            spent = now - self._first
            self._filled = max(self._filled, spent / (spent + progress.left or 1.0))
            filled = self._filled
            left = f", about {progress.left:.0f} s left in all"
        word = PHASES[progress.phase].name
        self._draw(filled, f"{self._head}{word}{progress.of_zone}: {100 * done:.0f} %{left}")

    def count(self, done: int, total: int, what: str, rest: float | None = None) -> None:
        """Draw the bar for ``done`` of ``total`` things; ``rest`` is the seconds left, if known."""
        if self.enabled:
            left = "" if rest is None else f", about {rest:.0f} s left"
            self._draw(done / total, f"{what} {done} of {total}{left}")

    def _draw(self, done: float, text: str) -> None:
        filled = round(24 * done)
        bar = f"[{'#' * filled}{'.' * (24 - filled)}] {text}"
        control(f"{_WIPE}{bar}")
