"""Films of the steps of a deformation: MP4, GIF, or one picture per image.

A film is a generator that draws one image per `next`: its caller has control of progress and
cancelling. Closing it early leaves no file. It must be advanced in the thread that may use VTK.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from slideviz.argument_types import frozen
from slideviz.errors import SlidevizError
from slideviz.export.encode import MAX_FPS, EncoderSettings, Pixels, film_kind, targets, writer
from slideviz.export.offscreen import LETTERS, check_drawable
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions, letters_across, panes
from slideviz.export.titles import (
    DETAIL,
    LETTER_WIDTH,
    LONGEST,
    caption,
    fitting,
    place_words,
    title_words,
)
from slideviz.mesh.quality import Quality, quality
from slideviz.scene.overview import Zoom
from slideviz.session.changes import show_frame
from slideviz.session.pieces import CheckCancelled, InThread, Pieces, run_inline
from slideviz.session.state import Session, StepFrame, planned_steps

SIZES = {".mp4": (1280, 800), ".gif": (800, 500), ".png": (1600, 1000)}
"""Default width and height in pixels, by the kind of film."""
FPS = 10.0
SECONDS = 3.0
"""Default images per second; and the duration in seconds below which there are fewer per second."""


@frozen
class FilmOptions:
    """The size, speed and images in between of a film."""

    size: tuple[int, int] | None = None
    """(int, int) or None: width and height in pixels, even numbers for an MP4; None: the default of
    the kind of file."""
    fps: float | None = None
    """Images per second; None: ten, or fewer, so that a film of few images lasts 3 s."""
    hold: float = 1.5
    """Seconds that the last image is shown."""
    between: int = 0
    """Number of images between two steps, whose nodes are interpolated linearly, with the quality
    of that mesh."""

    def pixels(self, file: Path) -> tuple[int, int]:
        """Return width and height in pixels of the film in a file."""
        return self.size or SIZES[film_kind(file)]

    def count(self, frames: int) -> int:
        """Return the number of images of a film of ``frames`` frames, with the undeformed mesh."""
        return frames + (frames - 1) * self.between

    def pace(self, frames: int) -> float:
        """Return the images per second of a film of ``frames`` frames, with the undeformed mesh."""
        return self.fps or min(FPS, max(1.0, self.count(frames) / SECONDS))


DEFAULT_FILM = FilmOptions()  # the default settings of a film


def check_film(
    file: Path, film_options: FilmOptions, *, frames: int | None = None, overwrite: bool = False
) -> None:
    """Raise SlidevizError if a film cannot be made with these settings or in this file.

    ``file``: see `film`. ``frames``: the number of frames, if it is known already.
    """
    kind = film_kind(file)
    size = film_options.pixels(file)
    check_drawable(size)
    if kind == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise SlidevizError(
            f"an MP4 of {size[0]}x{size[1]} pixels cannot be made: width and height must be even; "
            f"take {size[0] + size[0] % 2}x{size[1] + size[1] % 2}"
        )
    if film_options.fps is not None and not 0.1 <= film_options.fps <= MAX_FPS[kind]:
        raise SlidevizError(
            f"{film_options.fps:g} images per second cannot be shown; "
            f"0.1 to {MAX_FPS[kind]:g} can ({kind})"
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


@frozen
class FilmProgress:
    """The progress of a film: number of images written, and of all images."""

    done: int
    total: int


def draw_images(pieces: Pieces) -> Generator[FilmProgress, None, None]:
    """Do all pieces of a film here, without threads, and yield its progress after each image."""
    run = run_inline(pieces)
    try:
        yield from (piece for piece in run if isinstance(piece, FilmProgress))
    finally:
        run.close()


def render_frames(
    frames: int,
    file: Path,
    film_options: FilmOptions,
    draw: Callable[[float], Generator[object, Any, Pixels]],
) -> Pieces:
    """Draw and encode all images; yield `FilmProgress` after each one, and between its pieces.

    Encoding is yielded as `InThread`, to be done in a thread. ``frames``: number of the undeformed
    mesh and all steps. ``draw``: given a position (the number of a step, or a number between two),
    returns a generator that draws the image in pieces and returns it.
    """
    total = film_options.count(frames)
    pace = film_options.pace(frames)
    samples = []
    if film_kind(file) == ".gif":  # only there colors have to be chosen
        for at in sorted({0, frames // 2, frames - 1}):
            image = yield from draw(float(at))
            samples.append(image)
    settings = EncoderSettings(film_options.pixels(file), total, pace, lambda: samples)
    with ExitStack() as stack:
        add = yield InThread(lambda _: stack.enter_context(writer(file, settings)))
        for done, position in enumerate(_positions(frames - 1, film_options.between), start=1):
            image = yield from draw(position)
            seconds = 1.0 / pace if done < total else max(film_options.hold, 1.0 / pace)
            yield InThread(partial(_add, add, image, seconds))
            yield FilmProgress(done, total)
        yield InThread(lambda _: stack.close())


def _add(add: Callable[[Pixels, float], None], image: Pixels, seconds: float, _: object) -> None:
    add(image, seconds)


def _positions(steps: int, between: int) -> Iterator[float]:
    """Yield the position of each image: the numbers of the steps, and numbers between them."""
    for step in range(steps):
        yield from (step + k / (between + 1) for k in range(between + 1))
    yield float(steps)


_NARROWEST = 160  # least width in pixels for the mesh in each of two pictures side by side


@frozen
class FilmFrame:
    """A frame of a film, with the texts of its place in the run.

    ``words`` always names the step; ``place`` is empty for the only step of a run.
    """

    frame: StepFrame
    words: str
    place: str


Titles = Callable[[Sequence[FilmFrame]], tuple[Sequence[str], float]]
"""A function that returns the titles of the runs shown, and their letters' size (1: usual)."""


def film(
    session: Session,
    file: str | Path,
    film_options: FilmOptions = DEFAULT_FILM,
    *,
    zoom: Zoom = "auto",
    overwrite: bool = False,
) -> Generator[FilmProgress, None, None]:
    """Write a film of one run, or of two side by side, and yield its progress after each image.

    A film of two runs has the steps of the run with more of them. Of the other run it shows the
    step that is as far deformed, or, with images in between, a mesh between two steps. Raises
    SlidevizError if there are no steps, the film cannot be made like that, or the file cannot be
    written. ``session``: made by `slideviz.session.opening.session_of_runs`. ``file``: a name
    ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``. ``zoom``: what part
    of the mesh is seen; "auto" is the whole, unless what moved is tiny in it. ``overwrite``: allow
    files that exist.
    """
    path = Path(file)
    options = image_options(film_options.pixels(path), both=session.view.beside is not None)
    if options.both:
        require_pair_width(options.size)
    with OffscreenRenderer.of_runs(session, zoom) as renderer:
        if zoom == "view":
            options = options.like(renderer.session.view)
        yield from draw_images(
            film_steps(renderer, options, path, film_options, named=False, overwrite=overwrite)
        )


def image_options(size: tuple[int, int], both: bool = False) -> PictureOptions:
    """Return the usual options of a film's images; ``both``: of two runs side by side."""
    return PictureOptions(size, title=True, both=both, letters=LETTERS, film=True, lines=1 + both)


def film_steps(
    renderer: OffscreenRenderer,
    options: PictureOptions,
    file: Path,
    film_options: FilmOptions,
    *,
    named: bool = True,
    overwrite: bool = False,
) -> Pieces:
    """Write a film drawn by a renderer; yield `FilmProgress` after each image, and between pieces.

    The rest is as for `film`. ``renderer``: holds the session, whose steps are shown, and the
    camera. ``named``: whether the title of a single run has its name.
    """
    runs = renderer.shown(renderer.session, options)
    for one in runs:
        if len(one.frames) < 2:
            raise SlidevizError("there are no steps to make a film of; run the case first")
        check_film(file, film_options, frames=len(one.frames), overwrite=overwrite)
    if named and len(runs) == 1:
        write = _titles(runs[0], options)
    else:
        write = _titles_of_runs(runs, options, renderer.shows_detail, film_options.between > 0)
    longest = max(runs, key=lambda one: len(one.frames))
    yield from aim_at_largest(renderer, options)

    def draw(position: float) -> Generator[object, Any, Pixels]:
        film_frames = []
        for one in runs:
            at = position
            if one is not longest:  # as far deformed
                far = position * one.planned / longest.planned
                at = round(far, 9 if film_options.between else 0)
                at = min(at, len(one.frames) - 1)
            film_frames.append((yield InThread(partial(film_frame_at, one.frames, at))))
        others = [film_frame.frame for film_frame in film_frames[::-1]]
        beside = [show_frame(runs[0], round(position)).frame_beside]
        pairs = zip(runs, film_frames, others if len(runs) > 1 else beside, strict=True)
        shown = [_showing(one, film_frame.frame, other) for one, film_frame, other in pairs]
        return (yield from renderer.draw_panes(shown, options, write(film_frames)))

    yield from render_frames(len(longest.frames), file, film_options, draw)


def aim_at_largest(renderer: OffscreenRenderer, options: PictureOptions) -> Pieces:
    """Aim a renderer's camera so that the largest step is seen whole, yielding between pieces."""
    yield from renderer.prepare_steps()
    frames = renderer.session.frames
    widest = yield InThread(lambda _: max(range(len(frames)), key=lambda k: frames[k].mesh.extent))
    renderer.aim(options, widest)
    yield None


def require_pair_width(size: tuple[int, int]) -> None:
    """Raise SlidevizError if a film's size is too narrow for two runs side by side."""
    options = image_options(size, both=True)
    width = panes(options, options.gap)[0].size[0]
    if width < _NARROWEST:
        least = size[0] + 2 * (_NARROWEST - width)
        raise SlidevizError(
            f"{size[0]}x{size[1]} pixels are too narrow for two runs side by side; take "
            f"{least + least % 2} or more in width, or less in height"
        )


def film_frame_at(
    frames: Sequence[StepFrame], position: float, going_on: CheckCancelled
) -> FilmFrame:
    """Return the frame at a position in a run: a step, or a mesh between two steps.

    ``position`` is the number of the step, 0 the undeformed mesh; ``frames`` are all of these.
    """
    step = int(position)
    place = frame_words(frames, position)
    if position == step:
        full = place or f"step {step} of {planned_steps(frames[1:])}"
        return FilmFrame(frames[step], full, place)
    frame = _blend(frames[step], frames[step + 1], position - step, frames[0], going_on)
    return FilmFrame(frame, place, place)


def frame_words(frames: Sequence[StepFrame], position: float) -> str:
    """Return what is shown at a position in words, as `place_words`, by the labels of frames."""
    last = frames[int(position)]
    following = frames[min(int(position) + 1, len(frames) - 1)]
    if not following.label:
        return place_words(position, planned_steps(frames[1:]))
    if position == int(position):
        return last.label or "undeformed"
    return f"{last.label or 'undeformed'} to {following.label}"


def _blend(
    start: StepFrame, end: StepFrame, part: float, first: StepFrame, going_on: CheckCancelled
) -> StepFrame:
    """Return a frame interpolated between two, with its own quality; ``part`` is 0 to 1.

    ``first`` is the undeformed mesh, to which the quality refers.
    """
    points = (1.0 - part) * start.mesh.points + part * end.mesh.points
    mesh = end.mesh.with_points(points)
    blended = quality(mesh, reference=first.mesh, metric=end.quality.metric, going_on=going_on)
    return StepFrame(mesh, blended, end.step)


def _showing(session: Session, frame: StepFrame, compared: StepFrame | None) -> Session:
    """Return the session with one frame in place of all its run's steps, and the same colors."""
    run = session.run_shown
    assert run is not None
    runs = tuple(replace(run, frames=(frame,)) if one is run else one for one in session.runs)
    # The color range of the whole run: that of one frame would change from image to image.
    view = replace(session.view, frame=1, color_range=session.color_range)
    return replace(session, runs=runs, view=view, compared=compared)


def _titles(session: Session, options: PictureOptions) -> Titles:
    """Return a function that writes the title of each frame: run, step and quality."""
    letters = options.size[0] / (LETTER_WIDTH * options.scale)
    longest = LONGEST.format(session.planned)

    def write(film_frames: Sequence[FilmFrame]) -> tuple[Sequence[str], float]:
        (film_frame,) = film_frames
        return [title_words(session, film_frame.frame, film_frame.place, letters, longest)], 1.0

    return write


def _titles_of_runs(
    runs: Sequence[Session], options: PictureOptions, detail: bool, between: bool
) -> Titles:
    """Return the function of the titles: step and quality, and of two runs their names.

    ``detail``: note that only a part of the mesh is shown; ``between``: there are images in
    between.
    """
    pair = len(runs) == 2
    what = runs[0].view.color_by

    def words(session: Session, place: str, stats: Quality) -> str:
        run = session.run_shown
        text = caption(place, stats, what)
        if pair and run is not None:
            return f"{run.name or run.label}{DETAIL if detail else ''}\n{text}"
        return text + (DETAIL if detail else "")

    def longest_place(frames: Sequence[StepFrame]) -> str:
        last = len(frames) - 1
        places = (frame_words(frames, min(k + 0.25 * between, last)) for k in range(last + 1))
        return max((*places, "step 1 of 1"), key=len)

    # The letters' size must not change from image to image: it follows from the longest line.
    every = [
        words(one, longest_place(one.frames), frame.quality) for one in runs for frame in one.frames
    ]
    longest = max((line for text in every for line in text.splitlines()), key=len)
    letters = letters_across(panes(options, options.gap)[0] if pair else options)

    def write(film_frames: Sequence[FilmFrame]) -> tuple[Sequence[str], float]:
        texts = [
            words(one, film_frame.words, film_frame.frame.quality)
            for one, film_frame in zip(runs, film_frames, strict=True)
        ]
        shortened, part = fitting([*texts, longest], letters)
        return shortened[:-1], part

    return write
