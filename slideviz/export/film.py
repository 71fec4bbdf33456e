"""The steps of a deformation as a film: MP4, GIF, or one picture each.

`film` draws the quality of the steps, `film_of` what a view shows. Both are generators that draw
one image between two pulls: whoever pulls them owns progress and cancel. Closing one early
leaves no file. They must be pulled in the thread that may draw.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slideviz.color_scheme import PAPER, Look
from slideviz.errors import SlidevizError
from slideviz.export.encode import Pixels
from slideviz.export.exposure import Drawn, expose, exposing, told
from slideviz.export.mark_words import name_mark
from slideviz.export.offscreen import (
    LETTERS,
    font_scale,
    image_of,
    offscreen,
    write_title,
)
from slideviz.export.portrait import Portrait
from slideviz.export.reel import USUAL, Reel, check_film
from slideviz.export.titles import LETTER_WIDTH, LONGEST, place_words, title_words
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import Surface
from slideviz.scene.moved import Zoom
from slideviz.session.pieces import Beside, GoingOn, appearing, never
from slideviz.session.state import Frame, Session
from slideviz.terms import ColourBy

if TYPE_CHECKING:
    from slideviz.scene.scene import Scene


def film(
    frames: Sequence[Frame],
    file: str | Path,
    reel: Reel = USUAL,
    *,
    colour_by: ColourBy = "size-skew",
    zoom: Zoom = "auto",
    overwrite: bool = False,
) -> Generator[Drawn, None, None]:
    """Yield after each image of a film that shows the quality of the steps.

    Parameters
    ----------
    frames : sequence of Frame
        The undeformed mesh and every step.
    file : str or Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    reel : Reel
        Size, speed, and images in between.
    colour_by : {"size-skew", "size", "skew", "displacement"}
        What the colours say; their range is the same in all images.
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
    require_steps(frames, path, reel, overwrite)
    with offscreen(reel.pixels(path)) as plotter:
        first, *_, last = (frame.mesh for frame in frames)
        seen = [frame.mesh for frame in frames]
        portrait = Portrait(plotter, last, first, colour_by, zoom, seen)

        def draw(position: float) -> Pixels:
            shot = shot_at(frames, position)
            portrait.show(shot.frame)
            words = portrait.caption(shot.words, shot.frame.quality)
            write_title(plotter, words, PAPER)
            return image_of(plotter)

        yield from expose(len(frames), path, reel, draw)


def film_of(
    session: Session,
    surfaces: Sequence[Surface],
    file: str | Path,
    reel: Reel = USUAL,
    *,
    like: Scene | None = None,
    overwrite: bool = False,
) -> Generator[Drawn, None, None]:
    """Yield after each image of a film of what a view shows, step by step.

    Parameters and errors as of `filming_of`.
    """
    yield from told(filming_of(session, surfaces, file, reel, like=like, overwrite=overwrite))


def filming_of(
    session: Session,
    surfaces: Sequence[Surface],
    file: str | Path,
    reel: Reel = USUAL,
    *,
    like: Scene | None = None,
    overwrite: bool = False,
) -> Generator[object, Any, None]:
    """Yield `Drawn` after each image of a film of what a view shows, and between its pieces.

    Parameters
    ----------
    session : Session
        What is shown and how; its frames are the steps.
    surfaces : sequence of Surface
        The boundaries of its mesh.
    file : str or Path
        A name ending with .mp4 or .gif; a folder, or a pattern such as ``step_%03d.png``.
    reel : Reel
        Size, speed, and images in between.
    like : Scene, optional
        The view whose camera, colours and ghosts are taken.
    overwrite : bool
        Allow files that exist.

    Raises
    ------
    SlidevizError
        There are no steps, the film cannot be made like that, or the file cannot be written.
    """
    from slideviz.scene.scene import Scene

    path, size = Path(file), reel.pixels(Path(file))
    frames = session.frames
    require_steps(frames, path, reel, overwrite)
    look: Look = like.look if like is not None else PAPER
    letters = size[0] / (LETTER_WIDTH * LETTERS * font_scale(size))
    longest = LONGEST.format(len(frames) - 1)
    with offscreen(size) as plotter:
        yield None
        plotter.render_window.Render()  # begins with the graphics
        scene = Scene(plotter, look, LETTERS * font_scale(size))
        # The camera looks at what is there when the mesh is opened.
        widest = yield Beside(lambda _: max(frames, key=lambda frame: frame.mesh.extent))
        yield from scene.opening(_showing(session, widest), surfaces)
        if like is not None:
            scene.set_motion_ghosts(like.motion_ghosts)
            scene.take_camera(like)
        yield from appearing(plotter)

        def draw(position: float) -> Generator[object, Any, Pixels]:
            shot = yield Beside(lambda going_on: shot_at(frames, position, going_on))
            scene.update(_showing(session, shot.frame))
            words = title_words(session, shot.frame, shot.place, letters, longest)
            write_title(plotter, words, look)
            name_mark(plotter, scene, LETTERS * font_scale(size))
            yield None
            return image_of(plotter)

        yield from exposing(len(frames), path, reel, draw)


def _showing(session: Session, frame: Frame) -> Session:
    """Return the session with one frame in the place of all its steps, colours as they are."""
    run = session.run_shown
    assert run is not None
    runs = tuple(replace(run, frames=(frame,)) if one is run else one for one in session.runs)
    # The range of the whole run: that of one frame would change from image to image.
    view = replace(session.view, frame=1, colour_range=session.colour_range)
    return replace(session, runs=runs, view=view)


@dataclass(frozen=True)
class Shot:
    """A frame, and the words for where in the film it is.

    ``place`` is what stands beside the name of the run: of one step, nothing.
    """

    frame: Frame
    words: str
    place: str


def require_steps(frames: Sequence[Frame], file: Path, reel: Reel, overwrite: bool) -> None:
    """Raise SlidevizError when there is nothing to make a film of, or it cannot be made so."""
    if len(frames) < 2:
        raise SlidevizError("there are no steps to make a film of; run the case first")
    check_film(file, reel, frames=len(frames), overwrite=overwrite)


def shot_at(frames: Sequence[Frame], position: float, going_on: GoingOn = never) -> Shot:
    """Return a step, or, between two steps, a mesh on the way from one to the next."""
    step, steps = int(position), len(frames) - 1
    words, place = _words(position, steps), place_words(position, steps)
    if position == step:
        return Shot(frames[step], words, place)
    frame = _blend(frames[step], frames[step + 1], position - step, frames[0], going_on)
    return Shot(frame, f"{words}, interpolated", place)


def _words(position: float, steps: int) -> str:
    if position == 0:
        return "undeformed"
    return f"step {position:.{0 if position == int(position) else 2}f} of {steps}"


def _blend(start: Frame, end: Frame, part: float, first: Frame, going_on: GoingOn) -> Frame:
    """Return the mesh on the way from one frame to the next, with its own quality."""
    points = (1.0 - part) * start.mesh.points + part * end.mesh.points
    mesh = end.mesh.with_points(points)
    found = quality(mesh, reference=first.mesh, metric=end.quality.metric, going_on=going_on)
    return Frame(mesh, found, end.step)
