"""The steps of two runs beside each other as one film: one camera, one range of colours."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.errors import SlidevizError
from slideviz.export.encode import Pixels
from slideviz.export.exposure import Drawn, expose
from slideviz.export.film import Shot, require_steps, shot_at
from slideviz.export.offscreen import (
    CAPTION_AT,
    TITLE,
    font_scale,
    image_of,
    offscreen,
    write_title,
)
from slideviz.export.portrait import Portrait
from slideviz.export.reel import USUAL, Reel
from slideviz.scene.color_legend import STRIP
from slideviz.scene.moved import Zoom, lengths, tiny_motion
from slideviz.session.state import Frame
from slideviz.terms import ColourBy

_GAP = 8
"""Pixels between the two pictures."""
_WIDTH = 0.56
"""Width of a letter, as a part of its height."""
_SMALLEST = 9.0
_DETAIL = " (detail; numbers: whole mesh)"
_NARROWEST = 160
"""Pixels that each of them has at least."""


@dataclass(frozen=True, eq=False)
class Told:
    """A run, and what it is called.

    Attributes
    ----------
    name : str
        What sets it apart from the other.
    frames : sequence of Frame
        The undeformed mesh and every step.
    """

    name: str
    frames: Sequence[Frame]


def film_pair(
    runs: tuple[Told, Told],
    file: str | Path,
    reel: Reel = USUAL,
    *,
    colour_by: ColourBy = "size-skew",
    zoom: Zoom = "auto",
    overwrite: bool = False,
) -> Generator[Drawn, None, None]:
    """Yield after each image of a film of two runs that deform the same mesh.

    The film has the steps of the run that has more of them. Of the other it shows the step that
    is as far deformed, or, with images in between, a mesh between two steps.

    Parameters
    ----------
    runs : (Told, Told)
        On the left and on the right.
    file, reel, colour_by, zoom, overwrite
        As for `slideviz.export.film.film`; the size is that of both together.

    Raises
    ------
    SlidevizError
        The meshes have not the same cells, there are no steps, the film cannot be made like
        that, or the file cannot be written.
    """
    path = Path(file)
    longer = max((run.frames for run in runs), key=len)
    for run in runs:
        require_steps(run.frames, path, reel, overwrite)
    first, second = (run.frames[-1].mesh for run in runs)
    if first.points.shape != second.points.shape or not first.cells.same_as(second.cells):
        raise SlidevizError("two runs beside each other must deform the same mesh")
    size, strip = pair_size(reel.pixels(path))
    with offscreen(size) as left, offscreen(size) as right:
        portraits = _portraits((left, right), runs, colour_by, zoom)
        detail = _DETAIL if portraits[0].detail else ""
        titles = [run.name + detail for run in runs]
        longest = max(map(len, [*titles, *_captions(runs, reel)]))
        letters = _letters(longest, (size[0] - strip) / font_scale(size))

        def draw(position: float) -> Pixels:
            images = []
            for run, title, portrait in zip(runs, titles, portraits, strict=True):
                at = position * (len(run.frames) - 1) / (len(longer) - 1)
                shot = shot_at(run.frames, round(at, 9 if reel.between else 0))
                portrait.show(shot.frame)
                plotter = portrait.plotter
                write_title(plotter, f"{title}\n{_caption(shot)}", PAPER, letters)
                images.append(image_of(plotter))
            return _joined(images, strip, reel.pixels(path))

        yield from expose(len(longer), path, reel, draw)


def pair_size(whole: tuple[int, int]) -> tuple[tuple[int, int], int]:
    """Return the size of each picture, and how many pixels of it the colour bar takes.

    The left one is drawn with a colour bar, too, which is cut off: both have the same camera.
    """
    strip = round(STRIP * font_scale(whole))
    width = (whole[0] - _GAP + strip) // 2
    if width - strip < _NARROWEST:
        least = 2 * _NARROWEST + strip + _GAP
        raise SlidevizError(
            f"{whole[0]}x{whole[1]} pixels are too narrow for two runs beside each other; take "
            f"{least + least % 2} or more in width, or less in height"
        )
    return (width, whole[1]), strip


def _portraits(
    plotters: Sequence[object], runs: tuple[Told, Told], colour_by: ColourBy, zoom: Zoom
) -> list[Portrait]:
    """Return a portrait of each run; what is seen of them, and in which colours, is the same."""
    base = runs[0].frames[0].mesh
    lasts = [run.frames[-1].mesh for run in runs]
    # The range of displacements must hold both.
    farthest = max(lasts, key=lambda mesh: float(lengths(mesh, base).max()))
    shown = (tiny_motion(farthest, base) or "all") if zoom == "auto" else zoom
    seen = [frame.mesh for run in runs for frame in run.frames]
    return [Portrait(plotter, farthest, base, colour_by, shown, seen) for plotter in plotters]


def _captions(runs: Sequence[Told], reel: Reel) -> list[str]:
    """Return the longest captions that are to come."""
    early, found = 0.5 if reel.between else 1.0, []
    for run in runs:
        last = float(len(run.frames) - 1)
        found += [_caption(shot_at(run.frames, at)) for at in (early, last)]
    return found


def _letters(longest: int, room: float) -> float:
    """Return the height of letters of which so many fit; it stays, for words must not tremble."""
    fits = (1.0 - 2.0 * CAPTION_AT) * room / (_WIDTH * (longest + 2))
    return min(TITLE, max(fits, _SMALLEST))


def _caption(shot: Shot) -> str:
    found = shot.frame.quality
    text = f"{shot.words}: min {found.min:.4f}, mean {found.mean:.4f}"
    return text + (f", {found.inverted} inverted" if found.inverted else "")


def _joined(images: Sequence[Pixels], strip: int, size: tuple[int, int]) -> Pixels:
    """Return two images beside each other, the left one without its colour bar."""
    left, right = images[0][:, :-strip], images[1]
    whole = np.full((size[1], size[0], 3), 255, np.uint8)
    whole[:, : left.shape[1]] = left
    whole[:, -right.shape[1] :] = right
    return whole
