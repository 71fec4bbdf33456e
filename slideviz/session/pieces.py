"""Long work in pieces, so that a window can answer between them.

It is a generator that yields between two pieces: None, or how far it is. What draws is done in
the thread that pulls it. What does not is yielded as `Beside` and may be done in any other: the
generator is sent what came of it, or thrown what went wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

GoingOn = Callable[[], None]
"""Called often; raises `slideviz.errors.Cancelled` when the work is to end."""
Result = TypeVar("Result")

PART_CELLS = 10_000
"""Faces that are handed to the graphics in one piece."""


@dataclass(frozen=True)
class Beside:
    """A piece of work that draws nothing: a call that may be slow and returns something."""

    call: Callable[[GoingOn], Any]


def here(pieces: Generator[object, Any, Result]) -> Generator[object, None, Result]:
    """Yield the pieces of some work; those that draw nothing are done at once."""
    try:
        piece = next(pieces)
        while True:
            if not isinstance(piece, Beside):
                yield piece
                piece = next(pieces)
                continue
            try:
                value = piece.call(never)
            except Exception as error:
                piece = pieces.throw(error)
            else:
                piece = pieces.send(value)
    except StopIteration as end:
        result: Result = end.value
        return result
    finally:
        pieces.close()


def whole(pieces: Generator[object, Any, Result]) -> Result:
    """Return the result of some work, all of its pieces done here and now."""
    run = here(pieces)
    while True:
        try:
            next(run)
        except StopIteration as end:
            value: Result = end.value
            return value


def portions(actors: Iterable[Any], cells: int = PART_CELLS) -> list[list[Any]]:
    """Return the actors that are visible in groups of not much more than so many faces."""
    parts: list[list[Any]] = [[]]
    count = 0
    for actor in actors:
        if not actor.GetVisibility():
            continue
        size = _faces(actor)
        if size and count and count + size > cells:
            parts.append([])
            count = 0
        count += size
        parts[-1].append(actor)
    return parts


def appearing(plotter: Any) -> Iterator[None]:
    """Draw the new actors of an off-screen plotter part by part, and yield after each.

    To hand a large mesh to the graphics takes longer than to draw it.
    """
    parts = portions(plotter.renderer.actors.values())
    hidden = [actor for part in parts[1:] for actor in part]
    try:
        _show(hidden, False)
        for part in parts:
            _show(part, True)
            plotter.render_window.Render()
            yield
    finally:
        _show(hidden, True)


def _show(actors: Iterable[Any], shown: bool) -> None:
    for actor in actors:
        actor.SetVisibility(shown)


def _faces(actor: Any) -> int:
    """Return how many faces an actor draws; 0 for letters and the like."""
    data = getattr(getattr(actor, "mapper", None), "dataset", None)
    return 0 if data is None else int(data.GetNumberOfCells())


def never() -> None:
    """Return without a check, for work that nobody can stop."""
