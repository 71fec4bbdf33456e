"""Picture options: size, background, legend and title of a picture; and the title's words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from slideviz.export.offscreen import CAPTION_AT, LETTERS, SMALLEST, font_scale
from slideviz.export.titles import (
    LETTER_WIDTH,
    LONGEST,
    fitting,
    pair_titles,
    place_words,
    title_words,
)
from slideviz.scene.color_legend import STRIP
from slideviz.session.colors import as_drawn
from slideviz.session.state import Session, StepFrame
from slideviz.terms import Shown

Background = Literal["white", "shown", "transparent"]
BACKGROUNDS: dict[Background, str] = {
    "white": "white",
    "shown": "as in the view",
    "transparent": "transparent",
}
"""What is behind the mesh, and the words for it."""
TITLE_ROOM = 40.0
"""Pixels at the top that are the title's, at normal letter size; a second line has 20 more."""
GAP = 12.0
"""Pixels between two pictures beside each other, at normal letter size."""


@dataclass(frozen=True)
class PictureOptions:
    """Size, background, legend, title and camera of a picture of a view.

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
    film : bool
        Whether it is an image of a film.
    named : bool
        Say which run it is also without a title: it stands beside that of another.
    marked : bool
        Draw the cell that is marked, if one is, and name it.
    lines : int
        Lines of the title.
    heading : str
        The title itself, if it is another one.
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
    film: bool = False
    named: bool = False
    marked: bool = True
    lines: int = 1
    heading: str = ""

    @property
    def headed(self) -> bool:
        """Tell whether words stand above the picture."""
        return self.title or self.named

    @property
    def title_room(self) -> float:
        """Return the height of the title, in pixels at normal letter size."""
        return TITLE_ROOM + 20.0 * (self.lines - 1)

    @property
    def top(self) -> float:
        """Return the title's part of the height."""
        return min(self.title_room * self.scale / self.size[1], 0.3) if self.headed else 0.0

    @property
    def gap(self) -> int:
        """Return the pixels between two pictures beside each other."""
        return max(round(GAP * self.scale), 1)

    @property
    def scale(self) -> float:
        """Return the size of the letters over 13 pixels."""
        return font_scale(self.size) * self.letters

    def within(self, box: tuple[int, int]) -> PictureOptions:
        """Return the same picture as large as it can be in a box of pixels."""
        width, height = self.size
        part = min(box[0] / width, box[1] / height, 1.0)
        size = tuple(max(round(part * length), SMALLEST) for length in self.size)
        letters = part * self.scale / font_scale((size[0], size[1]))
        return replace(self, size=(size[0], size[1]), letters=letters)

    def showing(self, session: Session) -> Session:
        """Return the session of the picture: nothing selected, no clutter."""
        session = as_drawn(session)
        view = session.view
        drawn: dict[Shown, bool] = {"legend": self.legend, "edges": self.edges, "triad": self.triad}
        if view.colour_by != "role":
            drawn["motion_ghost"] = False  # of a result, it would hide what is to be seen
        view = view.with_drawn(drawn)
        marked = view.marked_cell if self.marked else None
        return replace(session, view=replace(view, selected=(), marked_cell=marked))


def panes(options: PictureOptions, gap: int) -> tuple[PictureOptions, PictureOptions]:
    """Return the options of the two halves of a picture of two runs.

    The legend is at the right of the second; both have the same room for the mesh.
    """
    width, height = options.size
    strip = STRIP * options.scale if options.legend else 0.0
    first = max(round((width - strip - gap) / 2.0), 1)
    sizes = (first, height), (max(width - first - gap, 1), height)
    # Letters go by the height, which is that of the whole.
    lines = 2 if options.title else 1
    left, right = (
        replace(options, size=size, both=False, named=True, lines=lines) for size in sizes
    )
    return replace(left, legend=False), right


def title_of(session: Session, options: PictureOptions) -> str:
    """Return the words above a picture: run, step and quality; less where it is narrow."""
    frame: StepFrame | None = session.frame
    assert frame is not None
    steps = len(session.frames) - 1
    at, letters = min(session.view.frame, steps), options.size[0] / (LETTER_WIDTH * options.scale)
    longest = LONGEST.format(steps) if options.film else ""
    return title_words(session, frame, place_words(at, steps), letters, longest)


def titles_of(pair: Sequence[Session], options: PictureOptions) -> tuple[list[str], float]:
    """Return the words above two pictures beside each other, and how large their letters are.

    ``options`` is the narrower of both; 1 is the size of other titles.
    """
    return fitting(pair_titles(pair, options.title), letters_across(options))


def headings(shown: Sequence[Session], options: PictureOptions) -> tuple[list[str], float]:
    """Return the words above a picture of one session or two, and how large their letters are."""
    if len(shown) == 2:
        return titles_of(shown, panes(options, options.gap)[0])
    if not options.headed:
        return [""], 1.0
    if options.heading:
        return fitting([options.heading], letters_across(options))
    return [title_of(shown[0], options)], 1.0


def letters_across(options: PictureOptions) -> float:
    """Return the number of letters that a line of the title has room for."""
    letters = LETTER_WIDTH * options.scale / (LETTERS if options.film else 1.0)
    return (1.0 - 2.0 * CAPTION_AT) * options.size[0] / letters


def words_of_size(options: PictureOptions) -> str:
    """Return the size of a picture on paper, or in pixels, in words."""
    width, height = options.size
    if options.dpi is None:
        return f"{width} × {height} pixels"
    across, high = (2.54 * length / options.dpi for length in options.size)
    return f"{across:.1f} × {high:.1f} cm on paper, {width} × {height} pixels"
