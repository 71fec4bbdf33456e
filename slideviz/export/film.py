"""Films of the steps of a deformation: MP4, GIF, or one picture per image.

A film is a generator that draws one image per `next`: its caller has control of progress and
cancelling. Closing it early leaves no file. It must be advanced in the thread that may use VTK.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from slideviz.errors import SlidevizError
from slideviz.export.encode import Pixels
from slideviz.export.offscreen import LETTERS
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions, letters_across, panes
from slideviz.export.reel import (
    DEFAULT_FILM,
    FilmOptions,
    FilmProgress,
    check_film,
    images_drawn,
    render_frames,
)
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
from slideviz.scene.moved import Zoom
from slideviz.session.pieces import Beside, GoingOn, never
from slideviz.session.state import Session, StepFrame

_NARROWEST = 160
"""Least width in pixels for the mesh in each of two pictures side by side."""


@dataclass(frozen=True)
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
    step that is as far deformed, or, with images in between, a mesh between two steps.

    Parameters
    ----------
    session : Session
        Made of the runs (`slideviz.session.opening.of_runs`).
    file : str or Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    film_options : Reel
        Size, speed, and images in between.
    zoom : Detail, "auto" or "all"
        What part of the mesh is seen; "auto" is the whole, unless what moved is tiny in it.
    overwrite : bool
        Allow files that exist.

    Raises
    ------
    SlidevizError
        There are no steps, the film cannot be made like that, or the file cannot be written.
    """
    path = Path(file)
    options = image_options(film_options.pixels(path), both=session.view.beside is not None)
    if options.both:
        require_pair(options.size)
    with OffscreenRenderer.of_runs(session, zoom) as renderer:
        runs = renderer.shown(session, options)
        titles = _titles_of_runs(runs, options, renderer.shows_detail, film_options.between > 0)
        yield from images_drawn(
            filming(renderer, options, path, film_options, titles=titles, overwrite=overwrite)
        )


def image_options(size: tuple[int, int], both: bool = False) -> PictureOptions:
    """Return the usual options of a film's images; ``both``: of two runs side by side."""
    return PictureOptions(size, title=True, both=both, letters=LETTERS, film=True, lines=1 + both)


def filming(
    renderer: OffscreenRenderer,
    options: PictureOptions,
    file: Path,
    film_options: FilmOptions,
    *,
    titles: Titles | None = None,
    overwrite: bool = False,
) -> Generator[object, Any, None]:
    """Write a film drawn by a renderer; yield `FilmProgress` after each image, and between pieces.

    Parameters
    ----------
    renderer : OffscreenRenderer
        Holds the session, whose steps are shown, and the camera.
    options : PictureOptions
        The options of each image.
    file : Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    film_options : Reel
        Speed, and images in between.
    titles : callable, optional
        Returns the titles of the images; by default run, step and quality.
    overwrite : bool
        Allow files that exist.

    Raises
    ------
    SlidevizError
        There are no steps, the film cannot be made like that, or the file cannot be written.
    """
    runs = renderer.shown(renderer.session, options)
    for one in runs:
        require_steps(one.frames, file, film_options, overwrite)
    write = titles or _titles(runs[0], options)
    count = max(len(one.frames) for one in runs)
    yield from aim_at_largest(renderer, options)

    def draw(position: float) -> Generator[object, Any, Pixels]:
        film_frames = []
        for one in runs:
            at = position
            if len(one.frames) < count:  # as far deformed
                part = (len(one.frames) - 1) / (count - 1)
                at = round(position * part, 9 if film_options.between else 0)
            film_frames.append((yield Beside(partial(film_frame_at, one.frames, at))))
        shown = [
            _showing(one, film_frame.frame)
            for one, film_frame in zip(runs, film_frames, strict=True)
        ]
        return (yield from renderer.drawing(shown, options, write(film_frames)))

    yield from render_frames(count, file, film_options, draw)


def aim_at_largest(
    renderer: OffscreenRenderer, options: PictureOptions
) -> Generator[object, Any, None]:
    """Aim a renderer's camera so that the largest step is seen whole, yielding between pieces."""
    yield from renderer.prepare_steps()
    frames = renderer.session.frames
    widest = yield Beside(lambda _: max(range(len(frames)), key=lambda k: frames[k].mesh.extent))
    renderer.pose(options, widest)
    yield None


def require_pair(size: tuple[int, int]) -> None:
    """Raise SlidevizError if a film's size is too narrow for two runs side by side."""
    options = image_options(size, both=True)
    room = panes(options, options.gap)[0].size[0]
    if room < _NARROWEST:
        least = size[0] + 2 * (_NARROWEST - room)
        raise SlidevizError(
            f"{size[0]}x{size[1]} pixels are too narrow for two runs beside each other; take "
            f"{least + least % 2} or more in width, or less in height"
        )


def require_steps(
    frames: Sequence[StepFrame], file: Path, film_options: FilmOptions, overwrite: bool
) -> None:
    """Raise SlidevizError if there are no steps, or `check_film` refuses the film."""
    if len(frames) < 2:
        raise SlidevizError("there are no steps to make a film of; run the case first")
    check_film(file, film_options, frames=len(frames), overwrite=overwrite)


def film_frame_at(
    frames: Sequence[StepFrame], position: float, going_on: GoingOn = never
) -> FilmFrame:
    """Return the frame at a position in a run: a step, or a mesh between two steps.

    ``position`` is the number of the step, 0 the undeformed mesh; ``frames`` are all of these.
    """
    step, steps = int(position), len(frames) - 1
    place = place_words(position, steps)
    if position == step:
        return FilmFrame(frames[step], place or f"step {step} of {steps}", place)
    frame = _blend(frames[step], frames[step + 1], position - step, frames[0], going_on)
    return FilmFrame(frame, place, place)


def _blend(
    start: StepFrame, end: StepFrame, part: float, first: StepFrame, going_on: GoingOn
) -> StepFrame:
    """Return a frame interpolated between two, with its own quality; ``part`` is 0 to 1.

    ``first`` is the undeformed mesh, to which the quality refers.
    """
    points = (1.0 - part) * start.mesh.points + part * end.mesh.points
    mesh = end.mesh.with_points(points)
    found = quality(mesh, reference=first.mesh, metric=end.quality.metric, going_on=going_on)
    return StepFrame(mesh, found, end.step)


def _showing(session: Session, frame: StepFrame) -> Session:
    """Return the session with one frame in place of all its run's steps, and the same colors."""
    run = session.run_shown
    assert run is not None
    runs = tuple(replace(run, frames=(frame,)) if one is run else one for one in session.runs)
    # The color range of the whole run: that of one frame would change from image to image.
    view = replace(session.view, frame=1, color_range=session.color_range)
    return replace(session, runs=runs, view=view)


def _titles(session: Session, options: PictureOptions) -> Titles:
    """Return the function of the titles of one run: run, step and quality."""
    letters = options.size[0] / (LETTER_WIDTH * options.scale)
    longest = LONGEST.format(len(session.frames) - 1)

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
    pair, what = len(runs) == 2, runs[0].view.color_by

    def words(session: Session, place: str, found: Quality) -> str:
        run, text = session.run_shown, caption(place, found, what)
        if pair and run is not None:
            return f"{run.name}{DETAIL if detail else ''}\n{text}"
        return text + (DETAIL if detail else "")

    # The letters' size must not change from image to image: it follows from the longest line.
    far = LONGEST if between else "step {0} of {0}"
    every = [
        words(one, far.format(len(one.frames) - 1), frame.quality)
        for one in runs
        for frame in one.frames
    ]
    longest = max((line for text in every for line in text.splitlines()), key=len)
    letters = letters_across(panes(options, options.gap)[0] if pair else options)

    def write(film_frames: Sequence[FilmFrame]) -> tuple[Sequence[str], float]:
        texts = [
            words(one, film_frame.words, film_frame.frame.quality)
            for one, film_frame in zip(runs, film_frames, strict=True)
        ]
        found, part = fitting([*texts, longest], letters)
        return found[:-1], part

    return write
