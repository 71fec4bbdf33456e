"""What a picture of a view has: size, background, legend, title; for papers and slides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from slideviz.view.legend import STRIP
from slideviz.view.offscreen import SMALLEST, font_scale
from slideviz.view.portrait import caption
from slideviz.view.state import Frame, Session

Background = Literal["white", "shown", "transparent"]
BACKGROUNDS: dict[Background, str] = {
    "white": "white",
    "shown": "as in the view",
    "transparent": "transparent",
}
"""What is behind the mesh, and the words for it."""
TITLE_ROOM = 40.0
"""Pixels at the top that are the title's, at normal letter size."""
GAP = 12.0
"""Pixels between two pictures beside each other, at normal letter size."""
_TITLE_WIDTH = 9.6
"""Pixels that a letter of the title takes, at normal size."""


@dataclass(frozen=True)
class Figure:
    """What a picture of a view has.

    Attributes
    ----------
    size : (int, int)
        Width and height in pixels.
    background : {"white", "shown", "transparent"}
    legend, edges, triad : bool
        The legend of roles or the colour bar; edges of cells; directions of the axes.
    title : bool
        A line that says what is shown, with minimum, mean and inverted cells.
    fill : bool
        Make the whole mesh fill the picture, instead of showing what the view shows of it.
    both : bool
        Draw the run of the second view, too, where there is one.
    letters : float
        How large letters are; 1 is 13 pixels in 620 of the height.
    dpi : float or None
        Pixels per inch on paper, for programs that place the picture.
    """

    size: tuple[int, int] = (1600, 1000)
    background: Background = "white"
    legend: bool = True
    edges: bool = True
    triad: bool = False
    title: bool = False
    fill: bool = True
    both: bool = True
    letters: float = 1.25
    dpi: float | None = None

    @property
    def scale(self) -> float:
        """Return how much larger than 13 pixels the letters are."""
        return font_scale(self.size) * self.letters

    def within(self, box: tuple[int, int]) -> Figure:
        """Return the same picture as large as it can be in a box of pixels."""
        width, height = self.size
        part = min(box[0] / width, box[1] / height, 1.0)
        size = tuple(max(round(part * length), SMALLEST) for length in self.size)
        letters = part * self.scale / font_scale((size[0], size[1]))
        return replace(self, size=(size[0], size[1]), letters=letters)

    def showing(self, session: Session) -> Session:
        """Return the session as the picture shows it: nothing selected, no clutter."""
        view = replace(
            session.view,
            legend=self.legend,
            edges=self.edges,
            triad=self.triad,
            # Of a result, it would hide what is to be seen.
            motion_ghost=session.view.motion_ghost and session.view.colour_by == "role",
            selected=(),
        )
        return replace(session, view=view)


def panes(figure: Figure, gap: int) -> tuple[Figure, Figure]:
    """Return the two pictures beside each other that a picture of two runs is made of.

    The legend is at the right of the second; both have the same room for the mesh.
    """
    width, height = figure.size
    strip = STRIP * figure.scale if figure.legend else 0.0
    first = max(round((width - strip - gap) / 2.0), 1)
    sizes = (first, height), (max(width - first - gap, 1), height)
    # Letters go by the height, which is that of the whole.
    left, right = (replace(figure, size=size) for size in sizes)
    return replace(left, legend=False), right


def title_of(session: Session, figure: Figure) -> str:
    """Return the words above a picture: run and step, quality; on two lines where it is narrow."""
    frame: Frame | None = session.frame
    assert frame is not None
    at = min(session.view.frame, len(session.frames) - 1)
    name = "Undeformed"
    if at:
        steps = len(session.frames) - 1
        name = f"Run {session.shown}" if len(session.runs) > 1 else "Deformed"
        name += f", step {at} of {steps}" if at < steps else ""
    words = caption(name, frame.quality, session.view.colour_by)
    short = f"{name}: min {frame.quality.min:.3f}"
    return words if len(words) * _TITLE_WIDTH * figure.scale <= figure.size[0] else short


def words_of_size(figure: Figure) -> str:
    """Return how large a picture is on paper, or in pixels, in words."""
    width, height = figure.size
    if figure.dpi is None:
        return f"{width} × {height} pixels"
    across, high = (2.54 * length / figure.dpi for length in figure.size)
    return f"{across:.1f} × {high:.1f} cm on paper, {width} × {height} pixels"
