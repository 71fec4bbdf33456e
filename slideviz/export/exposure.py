"""The images of a film, one after the other, drawn and written."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from slideviz.export.encode import Pixels, Take, kind_of, writer
from slideviz.export.reel import Reel
from slideviz.session.pieces import Beside, here


@dataclass(frozen=True)
class Drawn:
    """How far a film is: images written, of so many in all."""

    done: int
    total: int


def told(pieces: Generator[object, Any, None]) -> Generator[Drawn, None, None]:
    """Yield how far the pieces of a film are, all done here."""
    run = here(pieces)
    try:
        yield from (piece for piece in run if isinstance(piece, Drawn))
    finally:
        run.close()


def exposing(
    frames: int,
    file: Path,
    reel: Reel,
    draw: Callable[[float], Generator[object, Any, Pixels]],
) -> Generator[object, Any, None]:
    """Yield `Drawn` after each image that the encoder took, and between the pieces of it.

    Parameters
    ----------
    frames : int
        The undeformed mesh and every step.
    file : Path
    reel : Reel
    draw : callable
        Draws a position in the film in pieces: the number of a step, or something between two.
        What is written is written beside.
    """
    total, pace = reel.count(frames), reel.pace(frames)
    samples = []
    if kind_of(file) == ".gif":  # only there colours have to be chosen
        for at in sorted({0, frames // 2, frames - 1}):
            image = yield from draw(float(at))
            samples.append(image)
    take = Take(reel.pixels(file), total, pace, lambda: samples)
    with ExitStack() as stack:
        add = yield Beside(lambda _: stack.enter_context(writer(file, take)))
        for done, position in enumerate(_positions(frames - 1, reel.between), start=1):
            image = yield from draw(position)
            seconds = 1.0 / pace if done < total else max(reel.hold, 1.0 / pace)
            yield Beside(partial(_add, add, image, seconds))
            yield Drawn(done, total)
        yield Beside(lambda _: stack.close())


def _add(add: Callable[[Pixels, float], None], image: Pixels, seconds: float, _: object) -> None:
    add(image, seconds)


def _positions(steps: int, between: int) -> Iterator[float]:
    """Yield the steps and what lies between them."""
    for step in range(steps):
        yield from (step + k / (between + 1) for k in range(between + 1))
    yield float(steps)
