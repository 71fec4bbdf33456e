"""The results of a run: its progress, its steps, and the numbers of steps that STEPS= auto tried.

Steps are made in `slideviz.solver.stepping`, their number is chosen in `slideviz.solver.deform`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import field as made_by
from dataclasses import fields, replace
from functools import cached_property
from itertools import chain
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import Remark, SlidevizError
from slideviz.mesh.margin import SafeFraction
from slideviz.mesh.margin import chain as chained_safety
from slideviz.mesh.model import FloatArray, IntArray, Mesh, Skin, sealed
from slideviz.mesh.zones import join_zones, names_from
from slideviz.rbf.field import Field
from slideviz.rbf.layers import KeptLayers
from slideviz.rbf.problem import Cycle, PhaseTimer, Relaxed

if TYPE_CHECKING:
    from slideviz.case.limits import LimitResult
    from slideviz.mesh.quality import Quality
    from slideviz.mesh.walls import Walls


@frozen
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


Report = Callable[[Progress], None]
"""What is told how far a run is."""


def step_timer(
    report: Report,
    step: int = 1,
    total: int = 1,
    seconds: dict[str, float] | None = None,
) -> PhaseTimer:
    """Return a timer that reports the phases of one step of ``total``, and adds to ``seconds``."""
    return PhaseTimer(
        lambda phase, fraction: report(Progress(step, total, phase, fraction)),
        {} if seconds is None else seconds,
    )


@frozen
class Trial:
    """A trial of STEPS= auto: a number of steps, and the quality it gave."""

    planned: int
    steps: int
    """`planned`, `steps`: steps planned, and made: more where steps that folded cells were
    halved."""
    min: float
    mean: float  # `min`, `mean`: minimum and mean quality of the result
    inverted: int  # inverted cells of the result


@record
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

    @classmethod
    def joined(
        cls, mesh: Mesh, now: Mesh, repairs: Mapping[int, MeshRepair | None]
    ) -> MeshRepair | None:
        """Return the repairs of zones, by their places in the mesh, as one; None if there are none.

        ``mesh`` and ``now``: of all zones, undeformed and repaired.
        """
        done = [(mesh.parts[k], one) for k, one in repairs.items() if one is not None]
        if not done:
            return None

        def numbers(name: str, start: str = "first_cell") -> IntArray:
            each = [getattr(one, name) + getattr(part, start) for part, one in done]
            return sealed(np.concatenate(each))

        if isinstance(mesh, Skin):  # of streamed zones, the bad cells and the moved nodes
            parts = [(place, one.mesh.numbering) for place, one in done]
            points = np.concatenate([each.points + place.first_point for place, each in parts])
            cells = np.concatenate([each.cells + place.first_cell for place, each in parts])
            part = replace(mesh.part, points=sealed(points), cells=sealed(cells))
            bare = join_zones([replace(one.mesh, markers=()) for _, one in done])
            now = Skin(bare.points, bare.cells, name=bare.name, part=part)
        return cls(
            mesh=now,
            cells=numbers("cells"),
            left=numbers("left"),
            folded=numbers("folded"),
            folded_left=numbers("folded_left"),
            nodes=numbers("nodes", "first_point"),
            points=sealed(np.concatenate([one.points for _, one in done])),
            largest_move=max(one.largest_move for _, one in done),
            unmendable=tuple(
                (cell + part.first_cell, why) for part, one in done for cell, why in one.unmendable
            ),
            warnings=tuple(text for _, one in done for text in one.warnings),
        )

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
        return f"{len(self.cells) - poor:,} of {len(self.cells):,} poor cells mended"

    @property
    def moves(self) -> str:
        """How many nodes were moved, and how far, in words."""
        nodes = f"{len(self.nodes):,} node{'' if len(self.nodes) == 1 else 's'}"
        return f"{nodes} moved by up to {self.largest_move:.3g}"


def _counted(values: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    total: Counter[str] = Counter()
    for value in values:
        total.update(value)
    return dict(total)


def _chained(values: Iterable[Iterable[Any]]) -> tuple[Any, ...]:
    return tuple(chain.from_iterable(values))


def _joined_layers(values: Iterable[KeptLayers]) -> KeptLayers:
    each = list(values)
    return KeptLayers(
        _chained(one.walls for one in each),
        sum(one.nodes for one in each),
        _chained(one.gave_way for one in each),
    )


def by(rule: Callable[[list[Any]], Any], *, new: bool = False) -> dict[str, Any]:
    """Return the metadata of a field of a step: what joins the values that zones have, if any.

    ``new``: only those of steps that were not in the round before.
    """
    return {"joined": rule, "new": new}


@record
class Step:
    """The mesh after one step.

    Of a mesh with several zones each is deformed alone; each field has a rule that joins the values
    of the zones (`joined`).
    """

    index: int
    total: int
    """`index`, `total`: number of the step, from 1, and of all steps."""
    mesh: Mesh
    """The deformed mesh."""
    control_nodes: int = made_by(metadata=by(sum))
    """Nodes in the interpolation system of this step, or of known displacement where a method has
    no such system."""
    max_error: float = made_by(metadata=by(max))
    """Largest misfit at nodes of known or projected displacement before the correction sets them
    exactly, with data reduction that of all steps so far, in the mesh's length unit."""
    condition: float = made_by(
        metadata=by(lambda values: max(filter(isfinite, values), default=nan))
    )
    """Estimated condition number of the interpolation system; NaN where a method has none."""
    node_counts: Mapping[str, int] = made_by(metadata=by(_counted))
    """``moving``, ``fixed``, ``sliding_edge``, ``sliding_surface``, ``internal``."""
    seconds: Mapping[str, float] = made_by(metadata=by(_counted, new=True))
    """Spent in this step, by phase; ``classify`` only in the first."""
    messages: tuple[Remark, ...] = made_by(metadata=by(_chained))
    """What the user should know of case, mesh and all steps so far."""
    history: tuple[Cycle, ...] = made_by(default=(), metadata=by(_chained, new=True))
    """Convergence of the greedy selection in this step; empty without data reduction."""
    tried: tuple[Trial, ...] = made_by(default=(), metadata=by(_chained, new=True))
    """The numbers of steps tried by STEPS= auto; empty but in the last step of such a run."""
    control: IntArray = made_by(
        default_factory=lambda: np.empty(0, np.int64), metadata=by(np.concatenate)
    )
    """(c,): the control nodes of this step; empty where a method has none."""
    candidates: int = made_by(default=0, metadata=by(sum))
    """Nodes that could have been control nodes; periodic images count as one."""
    tolerance: float | None = made_by(default=None, metadata=by(max))
    """The tolerance of the data reduction, in the mesh's length unit; None where there was none."""
    layers: float = made_by(default=0.0, metadata=by(max))
    """The tolerance that layers at moving boundaries need where it is smaller than ``tolerance``
    (`slideviz.solver.setup.LAYER`); else 0."""
    periodic_misfit: float | None = made_by(default=None, metadata=by(max))
    """Largest difference of the displacements of periodic images so far, in the mesh's length unit.
    It is rounding only, since more raises. None where images need not move alike."""
    part: float = 1.0
    """The part of the whole displacement that is reached after this step, 0 to 1."""
    support_radius: float | None = made_by(default=None, metadata=by(max))
    """Of the radial functions, in the mesh's length unit; None where a method has none."""
    field: Field | None = made_by(default=None, metadata=by(lambda _: None))
    """The function that displaced the nodes off the boundary in this step; kept in streamed
    runs."""
    relaxed: Relaxed | None = made_by(default=None, metadata=by(Relaxed.joined, new=True))
    """How the step was relaxed; None where it was not."""
    repaired: MeshRepair | None = None
    """The repair after the step; None where there was none."""
    kept_layers: KeptLayers | None = made_by(default=None, metadata=by(_joined_layers))
    """The walls that carried the nodes near them along (LAYERS); None where none did."""
    safe: SafeFraction | None = made_by(
        default=None,
        metadata=by(lambda values: min(values, key=lambda one: one.fraction), new=True),
    )
    """How far this step, straight on, may go until the first cell folds; None where it was not
    asked for."""
    check_limits: Callable[[Mesh], tuple[LimitResult, ...]] | None = made_by(
        default=None, metadata=by(lambda _: None)
    )
    """Returns whether a mesh meets each limit of the case; None where it has none."""

    @classmethod
    def joined(
        cls,
        mesh: Mesh,
        now: Mesh,
        steps: Mapping[int, Step],
        new: Collection[int],
        leader: Step,
    ) -> Step:
        """Return the steps of zones, by their places in a mesh, as one of that mesh.

        ``mesh`` and ``now``: of all zones, undeformed and after the steps. ``new``: the zones that
        have another step than in the round before. ``leader``: the step that numbers this one.
        """
        each = {k: step.of_mesh(mesh, k) for k, step in steps.items()}
        repairs = {k: steps[k].repaired for k in steps if k in new}
        values = dict[str, Any]()
        for one in fields(cls):
            if one.metadata:
                some = [k for k in each if k in new or not one.metadata["new"]]
                known = [v for k in some if (v := getattr(each[k], one.name)) is not None]
                values[one.name] = one.metadata["joined"](known) if known else None
        return replace(leader, mesh=now, repaired=MeshRepair.joined(mesh, now, repairs), **values)

    def of_mesh(self, mesh: Mesh, zone: int) -> Step:
        """Return the step of a zone, by its place, with the numbers and names of a mesh of all."""
        part = mesh.parts[zone]
        safe = self.safe
        if safe is not None and safe.cell is not None:
            safe = replace(safe, cell=safe.cell + part.first_cell, zone=zone + 1)
        layers = self.kept_layers
        if layers is not None:
            label = names_from(mesh, part)
            walls = [(tuple(map(label.__getitem__, wall)), size) for wall, size in layers.walls]
            gave_way = [
                replace(one, names=tuple(map(label.__getitem__, one.names)))
                for one in layers.gave_way
            ]
            layers = replace(layers, walls=tuple(walls), gave_way=tuple(gave_way))
        return replace(
            self,
            control=self.control + part.points.start,
            safe=safe,
            kept_layers=layers,
            messages=SlidevizError(*self.messages).within(f"zone {zone + 1}"),
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """The texts of ``messages``."""
        return tuple(map(str, self.messages))

    @cached_property
    def limits(self) -> tuple[LimitResult, ...]:
        """Return whether the mesh meets each limit of the case; measured when first asked for."""
        return () if self.check_limits is None else self.check_limits(self.mesh)


@record
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
    return chained_safety(known) if known else None
