"""The settings of a film: size, speed, images in between; and checks of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from slideviz.errors import SlidevizError
from slideviz.export.encode import FASTEST, Pixels, Take, kind_of, targets, writer
from slideviz.export.offscreen import check_size
from slideviz.session.pieces import Beside, here

SIZES = {".mp4": (1280, 800), ".gif": (800, 500), ".png": (1600, 1000)}
"""Width and height in pixels unless others are asked for."""
FPS, SECONDS = 10.0, 3.0
"""Images a second unless asked for; fewer of them where a film would be shorter than this."""


@dataclass(frozen=True)
class Reel:
    """Size, speed and images in between of a film.

    Attributes
    ----------
    size : (int, int) or None
        Width and height in pixels, even for an MP4; None is what suits the kind of file.
    fps : float or None
        Images a second; None is ten, and fewer where there are few, so that it lasts 3 s.
    hold : float
        Seconds that the last image stays.
    between : int
        Images put between two steps, with the nodes on straight lines from one to the next and
        the quality of that mesh.
    """

    size: tuple[int, int] | None = None
    fps: float | None = None
    hold: float = 1.5
    between: int = 0

    def pixels(self, file: Path) -> tuple[int, int]:
        """Return width and height of the film in this file."""
        return self.size or SIZES[kind_of(file)]

    def count(self, frames: int) -> int:
        """Return the number of images for so many frames."""
        return frames + (frames - 1) * self.between

    def pace(self, frames: int) -> float:
        """Return the images a second for so many frames."""
        return self.fps or min(FPS, max(1.0, self.count(frames) / SECONDS))


USUAL = Reel()
"""What a film is like unless something else is asked for."""


def check_film(
    file: Path, reel: Reel, *, frames: int | None = None, overwrite: bool = False
) -> None:
    """Raise SlidevizError where a film cannot be made like that; the message says what helps.

    Parameters
    ----------
    file : Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    reel : Reel
        How it is made.
    frames : int, optional
        The number of frames, when it is known already.
    overwrite : bool
        Allow files that exist.
    """
    kind, size = kind_of(file), reel.pixels(file)
    check_size(size)
    if kind == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise SlidevizError(
            f"an MP4 of {size[0]}x{size[1]} pixels cannot be made: width and height must be even; "
            f"take {size[0] + size[0] % 2}x{size[1] + size[1] % 2}"
        )
    if reel.fps is not None and not 0.1 <= reel.fps <= FASTEST[kind]:
        raise SlidevizError(
            f"{reel.fps:g} images a second cannot be shown; 0.1 to {FASTEST[kind]:g} can ({kind})"
        )
    if not 0.0 <= reel.hold <= 600.0:
        raise SlidevizError(f"the last image cannot stay for {reel.hold:g} s; 0 to 600 s can")
    if not 0 <= reel.between <= 1000:
        raise SlidevizError(f"{reel.between} images between two steps; 0 to 1000 are possible")
    paths = targets(file, reel.count(frames) if frames else 2)
    existing = [path for path in paths if path.exists()]
    if existing and not overwrite:
        raise SlidevizError(
            f"{existing[0]} exists already; choose another name, or allow it to be replaced "
            "(--force on the command line)"
        )
    folder = paths[0].parent
    if folder == file and not folder.exists():
        folder = folder.parent  # it will be made
    if folder.exists() and not folder.is_dir():
        raise SlidevizError(f"{file}: {folder} is a file, not a folder; choose another folder")
    if not folder.is_dir():
        raise SlidevizError(f"{file}: the folder {folder} does not exist; create it first")
    if not os.access(folder, os.W_OK):
        raise SlidevizError(f"{file}: no permission to write there; choose another folder")


@dataclass(frozen=True)
class FilmProgress:
    """Progress of a film: images written, of so many in all."""

    done: int
    total: int


def images_drawn(pieces: Generator[object, Any, None]) -> Generator[FilmProgress, None, None]:
    """Yield the progress of a film, all of its pieces done here."""
    run = here(pieces)
    try:
        yield from (piece for piece in run if isinstance(piece, FilmProgress))
    finally:
        run.close()


def exposing(
    frames: int,
    file: Path,
    reel: Reel,
    draw: Callable[[float], Generator[object, Any, Pixels]],
) -> Generator[object, Any, None]:
    """Yield `Drawn` after each image that the encoder took, and between the image's pieces.

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
            yield FilmProgress(done, total)
        yield Beside(lambda _: stack.close())


def _add(add: Callable[[Pixels, float], None], image: Pixels, seconds: float, _: object) -> None:
    add(image, seconds)


def _positions(steps: int, between: int) -> Iterator[float]:
    """Yield the steps and the places between them."""
    for step in range(steps):
        yield from (step + k / (between + 1) for k in range(between + 1))
    yield float(steps)
