"""The results of a run: its progress, its steps, and the numbers of steps that STEPS= auto tried.

Steps are made in `slideviz.solver.stepping`, their number is chosen in `slideviz.solver.deform`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from dataclasses import field as made_by
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.mesh.margin import SafeFraction, chain
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.rbf.field import Field
from slideviz.rbf.layers import KeptLayers
from slideviz.rbf.problem import Cycle, PhaseTimer, Relaxed

if TYPE_CHECKING:
    from slideviz.case.limits import LimitResult
    from slideviz.mesh.quality import Quality
    from slideviz.mesh.walls import Walls


@dataclass(frozen=True)
class Progress:
    """How far a run is."""

    step: int
    total: int  # `step`, `total`: the number of the current step, from 1, and of all steps
    phase: str
    """``classify``, ``select``, ``solve``, ``evaluate``, ``project``, ``correct``, ``layers``,
    ``relax`` or ``repair``; in a streamed run also ``read``, ``quality`` and ``write``."""
    fraction: float  # the part of the phase that is done, 0 to 1
    left: float | None = None
    """Estimate of the seconds that the whole run will still take; None where there is none."""
    zone: int | None = None
    """Number of the zone that is deformed, where the mesh has several: one zone is deformed after
    the other, and the steps are those of all of them."""

    @property
    def of_zone(self) -> str:
        """Return the zone in words, for the end of a sentence; "" where there is only one."""
        return "" if self.zone is None else f" of zone {self.zone}"


def step_timer(
    report: Callable[[Progress], None],
    step: int = 1,
    total: int = 1,
    seconds: dict[str, float] | None = None,
) -> PhaseTimer:
    """Return a timer that reports the phases of one step of ``total``, and adds to ``seconds``."""
    return PhaseTimer(
        lambda phase, fraction: report(Progress(step, total, phase, fraction)),
        {} if seconds is None else seconds,
    )


@dataclass(frozen=True)
class Trial:
    """A trial of STEPS= auto: a number of steps, and the quality it gave."""

    planned: int
    steps: int
    """`planned`, `steps`: steps planned, and made: more where steps that folded cells were
    halved."""
    min: float
    mean: float  # `min`, `mean`: minimum and mean quality of the result
    inverted: int  # inverted cells of the result


@dataclass(frozen=True, eq=False)
class MeshRepair:
    """A mesh after repair, and what was mended."""

    mesh: Mesh  # the repaired mesh; of a streamed one only the bad cells and the moved nodes
    cells: IntArray
    left: IntArray
    """`cells`, `left` (k,), (l,): the numbers of the bad cells before and after: those that are not
    proved valid, or below the limit."""
    folded: IntArray
    folded_left: IntArray
    """`folded`, `folded_left` (f,), (g,): those of them that are not proved valid."""
    nodes: IntArray  # (m,): the numbers of the nodes that were moved
    points: FloatArray  # (m, d): where they were
    largest_move: float  # the farthest that one was moved, in the mesh's length unit
    unmendable: tuple[tuple[int, str], ...] = ()
    """Cells of ``left`` that no motion of the free nodes mends, each with the reason."""
    warnings: tuple[str, ...] = ()  # what the user should know

    def report(self) -> dict[str, Any]:
        """Return the entry ``repair`` of a report."""
        return {
            "cells_before": len(self.cells),
            "cells_after": len(self.left),
            "folded_before": len(self.folded),
            "folded_after": len(self.folded_left),
            "nodes_moved": len(self.nodes),
            "largest_move": self.largest_move,
            "unmendable": [{"cell": cell, "reason": why} for cell, why in self.unmendable],
        }

    def words(self) -> str:
        """Return what was mended in words: ``303 of 303 folded cells mended, 66 are poor``."""
        before = len(self.folded)
        after = len(self.folded_left)
        poor = len(self.left) - after
        if before:
            verb = "is" if poor == 1 else "are"
            left = f", {poor:,} {verb} poor" if poor else ""
            return f"{before - after:,} of {before:,} folded cells mended{left}"
        if not len(self.cells):
            return "no cell needs repair"
        if poor > len(self.cells):  # the lowest quality counts first
            return f"lowest quality raised, {poor:,} cells are poor instead of {len(self.cells):,}"
        return f"{len(self.cells) - poor:,} of {len(self.cells):,} poor cells mended"

    @property
    def moves(self) -> str:
        """How many nodes were moved, and how far, in words."""
        nodes = f"{len(self.nodes):,} node{'' if len(self.nodes) == 1 else 's'}"
        return f"{nodes} moved by up to {self.largest_move:.3g}"


@dataclass(frozen=True, eq=False)
class Step:
    """The mesh after one step."""

    index: int
    total: int
    """`index`, `total`: number of the step, from 1, and of all steps."""
    mesh: Mesh
    """The deformed mesh."""
    control_nodes: int
    """Nodes in the interpolation system of this step, or of known displacement where a method has
    no such system."""
    max_error: float
    """Largest misfit at nodes of known or projected displacement before the correction sets them
    exactly, with data reduction that of all steps so far, in the mesh's length unit."""
    condition: float
    """Estimated condition number of the interpolation system; NaN where a method has none."""
    node_counts: Mapping[str, int]
    """``moving``, ``fixed``, ``sliding_edge``, ``sliding_surface``, ``internal``."""
    seconds: Mapping[str, float]
    """Spent in this step, by phase; ``classify`` only in the first."""
    warnings: tuple[str, ...]
    """What the user should know of case, mesh and all steps so far."""
    history: tuple[Cycle, ...] = ()
    """Convergence of the greedy selection in this step; empty without data reduction."""
    tried: tuple[Trial, ...] = ()
    """The numbers of steps tried by STEPS= auto; empty but in the last step of such a run."""
    control: IntArray = made_by(default_factory=lambda: np.empty(0, np.int64))
    """(c,): the control nodes of this step; empty where a method has none."""
    candidates: int = 0
    """Nodes that could have been control nodes; periodic images count as one."""
    tolerance: float | None = None
    """The tolerance of the data reduction, in the mesh's length unit; None where there was none."""
    layers: float = 0.0
    """The tolerance that layers at moving boundaries need where it is smaller than ``tolerance``
    (`slideviz.solver.setup.LAYER`); else 0."""
    periodic_misfit: float | None = None
    """Largest difference of the displacements of periodic images so far, in the mesh's length unit.
    It is rounding only, since more raises. None where images need not move alike."""
    part: float = 1.0
    """The part of the whole displacement that is reached after this step, 0 to 1."""
    support_radius: float | None = None
    """Of the radial functions, in the mesh's length unit; None where a method has none."""
    field: Field | None = None
    """The function that displaced the nodes off the boundary in this step; kept in streamed
    runs."""
    relaxed: Relaxed | None = None
    """How the step was relaxed; None where it was not."""
    repaired: MeshRepair | None = None
    """The repair after the step; None where there was none."""
    kept_layers: KeptLayers | None = None
    """The walls that carried the nodes near them along (LAYERS); None where none did."""
    safe: SafeFraction | None = None
    """How far this step, straight on, may go until the first cell folds; None where it was not
    asked for."""
    check_limits: Callable[[Mesh], tuple[LimitResult, ...]] | None = None
    """Returns whether a mesh meets each limit of the case; None where it has none."""

    @cached_property
    def limits(self) -> tuple[LimitResult, ...]:
        """Return whether the mesh meets each limit of the case; measured when first asked for."""
        return () if self.check_limits is None else self.check_limits(self.mesh)


@dataclass(frozen=True, eq=False)
class RunResult:
    """The outcome of a run, in memory or from file to file."""

    mesh: Mesh
    """The undeformed mesh; of one in a file the points of its skin, without cells and elements of
    markers."""
    steps: tuple[Step, ...]
    """Their meshes are the deformed ``mesh``, their ``node_counts`` those of the whole mesh."""
    quality: Quality
    undeformed: Quality
    """`quality`, `undeformed`: quality of all cells after and before the run; of a mesh in a file
    without ``size`` and ``skew``."""
    folded: dict[int, tuple[int, int]]
    """dict of int to (int, int): VTK type of inverted cells, and the step after which they are
    first inverted, by cell number; at most ``listed``, those with the lowest numbers."""
    seconds: dict[str, float]  # spent by phase, besides those of the steps
    walls: Walls | None = None
    """The layers at the boundaries, compared with those of ``mesh``; None of one in a file."""

    @property
    def safe(self) -> SafeFraction | None:
        """Return how far the run may go; None if that was not asked for."""
        return safe_fraction_of(self.steps)


def safe_fraction_of(steps: Iterable[Step]) -> SafeFraction | None:
    """Return how far the run of some steps may go; None if that was not asked for."""
    known = [(step.part, step.safe) for step in steps if step.safe is not None]
    return chain(known) if known else None
