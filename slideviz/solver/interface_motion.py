"""Deforming several zones of a mesh: each by its case alone, with what coincides kept together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.moving_nodes import moving_nodes
from slideviz.errors import Message, SlidevizError
from slideviz.mesh.interfaces import (
    ROUNDING,
    disjoint_interfaces,
    named_interfaces,
    torn_interfaces,
)
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh, ZoneInterface, sealed
from slideviz.mesh.zones import names_in, with_zones
from slideviz.solver.growth import check_motion
from slideviz.solver.prepare import Prepared, prepare
from slideviz.solver.rims import on_walls
from slideviz.solver.steps import Progress, Report, Step
from slideviz.terms import Role

Run = Callable[[Prepared, Report], Iterator[Step]]
"""Deforms one zone."""
FOLLOWING = ("fixed", "sliding", "internal")  # roles of boundaries that follow another zone's


class InterfaceMotion:
    """The cases of zones, in which nodes of interfaces follow nodes of the zone that moves them.

    A moving boundary leads the boundaries of other zones that coincide with it and do not move by
    themselves. A sliding boundary leads the coinciding boundaries of zones that are deformed later.
    A boundary that follows gets the role moving.
    """

    def __init__(self, prepared: Prepared, mesh: Assembly) -> None:
        case = prepared.case
        self.mesh = mesh
        self.roles = case.roles
        self.names = case.interfaces  # those of MARKER_ZONE_INTERFACE
        self.interfaces = named_interfaces(mesh, case.interfaces)
        self._alone = prepared.zones
        self.cases = [zone.case for zone in self._alone]
        """The case of each zone."""
        self.warnings = *prepared.alone.warnings, *disjoint_interfaces(mesh, case.interfaces)
        """Those of the case, of files of several zones, and on pairs that do not coincide."""
        self.led = np.zeros(len(mesh.points), bool)
        """(n,) bool: the nodes that follow others."""
        self.leader = np.arange(len(mesh.points))
        """(n,): the node that each of them follows."""
        self._vectors = np.zeros_like(mesh.points)
        self._names: list[set[str]] = [set() for _ in self.cases]
        self._zone = {n: k for k, part in enumerate(mesh.parts) for n in names_in(mesh, part)}
        asked = [each for each in self.interfaces if self.roles.get(each.marker) == "moving"]
        for index in self.moving(range(len(self.cases))):
            zone = self._alone[index]
            moved = on_walls(zone.case, zone.mesh, moving_nodes(zone.case, zone.mesh))
            shift = np.zeros_like(mesh.points)
            shift[mesh.parts[index].points][moved.nodes] = moved.vectors
            self._lead(index, shift, asked, range(len(self.cases)))

    def moving(self, zones: Collection[int]) -> list[int]:
        """Return the zones among ``zones`` that move."""
        return [index for index in zones if self.cases[index].markers_with("moving")]

    def first(self, zones: list[int]) -> int:
        """Return the zone with the fewest boundaries that follow another zone.

        Where rims are kept on walls (RIMS= SLIDE), those that others lead by moving count, too.
        """
        leading = {("fixed", "sliding")}
        if any(zone.case.rims == "slide" for zone in self._alone):
            leading |= {(role, "moving") for role in FOLLOWING}

        def led(index: int) -> int:
            return sum(
                self._zone[each.marker] == index
                and each.zone - 1 in zones
                and (self.roles.get(each.marker, "fixed"), self.roles.get(each.other, "fixed"))
                in leading
                for each in self.interfaces
            )

        return min(zones, key=led)

    def leaders_first(self) -> Iterator[tuple[int, set[int]]]:
        """Return each zone that moves, in the order to deform them, and those that come after it.

        Before the next one, `slid` says where the zone has come to.
        """
        ahead = set(range(len(self.cases)))
        while moving := self.moving(sorted(ahead)):
            index = self.first(moving)
            ahead.remove(index)
            yield index, ahead

    def slid(self, index: int, shift: FloatArray, moving: IntArray, zones: Collection[int]) -> None:
        """Let ``zones`` follow a zone whose points have moved by ``shift`` (m, d).

        Those boundaries of it lead that have nodes which are among its ``moving`` points (k,).
        """
        part = self.mesh.parts[index]
        moved = np.zeros_like(self.mesh.points)
        moved[part.points] = shift
        leading = [
            each
            for each in self.interfaces
            if self.roles.get(each.marker, "fixed") != "moving"
            and np.isin(each.nodes, moving + part.points.start).any()
        ]
        self._lead(index, moved, leading, zones)

    def _lead(
        self,
        index: int,
        shift: FloatArray,
        leading: Iterable[ZoneInterface],
        zones: Collection[int],
    ) -> None:
        for each in leading:
            follows = self.roles.get(each.other, "fixed") in FOLLOWING
            if follows and self._zone[each.marker] == index and each.zone - 1 in zones:
                self._follow(each, shift)

    def _follow(self, each: ZoneInterface, shift: FloatArray) -> None:
        new = ~self.led[each.partners]
        nodes = each.partners[new]
        leaders = each.nodes[new]
        self.led[nodes] = True
        self.leader[nodes] = leaders
        self._vectors[nodes] = shift[leaders]
        index = each.zone - 1
        part = self.mesh.parts[index]
        alone = self._alone[index].case
        self._names[index] |= {names_in(self.mesh, part)[each.other]}
        here = np.flatnonzero(self.led[part.points])
        vectors = self._vectors[part.points][here]
        names = tuple(name for name in part.mesh.marker_names if name in self._names[index])
        roles: dict[str, Role] = {**alone.roles, **dict.fromkeys(names, "moving")}
        motions = *alone.motions, Prescribed(here, vectors, names)
        self.cases[index] = alone.change(roles=roles, motions=motions)

    def prepared(self, index: int) -> Prepared:
        """Return a zone with its case, checked again if it follows others."""
        zone = self._alone[index]
        case = self.cases[index]
        return zone if case is zone.case else prepare(case, zone.mesh)

    def after(self, steps: Mapping[int, Step]) -> Assembly:
        """Return the mesh of all zones after steps of some, in which interfaces fit to the bit.

        Followers are where their leaders are, where both were so at first, and are apart by
        rounding only.
        """
        parts = enumerate(self.mesh.parts)
        now = with_zones(self.mesh, [steps[k].mesh if k in steps else z.mesh for k, z in parts])
        points = now.points
        nodes = np.flatnonzero(self.led)
        leaders = self.leader[nodes]
        start = self.mesh.points
        alike = (start[nodes] == start[leaders]).all(axis=1)
        gap = np.abs(points[nodes] - points[leaders]).max(axis=1, initial=0.0)
        alike &= gap <= ROUNDING * self.mesh.extent
        out = points.copy()
        out[nodes[alike]] = points[leaders[alike]]
        return now.with_points(sealed(out))


def check_motions(case: Case, mesh: Mesh) -> tuple[str | None, Message | None]:
    """Return `check_motion` of the first zone that its motion cannot be made in, else of any.

    Zones follow others here as far as these move by their motions, before sliding is known.
    """
    if not isinstance(mesh, Assembly):
        return check_motion(case, mesh)
    motion = InterfaceMotion(Prepared(case, mesh), mesh)
    folded: Message | None = None
    for index, _ in motion.leaders_first():
        problem, overlap = check_motion(motion.cases[index], mesh.parts[index].mesh)
        if problem:
            return problem, folded
        folded = folded or overlap
    return None, folded


Runs = dict[int, list[Step]]
"""The steps of zones, by their place in the mesh, in the order in which they were deformed."""


def zone_runs(motion: InterfaceMotion, run: Run, report: Report) -> Runs:
    """Return the steps of those zones that move, each by ``run``."""
    mesh = motion.mesh
    runs = Runs()
    for index, ahead in motion.leaders_first():
        done = len(runs)
        part = mesh.parts[index]
        count = 1 + len(motion.moving(ahead))

        def zone_report(
            now: Progress, done: int = done, count: int = count, zone: int = index + 1
        ) -> None:
            step = done * now.total + now.step
            total = (done + count) * now.total
            report(replace(now, step=step, total=total, zone=zone))

        try:
            runs[index] = list(run(motion.prepared(index), zone_report))
        except SlidevizError as problem:
            problem.args = problem.within(f"zone {index + 1}")
            raise
        shift = runs[index][-1].mesh.points - part.mesh.points
        motion.slid(index, shift, np.flatnonzero(shift.any(axis=1)), ahead)
    return runs


def joined_steps(motion: InterfaceMotion, runs: Runs) -> Iterator[Step]:
    """Yield the steps of zones as those of the mesh of all.

    Where zones have different numbers of steps (STEPS= auto), the steps are those of the zone with
    the most, and the others have come as far as their latest step.
    """
    mesh = motion.mesh
    longest = max(runs.values(), key=len)
    before: dict[int, Step] = {}
    for leader in longest:
        steps = {k: step for k, some in runs.items() for step in some if step.part <= leader.part}
        new = {k for k, step in steps.items() if before.get(k) is not step}
        now = motion.after(steps)
        # Before the last step, nodes that follow sliding ones are on a straight way to them.
        last = leader is longest[-1]
        torn = torn_interfaces(mesh, now.points, motion.names) if last else ()
        step = Step.joined(mesh, now, steps, new, leader)
        yield replace(step, messages=(*motion.warnings, *step.messages, *torn))
        before = steps
