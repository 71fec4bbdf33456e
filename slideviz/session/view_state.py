"""How a mesh is looked at, as a frozen value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from slideviz.terms import SHOWN, ColourBy, PointsShown, Shown

if TYPE_CHECKING:
    from slideviz.sections.model import Section


@dataclass(frozen=True)
class ViewState:
    """How it is looked at.

    Attributes
    ----------
    colour_by : ColourBy
        What the colours say.
    colour_range : (float, float) or None
        Values at the ends of the colour bar; None: 0 to 1 for quality, and 0 to a round number
        above the largest of all runs for the displacement.
    colour_map : str
        One of `slideviz.terms.COLOUR_MAPS`.
    threshold : (float, float) or None
        Draw only the cells whose value is in this range; None draws all.
    points : PointsShown
        Nodes drawn as points.
    drawn : frozenset of Shown
        What is drawn of that which can be left out.
    sections : tuple of Section
        What cuts the mesh.
    copies : int
        Passages drawn on each side of a periodic mesh; -1 draws all there are.
    hidden : frozenset of str
        Boundaries that are not drawn.
    selected : tuple of str
        Boundaries that are highlighted.
    frame : int
        Which frame is shown, 0 is the undeformed mesh.
    marked : int or None
        The cell that is marked, by its number in the mesh.
    beside : int or None
        The number of a run shown in a second view beside the first; 0 is the undeformed mesh.
    swapped : bool
        Whether the second view stands to the left of the first.
    ranges : tuple of (str, (float, float))
        The colour ranges of what else the view was coloured by.
    chosen : int or None
        The place of the section that is worked on.
    handle : bool
        Whether it shows its handle, to be dragged.
    """

    colour_by: ColourBy = "role"
    colour_range: tuple[float, float] | None = None
    colour_map: str = "viridis"
    threshold: tuple[float, float] | None = None
    points: PointsShown = "none"
    drawn: frozenset[Shown] = frozenset(name for name, term in SHOWN.items() if term.at_first)
    sections: tuple[Section, ...] = ()
    copies: int = 0
    hidden: frozenset[str] = frozenset()
    selected: tuple[str, ...] = ()
    frame: int = 0
    marked: int | None = None
    beside: int | None = None
    swapped: bool = False
    ranges: tuple[tuple[ColourBy, tuple[float, float]], ...] = ()
    chosen: int | None = None
    handle: bool = False

    @property
    def style(self) -> ViewState:
        """Return it without what passes: the step, what is selected or marked, the second view."""
        return replace(self, selected=(), frame=0, marked=None, beside=None, swapped=False)

    def with_drawn(self, drawn: Mapping[Shown, bool]) -> ViewState:
        """Return it with that drawn, or not."""
        on = frozenset(name for name, wanted in drawn.items() if wanted)
        return replace(self, drawn=self.drawn - drawn.keys() | on)

    @property
    def section(self) -> Section | None:
        """Return the section that is chosen."""
        if self.chosen is None or self.chosen >= len(self.sections):
            return None
        return self.sections[self.chosen]
