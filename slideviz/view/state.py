"""What the window shows, as frozen values: mesh, case, guesses, computed frames, view settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from slideviz.case.model import Case, Role
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import Quality

if TYPE_CHECKING:
    from slideviz.staircase import Step

ColourBy = Literal["role", "size_skew", "size", "skew"]

COLOUR_BY: dict[ColourBy, str] = {
    "role": "role",
    "size_skew": "size-skew",
    "size": "size",
    "skew": "skew",
}
"""What the view can be coloured by, and the words for it."""


@dataclass(frozen=True)
class Guess:
    """A role that was not chosen but read from the name or from a match, and why."""

    role: Role
    reason: str


@dataclass(frozen=True, eq=False)
class Frame:
    """The mesh after a step, with its quality; the first frame is the undeformed mesh."""

    mesh: Mesh
    quality: Quality
    step: Step | None = None

    def values(self, what: ColourBy) -> FloatArray:
        """Return the number of every cell, (m,), that ``what`` stands for, each in 0 to 1."""
        if what == "size":
            return self.quality.size
        return self.quality.skew if what == "skew" else self.quality.values


@dataclass(frozen=True)
class ViewState:
    """How it is looked at.

    Attributes
    ----------
    colour_by : {"role", "size_skew", "size", "skew"}
        What the colours say.
    edges : bool
        Draw the edges of the cells.
    undeformed : bool
        Draw the undeformed boundaries as a ghost.
    motion_ghost : bool
        Draw where the motions take the moving boundaries.
    legend : bool
        Draw the legend or the colour bar.
    perspective : bool
        Perspective instead of parallel projection (3D only).
    hidden : frozenset of str
        Boundaries that are not drawn.
    selected : tuple of str
        Boundaries that are highlighted.
    frame : int
        Which frame is shown, 0 is the undeformed mesh.
    """

    colour_by: ColourBy = "role"
    edges: bool = True
    undeformed: bool = False
    motion_ghost: bool = True
    legend: bool = True
    perspective: bool = False
    hidden: frozenset[str] = frozenset()
    selected: tuple[str, ...] = ()
    frame: int = 0


@dataclass(frozen=True, eq=False)
class Session:
    """All that is open: what was read, what is asked, what came out, how it is looked at.

    Attributes
    ----------
    mesh : Mesh or None
        The undeformed mesh; None before anything is open.
    path : Path or None
        The mesh file.
    case : Case
        What is asked, guesses included.
    guesses : mapping of str to Guess
        The boundaries whose role nobody has confirmed yet.
    pairs : tuple of Pair
        Boundaries that match each other.
    frames : tuple of Frame
        The undeformed mesh and every step computed.
    ran : Case or None
        What the steps were computed with.
    saved : Case or None
        What is on disk, or what was there at the start.
    unsaved_mesh : bool
        Steps were computed and their mesh has not been written.
    reduction_guess : str
        Why data reduction was switched on without being asked for; empty when it was not.
    clash : str
        What the motions put through what, in a sentence; empty as far as is known.
    """

    mesh: Mesh | None = None
    path: Path | None = None
    case: Case = field(default_factory=Case)
    guesses: Mapping[str, Guess] = field(default_factory=dict)
    pairs: tuple[Pair, ...] = ()
    frames: tuple[Frame, ...] = ()
    ran: Case | None = None
    saved: Case | None = None
    unsaved_mesh: bool = False
    view: ViewState = field(default_factory=ViewState)
    reduction_guess: str = ""
    clash: str = ""

    @property
    def frame(self) -> Frame | None:
        """Return the frame that is shown."""
        if not self.frames:
            return None
        return self.frames[min(self.view.frame, len(self.frames) - 1)]

    @property
    def deformed(self) -> Frame | None:
        """Return the last step that was computed."""
        return self.frames[-1] if len(self.frames) > 1 else None

    @property
    def unsaved_case(self) -> bool:
        """Tell whether the case differs from what was saved or opened."""
        return self.mesh is not None and self.saved is not None and self.case != self.saved

    @property
    def outdated(self) -> bool:
        """Tell whether the steps shown were computed with other settings than now."""
        return (
            self.ran is not None
            and len(self.frames) > 1
            and essence(self.ran) != essence(self.case)
        )

    def role(self, marker: str) -> Role:
        """Return the role of a boundary; those nobody named are fixed."""
        return self.case.roles.get(marker, "fixed")


def essence(case: Case) -> Case:
    """Return the case without what does not change the result: file names, order of roles."""
    roles = {name: role for name, role in sorted(case.roles.items()) if role != "fixed"}
    return replace(case, roles=roles, mesh_out=None, source=None, warnings=())
