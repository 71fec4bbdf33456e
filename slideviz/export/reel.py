"""The settings of a film: size, speed, images in between; checks of them; the loop over images."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from slideviz.errors import SlidevizError
from slideviz.export.encode import FASTEST, EncoderSettings, Pixels, film_kind, targets, writer
from slideviz.export.offscreen import check_size
from slideviz.session.pieces import Beside, here

SIZES = {".mp4": (1280, 800), ".gif": (800, 500), ".png": (1600, 1000)}
"""Default width and height in pixels, by the kind of film."""
FPS, SECONDS = 10.0, 3.0
"""Default images per second; and the duration in seconds below which there are fewer per second."""


@dataclass(frozen=True)
class FilmOptions:
    """The size, speed and images in between of a film.

    Attributes
    ----------
    size : (int, int) or None
        Width and height in pixels, even numbers for an MP4; None: the default of the kind of file.
    fps : float or None
        Images per second; None: ten, or fewer, so that a film of few images lasts 3 s.
    hold : float
        Seconds that the last image is shown.
    between : int
        Number of images between two steps, whose nodes are interpolated linearly, with the quality
        of that mesh.
    """

    size: tuple[int, int] | None = None
    fps: float | None = None
    hold: float = 1.5
    between: int = 0

    def pixels(self, file: Path) -> tuple[int, int]:
        """Return width and height in pixels of the film in a file."""
        return self.size or SIZES[film_kind(file)]

    def count(self, frames: int) -> int:
        """Return the number of images of a film of ``frames`` frames, with the undeformed mesh."""
        return frames + (frames - 1) * self.between

    def pace(self, frames: int) -> float:
        """Return the images per second of a film of ``frames`` frames, with the undeformed mesh."""
        return self.fps or min(FPS, max(1.0, self.count(frames) / SECONDS))


DEFAULT_FILM = FilmOptions()
"""The default settings of a film."""


def check_film(
    file: Path, film_options: FilmOptions, *, frames: int | None = None, overwrite: bool = False
) -> None:
    """Raise SlidevizError if a film cannot be made with these settings or in this file.

    Parameters
    ----------
    file : Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    film_options : Reel
        The settings.
    frames : int, optional
        The number of frames, if it is known already.
    overwrite : bool
        Allow files that exist.
    """
    kind, size = film_kind(file), film_options.pixels(file)
    check_size(size)
    if kind == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise SlidevizError(
            f"an MP4 of {size[0]}x{size[1]} pixels cannot be made: width and height must be even; "
            f"take {size[0] + size[0] % 2}x{size[1] + size[1] % 2}"
        )
    if film_options.fps is not None and not 0.1 <= film_options.fps <= FASTEST[kind]:
        raise SlidevizError(
            f"{film_options.fps:g} images a second cannot be shown; "
            f"0.1 to {FASTEST[kind]:g} can ({kind})"
        )
    if not 0.0 <= film_options.hold <= 600.0:
        raise SlidevizError(
            f"the last image cannot stay for {film_options.hold:g} s; 0 to 600 s can"
        )
    if not 0 <= film_options.between <= 1000:
        raise SlidevizError(
            f"{film_options.between} images between two steps; 0 to 1000 are possible"
        )
    paths = targets(file, film_options.count(frames) if frames else 2)
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
    """The progress of a film: number of images written, and of all images."""

    done: int
    total: int


def images_drawn(pieces: Generator[object, Any, None]) -> Generator[FilmProgress, None, None]:
    """Do all pieces of a film here, without threads, and yield its progress after each image."""
    run = here(pieces)
    try:
        yield from (piece for piece in run if isinstance(piece, FilmProgress))
    finally:
        run.close()


def render_frames(
    frames: int,
    file: Path,
    film_options: FilmOptions,
    draw: Callable[[float], Generator[object, Any, Pixels]],
) -> Generator[object, Any, None]:
    """Draw and encode all images; yield `FilmProgress` after each one, and between its pieces.

    Encoding is yielded as `Beside`, to be done in a thread.

    Parameters
    ----------
    frames : int
        Number of the undeformed mesh and all steps.
    file : Path
    film_options : Reel
    draw : callable
        Given a position (the number of a step, or a number between two), returns a generator that
        draws the image in pieces and returns it.
    """
    total, pace = film_options.count(frames), film_options.pace(frames)
    samples = []
    if film_kind(file) == ".gif":  # only there colors have to be chosen
        for at in sorted({0, frames // 2, frames - 1}):
            image = yield from draw(float(at))
            samples.append(image)
    settings = EncoderSettings(film_options.pixels(file), total, pace, lambda: samples)
    with ExitStack() as stack:
        add = yield Beside(lambda _: stack.enter_context(writer(file, settings)))
        for done, position in enumerate(_positions(frames - 1, film_options.between), start=1):
            image = yield from draw(position)
            seconds = 1.0 / pace if done < total else max(film_options.hold, 1.0 / pace)
            yield Beside(partial(_add, add, image, seconds))
            yield FilmProgress(done, total)
        yield Beside(lambda _: stack.close())


def _add(add: Callable[[Pixels, float], None], image: Pixels, seconds: float, _: object) -> None:
    add(image, seconds)


def _positions(steps: int, between: int) -> Iterator[float]:
    """Yield the position of each image: the numbers of the steps, and numbers between them."""
    for step in range(steps):
        yield from (step + k / (between + 1) for k in range(between + 1))
    yield float(steps)
