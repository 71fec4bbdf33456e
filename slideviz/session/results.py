"""The results of runs, as frozen values: steps, each with its quality."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.case.model import Case
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import INVERTED, Quality
from slideviz.terms import ColourBy

if TYPE_CHECKING:
    from slideviz.deformation.solver import Step


LABEL = 20
"""Letters of the name of a run that a plot has room for."""


@dataclass(frozen=True, eq=False)
class Frame:
    """The mesh after a step, with its quality; the first frame is the undeformed mesh."""

    mesh: Mesh
    quality: Quality
    step: Step | None = None

    def values(self, what: ColourBy, undeformed: Mesh | None = None) -> FloatArray:
        """Return the value of every cell, (m,), in a quantity.

        Quality is in 0 to 1. The displacement of a cell is the mean distance of its nodes from
        where they are in ``undeformed``, in the mesh's length unit.
        """
        if what == "displacement":
            return cell_displacement(self.mesh, undeformed or self.mesh)
        if what == "size":
            return self.quality.size
        return self.quality.skew if what == "skew" else self.quality.values

    def shown_values(self, what: ColourBy, undeformed: Mesh | None = None) -> FloatArray:
        """Return `values` for colours: not a number where a cell is inverted."""
        return np.where(self.quality.status == INVERTED, np.nan, self.values(what, undeformed))


@dataclass(frozen=True, eq=False)
class Run:
    """A deformation that was computed: its case and its steps.

    Attributes
    ----------
    number : int
        From 1, in the order of the starts; never used twice in a session.
    case : Case
        The settings.
    frames : tuple of Frame
        The steps, without the undeformed mesh.
    end : {"", "done", "cancelled", "failed"}
        How it ended; empty while it goes on.
    saved : bool
        Whether the mesh of its last step was written.
    name : str
        What the user calls it; empty as long as nobody did.
    undeformed : Frame or None
        The undeformed mesh, where the metric of this run judges it otherwise than the session's.
    """

    number: int
    case: Case
    frames: tuple[Frame, ...] = ()
    end: Literal["", "done", "cancelled", "failed"] = ""
    saved: bool = False
    name: str = ""
    undeformed: Frame | None = None

    @property
    def label(self) -> str:
        """Return the name of the run in plots: its number, and the begin of its own name."""
        if not self.name:
            return f"run {self.number}"
        short = self.name if len(self.name) <= LABEL else f"{self.name[: LABEL - 1].rstrip()}…"
        return f"{self.number} {short}"

    @property
    def last(self) -> Frame | None:
        """Return the frame of the last step."""
        return self.frames[-1] if self.frames else None

    @property
    def seconds(self) -> float:
        """Return the seconds that the steps took, without reading and drawing."""
        return sum(sum(f.step.seconds.values()) for f in self.frames if f.step is not None)


def cell_displacement(mesh: Mesh, undeformed: Mesh) -> FloatArray:
    """Return the mean distance of the nodes of each cell from where they were, (m,)."""
    moved = mesh.points - undeformed.points
    shift = np.sqrt(np.einsum("nd,nd->n", moved, moved))
    offsets = mesh.cells.offsets
    total = np.add.reduceat(shift[mesh.cells.connectivity], offsets[:-1])
    return np.asarray(total / np.diff(offsets))
