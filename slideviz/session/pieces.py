"""Long work in pieces, so that a window stays responsive.

The work is a generator that yields between two pieces: None, or its progress. Pieces that draw run
in the generator, in the thread that pulls it. A piece that does not draw is yielded as `InThread`:
who pulls the generator may run it in another thread, and sends back its result, or throws its
error.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

CheckCancelled = Callable[[], None]
"""A function that is called often, and raises `slideviz.errors.Cancelled` to end the work."""
Result = TypeVar("Result")
Pieces = Generator[object, Any, None]

PART_CELLS = 10_000  # faces that are sent to the graphics card in one piece


@dataclass(frozen=True)
class InThread:
    """Work that draws nothing: who pulls the generator runs ``call`` and sends its result back."""

    call: Callable[[CheckCancelled], Any]


def run_inline(pieces: Generator[object, Any, Result]) -> Generator[object, None, Result]:
    """Yield what some work yields, but do its `InThread` pieces at once, in this thread.

    Returns the result of the work.
    """
    try:
        piece = next(pieces)
        while True:
            if not isinstance(piece, InThread):
                yield piece
                piece = next(pieces)
                continue
            try:
                value = piece.call(not_cancelled)
            except Exception as error:
                piece = pieces.throw(error)
            else:
                piece = pieces.send(value)
    except StopIteration as end:
        result: Result = end.value
        return result
    finally:
        pieces.close()


def run_to_end(pieces: Generator[object, Any, Result]) -> Result:
    """Return the result of some work, after doing all its pieces in this thread."""
    run = run_inline(pieces)
    while True:
        try:
            next(run)
        except StopIteration as end:
            value: Result = end.value
            return value


def actor_groups(actors: Iterable[Any], cells: int = PART_CELLS) -> list[list[Any]]:
    """Return the visible actors in groups of at most ``cells`` faces, or of one larger actor.

    Faces of several actors with one mapper, as neighbouring passages, count once.
    """
    parts: list[list[Any]] = [[]]
    count = 0
    mappers = set[Any]()
    for actor in actors:
        if not actor.GetVisibility():
            continue
        mapper = getattr(actor, "mapper", None)
        size = 0 if mapper in mappers else _faces(actor)
        mappers.add(mapper)
        if size and count and count + size > cells:
            parts.append([])
            count = 0
        count += size
        parts[-1].append(actor)
    return parts


def render_in_groups(plotter: Any) -> Iterator[None]:
    """Render the actors of an off-screen plotter for the first time, group by group.

    Yields after each group, since sending a large mesh to the graphics card takes long.
    """
    parts = actor_groups(plotter.renderer.actors.values())
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
    """Return the number of faces of an actor; 0 for text and others without a mesh."""
    data = getattr(getattr(actor, "mapper", None), "dataset", None)
    return 0 if data is None else int(data.GetNumberOfCells())


def not_cancelled() -> None:
    """Do nothing: the `CheckCancelled` of work that cannot be stopped."""
