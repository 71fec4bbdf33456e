"""Picture options: size, background, legend and title of a picture; and the title's text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from slideviz.argument_types import frozen
from slideviz.export.offscreen import CAPTION_AT, LETTERS, SMALLEST, font_scale
from slideviz.export.titles import (
    LETTER_WIDTH,
    LONGEST,
    fitting,
    pair_titles,
    place_words,
    title_words,
)
from slideviz.scene.stage import STRIP
from slideviz.session.colors import with_drawable_colors
from slideviz.session.state import Session, StepFrame, ViewState
from slideviz.terms import Shown

Background = Literal["white", "shown", "transparent"]
BACKGROUNDS: dict[Background, str] = {
    "white": "white",
    "shown": "as in the view",
    "transparent": "transparent",
}
"""The kinds of background, and their words in the dialog."""
TITLE_ROOM = 40.0
"""Height of a title of one line in pixels, at normal letter size; a second line adds 20."""
GAP = 12.0  # distance in pixels between two pictures side by side, at normal letter size


@frozen
class PictureOptions:
    """Size, background, legend, title and camera of a picture of a view."""

    size: tuple[int, int] = (1600, 1000)
    """(int, int): width and height in pixels."""
    background: Background = "white"
    legend: bool = True
    edges: bool = True
    triad: bool = False
    """`legend`, `edges`, `triad`: whether there are the legend of roles or the color bar; edges of
    cells; the axes."""
    title: bool = False
    """Whether there is a title: what is shown, with minimum, mean and inverted cells."""
    fill: bool = True
    """Whether the whole mesh is fitted to the picture, instead of the view's part of it."""
    both: bool = True
    """Whether the session of the second view is drawn too, if there is one."""
    letters: float = 1.25
    """Size of the letters; 1 is 13 pixels in a picture 620 pixels high."""
    dpi: float | None = None
    """Pixels per inch on paper, stored in the file."""
    film: bool = False
    """Whether it is an image of a film."""
    named: bool = False
    """Whether it has the name of its run even without a title, as one of two side by side."""
    marked: bool = True
    """Whether the marked cell is drawn, with its number and value."""
    case: bool = True
    """Whether the file of a picture of a view has the case with that view as text."""
    lines: int = 1
    """Number of lines of the title."""
    heading: str = ""
    """A title instead of the usual one; empty for the usual one."""

    @property
    def headed(self) -> bool:
        """Return whether there is a text above the mesh: a title, or the name of the run."""
        return self.title or self.named

    @property
    def title_room(self) -> float:
        """Return the height of the title, in pixels at normal letter size."""
        return TITLE_ROOM + 20.0 * (self.lines - 1)

    @property
    def top(self) -> float:
        """Return the height of the title relative to the picture; 0 without one, 0.3 at most."""
        return min(self.title_room * self.scale / self.size[1], 0.3) if self.headed else 0.0

    @property
    def gap(self) -> int:
        """Return the distance in pixels between two pictures side by side."""
        return max(round(GAP * self.scale), 1)

    @property
    def scale(self) -> float:
        """Return the size of the letters in units of 13 pixels, and so of all lengths in pixels."""
        return font_scale(self.size) * self.letters

    def like(self, view: ViewState) -> PictureOptions:
        """Return the options of a picture that draws what a view draws."""
        drawn = view.drawn
        return replace(
            self, legend="legend" in drawn, edges="edges" in drawn, triad="triad" in drawn
        )

    def within(self, box: tuple[int, int]) -> PictureOptions:
        """Return the options of the same picture, scaled down to fit a box of pixels."""
        width, height = self.size
        part = min(box[0] / width, box[1] / height, 1.0)
        size = tuple(max(round(part * length), SMALLEST) for length in self.size)
        letters = part * self.scale / font_scale((size[0], size[1]))
        return replace(self, size=(size[0], size[1]), letters=letters)

    def drawn_session(self, session: Session) -> Session:
        """Return the session as the picture shows it: the view's toggles replaced by the options.

        Nothing is selected, and the motions' ghosts are left out if values are shown.
        """
        session = with_drawable_colors(session)
        view = session.view
        drawn: dict[Shown, bool] = {"legend": self.legend, "edges": self.edges, "triad": self.triad}
        if view.color_by != "role":
            drawn["motion_ghost"] = False  # it would hide the values
        view = view.with_drawn(drawn)
        marked = view.marked_cell if self.marked else None
        return replace(session, view=replace(view, selected=(), marked_cell=marked))


def panes(options: PictureOptions, gap: int) -> tuple[PictureOptions, PictureOptions]:
    """Return the options of the left and the right part of a picture of two runs, ``gap`` apart.

    The legend is at the right of the second; both parts have the same width for the mesh.
    """
    width, height = options.size
    strip = STRIP * options.scale if options.legend else 0.0
    first = max(round((width - strip - gap) / 2.0), 1)
    # Letters go by the height, which is that of the whole.
    part = replace(options, both=False, named=True, lines=2 if options.title else 1)
    left = replace(part, size=(first, height), legend=False)
    return left, replace(part, size=(max(width - first - gap, 1), height))


def line_between(options: PictureOptions) -> slice:
    """Return the columns of the line between two pictures, from the end of the left one."""
    wide = max(round(options.scale), 1)
    start = (options.gap - wide) // 2
    return slice(start, start + wide)


def title_of(session: Session, options: PictureOptions) -> str:
    """Return the title of a picture: run, step and quality; shortened to fit its width."""
    frame: StepFrame | None = session.frame
    assert frame is not None
    at = min(session.view.frame, len(session.frames) - 1)
    letters = options.size[0] / (LETTER_WIDTH * options.scale)
    longest = LONGEST.format(session.planned) if options.film else ""
    return title_words(session, frame, place_words(at, session.planned), letters, longest)


def headings(shown: Sequence[Session], options: PictureOptions) -> tuple[list[str], float]:
    """Return the titles of a picture of one session or two, and their letters' relative size."""
    if len(shown) == 2:
        narrower = panes(options, options.gap)[0]
        return fitting(pair_titles(shown, options.title), letters_across(narrower))
    if not options.headed:
        return [""], 1.0
    if options.heading:
        return fitting([options.heading], letters_across(options))
    return [title_of(shown[0], options)], 1.0


def letters_across(options: PictureOptions) -> float:
    """Return the number of letters that fit into a line of the title."""
    letters = LETTER_WIDTH * options.scale / (LETTERS if options.film else 1.0)
    return (1.0 - 2.0 * CAPTION_AT) * options.size[0] / letters


def size_words(options: PictureOptions) -> str:
    """Return the size of a picture on paper, or in pixels, in words."""
    width, height = options.size
    if options.dpi is None:
        return f"{width} × {height} pixels"
    across = 2.54 * width / options.dpi
    high = 2.54 * height / options.dpi
    return f"{across:.1f} × {high:.1f} cm on paper, {width} × {height} pixels"
