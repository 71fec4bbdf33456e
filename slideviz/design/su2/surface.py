"""Displacement of the moving boundaries by design variables, and its exact derivatives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, starmap
from pathlib import Path
from typing import TypeVar

import numpy as np

from slideviz.case.displacement import Columns, in_zones, parse_rows
from slideviz.case.lines import read_text
from slideviz.case.model import Case
from slideviz.case.motions.file import Prescribed
from slideviz.case.zone_cases import each_zone
from slideviz.design.su2.boxes import move_boxes, problems_of_boxes
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.on_mesh import joined, problems_of_markers, zone_of
from slideviz.design.su2.shapes import Displacer, Shapes
from slideviz.design.su2.variables import WITHOUT_VALUE, DesignVariable, Group
from slideviz.errors import CaseError, DeformError, Message, Remark, SlidevizError, note, raise_all
from slideviz.ffd.box import Box
from slideviz.ffd.section import boxes_of, with_boxes
from slideviz.mesh.interfaces import torn_interfaces
from slideviz.mesh.model import Assembly, FloatArray, IntArray, Mesh
from slideviz.mesh.quality import quality
from slideviz.solver.prepare import prepare
from slideviz.solver.setup import make_setup
from slideviz.solver.steps import Step

Attempt = TypeVar("Attempt")


def scaled(config: Su2Config, part: float) -> Su2Config:
    """Return a configuration with ``part`` of its design."""
    if config.zones:
        zones = (scaled(z, part) if _is_checked(z) else z for z in config.zones)
        return joined(config, tuple(zones))
    variables = tuple(_scaled(variable, part) for variable in config.variables)
    return replace(config, variables=variables)


def _is_checked(config: Su2Config) -> bool:
    return bool(config.values["CONVEXITY_CHECK"])


def _scaled(variable: DesignVariable, part: float) -> DesignVariable:
    # The value that moves nothing.
    neutral = 1.0 if variable.kind in ("SCALE", "SCALE_GRID") else 0.0
    return replace(variable, values=tuple(neutral + part * (v - neutral) for v in variable.values))


def convex_part(
    config: Su2Config,
    mesh: Mesh,
    attempt: Callable[[Su2Config], Attempt],
    deformed: Callable[[Attempt], Mesh],
) -> tuple[float, Attempt, Sequence[str]]:
    """Reduce the design by CONVEXITY_CHECK; return its factor, the deformation, and warnings.

    Raises CaseError or DeformError if not even the smallest part that is tried can be done.
    ``mesh``: the undeformed mesh. ``attempt`` and ``deformed``: deforms the mesh by a
    configuration; returns the mesh of what that returned.
    """
    if not _is_checked(config):
        return 1.0, attempt(config), ()
    least = quality(mesh).inverted
    kind = config.variables[0]
    impossible: list[CaseError | DeformError] = []

    def tried(config: Su2Config) -> tuple[Attempt | None, int]:
        try:
            surface = attempt(config)
        except (CaseError, DeformError) as problem:  # a boundary goes through another one
            impossible.append(problem)
            return None, 1
        return surface, max(0, quality(deformed(surface), reference=mesh).inverted - least)

    full, first = tried(config)
    if full is not None and not first:
        return 1.0, full, ()
    if kind.group in WITHOUT_VALUE and full is not None:
        note = (
            f"CONVEXITY_CHECK scales values, but {kind.kind} has no values: it is applied in full"
        )
        return 1.0, full, (note,)
    best: tuple[float, Attempt] | None = None
    part = 1.0
    step = 1.0
    depth = 0
    valid = False
    for _ in range(config.values["CONVEXITY_CHECK_ITER"]):
        step /= 2.0
        part += step if valid else -step
        found, inverted = tried(scaled(config, part))
        valid = found is not None and not inverted
        if found is not None and valid:  # which is larger than the one before
            best = (part, found)
            depth = depth + 1
        if depth == config.values["CONVEXITY_CHECK_DEPTH"]:
            break
    note = f"CONVEXITY_CHECK: all of the design would invert {first} more cells"
    note = f"CONVEXITY_CHECK: {impossible[0]}" if full is None else note
    if best is None and full is None:
        raise impossible[0]
    if best is None:
        assert full is not None
        return 1.0, full, (f"{note}, and so does the smallest part that was tried, {part:g}",)
    return *best, (f"{note}; {best[0]:g} of it is done: its values times {best[0]:g}",)


POSITION = Columns("position", ("x", "y", "z"), flat=True)


class ListedPositions(Displacer):
    """New positions of nodes, as a file lists them: there is no value to change."""

    @cached_property
    def _listed(self) -> tuple[FloatArray, tuple[str, ...]]:
        config = self.config
        of = f"{config.named[config.markers[0]]}= ({', '.join(config.markers)})"
        return read_positions(config.files["DV_FILENAME"], self.nodes, self.mesh, of)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what reading the file found."""
        return self._listed[1]

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes."""
        return self._listed[0] - self.mesh.points[self.nodes]


def read_positions(
    path: Path, nodes: IntArray, mesh: Mesh, of: str
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the new positions of nodes, (m, d), and warnings; nodes that are not listed stay.

    Lines are ``index x y [z]`` in any order, with blanks, tabs or commas between; a plane mesh may
    have a z of 0. As in SU2, nodes that are on none of the moving boundaries are ignored, but with
    a warning. Raises CaseError if the file cannot be read, has mistakes (a line ``file:line:
    sentence`` for each), or none of these nodes. ``path``: the file, whose nodes have the numbers
    that `in_zones` tells. ``nodes`` (m,) int64: of the moving boundaries, ascending. ``of``: key
    and moving boundaries for messages: ``DV_MARKER= (low)``.
    """
    text, warnings = read_text(path, "surface file")
    tables = []
    for first, _, part, lines in in_zones(text, path, mesh, nodes):
        every = np.arange(len(part.points))
        tables.append(parse_rows(lines, path, every, part.points.shape, "the mesh", POSITION))
        tables[-1][:, 0] += first
    table = np.concatenate(tables)
    listed = table[:, 0].astype(np.int64)
    moving = np.isin(listed, nodes)
    others = int(np.count_nonzero(~moving))
    if others == len(listed):
        raise CaseError(
            f"{path}: none of its {others} nodes is on {of}, so nothing would move; correct the "
            "file or the boundaries"
        )
    positions = mesh.points[nodes]
    positions[np.searchsorted(nodes, listed[moving])] = table[moving, 1:]
    if others:
        sentence = f"{path}: {others} of {len(listed)} nodes are not on {of}; they are ignored"
        warnings = (*warnings, sentence)
    return positions, warnings


RIGID = ("TRANSLATION", "ROTATION", "SCALE")
"""Kinds of variables that move boundaries as a rigid body, or scale them."""


@dataclass(frozen=True, eq=False)
class ZoneDisplacers(Displacer):
    """The displacers of zones with a configuration each, as one."""

    zones: tuple[MovingSurface, ...]

    @cached_property
    def _rows(self) -> list[slice]:
        """The rows of the nodes of each zone."""
        ends = np.cumsum([0, *(len(zone.nodes) for zone in self.zones)]).tolist()
        return list(starmap(slice, pairwise(ends)))

    @cached_property
    def _owners(self) -> list[list[tuple[int, int]]]:
        """The zones that have each variable, and its place in their lists."""
        having: dict[tuple[DesignVariable, ...], list[int]] = {}
        for k, zone in enumerate(self.zones):
            having.setdefault(zone.config.variables, []).append(k)
        return [[(k, at) for k in some] for each, some in having.items() for at in range(len(each))]

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect in any zone."""
        return tuple(all(self.zones[k].idle[at] for k, at in some) for some in self._owners)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """Return those of all zones, each once."""
        return tuple(dict.fromkeys(text for zone in self.zones for text in zone.warnings))

    @property
    def inside(self) -> dict[str, int]:
        """Return how many nodes of all zones are in each box."""
        counts: Counter[str] = Counter()
        for zone in self.zones:
            counts.update(zone.displacer.inside)
        return dict(counts)

    def displacement(self) -> FloatArray:
        """Return the displacement (m, d) of the nodes of all zones."""
        return np.concatenate([zone.displacement for zone in self.zones])

    def slope(self, place: int, part: int, undeformed: bool) -> FloatArray:
        """Return the derivative (m, d) with respect to a value, in all zones that have it."""
        out = np.zeros((len(self.nodes), self.mesh.dim))
        for k, at in self._owners[place]:
            out[self._rows[k]] = self.zones[k].slope(at, part, undeformed)
        return out

    def moved_boxes(self) -> dict[str, tuple[Box, bool]]:
        """Return the boxes of all zones, each as the first zone moves it, as in SU2."""
        out: dict[str, tuple[Box, bool]] = {}
        for zone in self.zones:
            for name, (box, anew) in zone.displacer.moved_boxes().items():
                first, before = out.get(name, (box, False))
                mine = {k: v for k, v in box.embedded.items() if k in zone.config.markers}
                out[name] = replace(first, embedded={**first.embedded, **mine}), anew or before
        return out


DISPLACERS: dict[Group, Callable[[Su2Config, Mesh, IntArray], Displacer]] = {
    "nothing": Shapes,
    "surface": Shapes,
    "naca": Shapes,
    "parabolic": Shapes,
    "grid": Shapes,
    "file": ListedPositions,
    "ffd": move_boxes,
}
"""What moves the nodes, by the group of the first design variable."""


@dataclass(frozen=True, eq=False)
class MovingSurface:
    """The moving boundaries of a configuration, and its design."""

    config: Su2Config
    mesh: Mesh
    nodes: IntArray  # (m,): of all moving boundaries, or of the mesh (``*_GRID``), ascending
    displacer: Displacer
    warnings: tuple[Remark, ...]
    zones: tuple[MovingSurface, ...] = ()  # that of each, with CONFIG_LIST

    @property
    def idle(self) -> tuple[bool, ...]:
        """Return for each variable whether it has no effect."""
        ignored = (each.ignored for each in self.config.variables)
        return tuple(map(max, ignored, self.displacer.idle))

    @property
    def values(self) -> tuple[tuple[int, int], ...]:
        """Return (variable, number among its values) of each value, both from 0."""
        variables = enumerate(self.config.variables)
        return tuple((place, part) for place, each in variables for part in range(len(each.values)))

    @cached_property
    def displacement(self) -> FloatArray:
        """Return the displacement of the nodes, (m, d); CaseError where it is not finite."""
        with _overflow_as_case_error(self.config):
            return self._finite(self.displacer.displacement())

    def slope(self, place: int, part: int = 0, undeformed: bool = False) -> FloatArray:
        """Return the derivative (m, d) of the displacement with respect to a value.

        ``place``: number of the variable, from 0. ``part``: number of the value among those of the
        variable, from 0. ``undeformed``: whether at the design that moves nothing, instead of this
        one.
        """
        if self.idle[place]:
            return np.zeros((len(self.nodes), self.mesh.dim))
        with _overflow_as_case_error(self.config):
            return self._finite(self.displacer.slope(place, part, undeformed))

    def _finite(self, vectors: FloatArray) -> FloatArray:
        """Return vectors (m, d) that must be finite."""
        if not np.isfinite(vectors).all():
            raise OverflowError
        return vectors

    @property
    def moves_whole_mesh(self) -> bool:
        """Return whether the variables displace all nodes of the mesh directly (``*_GRID``)."""
        return self.config.variables[0].group == "grid"

    def moved(self) -> Mesh:
        """Return the mesh with the nodes moved, and no others."""
        points = self.mesh.points.copy()
        points[self.nodes] += self.displacement
        return self.mesh.with_points(points)

    def boxed(self, mesh: Mesh) -> Mesh:
        """Return a deformed mesh with its FFD boxes moved by the design."""
        moved = self.displacer.moved_boxes()
        if not moved:
            return mesh
        renewed = [name for name, (_, anew) in moved.items() if anew]
        return with_boxes(mesh, [box for box, _ in moved.values()], renewed=renewed)

    def case(self) -> Case:
        """Return the case with this displacement as its motion."""
        if not self.zones:
            return self._case()
        cases = [zone._case() for zone in self.zones]
        settings = {zone.zone: zone.case for zone in self.config.zones}
        settings |= {zone.config.zone: case for zone, case in zip(self.zones, cases, strict=True)}
        moved = [motion.content for case in cases for motion in case.motions]
        nodes, vectors = zip(*moved, strict=True)
        motion = Prescribed(np.concatenate(nodes), np.concatenate(vectors))
        warnings = *self.config.case.warnings, *self.warnings
        if self.moves_whole_mesh:
            warnings = *warnings, *torn_interfaces(self.mesh, self.moved().points)
        return self.config.case.change(
            roles={name: role for each in settings.values() for name, role in each.roles.items()},
            motions=(motion,),
            zone_settings=tuple(settings.values()),
            warnings=warnings,
        )

    def _case(self) -> Case:
        case = self.config.case
        _, markers = zone_of(self.config, self.mesh)
        names = [marker.name for marker in markers]
        others = set(names) - set(self.config.markers)
        moving = (each for each in self.config.variables if not each.ignored)
        if (
            not others
            and {each.kind for each in moving} <= {*RIGID}
            and case.kernel == Case().kernel
        ):
            # All boundaries move as a body does, or grow: this kernel has that exactly inside.
            case = case.change(kernel="thin-plate")
        nodes = self.nodes
        vectors = self.displacement
        warnings = self.warnings
        if self.moves_whole_mesh or not self.config.markers:
            every = dict.fromkeys(names, "moving")
            case = case.change(roles=every, sliding="none", periodic="none")
        if self.moves_whole_mesh:  # the mesh is moved already
            listed = [marker.nodes for marker in markers]
            nodes = np.unique(np.concatenate([np.empty(0, np.int64), *listed]))
            vectors = np.zeros((len(nodes), self.mesh.dim))
            if self.config.zone is None:
                warnings = (*warnings, *torn_interfaces(self.mesh, self.moved().points))
        motions = (Prescribed(nodes, vectors),)
        return case.change(motions=motions, warnings=(*case.warnings, *warnings))


@contextmanager
def _overflow_as_case_error(config: Su2Config) -> Iterator[None]:
    try:
        with np.errstate(all="ignore"):
            yield
    except OverflowError as problem:
        raise CaseError(
            f"{config.source}: the variables move nodes too far for the arithmetic; correct "
            "DV_PARAM or DV_VALUE"
        ) from problem


def make_surface(config: Su2Config, mesh: Mesh) -> MovingSurface:
    """Return the moving boundaries of a configuration, and what moves them; or CaseError."""
    if config.zones:
        return _of_zones(config, mesh)
    group = config.variables[0].group
    needed = group not in ("grid", "nothing")
    problems: list[str | Message] = [*problems_of_markers(config, mesh, needed)]
    if group == "ffd":
        problems += problems_of_boxes(config, mesh)
    raise_all(problems)
    listed = [mesh.marker(name).nodes for name in config.markers]
    nodes = np.unique(np.concatenate([np.empty(0, np.int64), *listed]))
    nodes = zone_of(config, mesh)[0] if group == "grid" else nodes
    with _overflow_as_case_error(config):
        displacer = DISPLACERS[group](config, mesh, nodes)
    left = [] if group == "ffd" else _left_behind(config, mesh)
    if group == "grid" and mesh.halo is not None:
        sentence = f"the transformations of the halo in {mesh.name} (SEND_RECEIVE) stay as they are"
        left.append(f"{sentence}; they are wrong if the axis or the vector of the period moves")
    return MovingSurface(config, mesh, nodes, displacer, (*displacer.warnings, *left))


def _of_zones(config: Su2Config, mesh: Mesh) -> MovingSurface:
    """Return the moving boundaries of the zones of a CONFIG_LIST."""
    moving = [zone for zone in config.zones if zone.variables[0].group != "nothing"]
    moving = moving or [*config.zones[:1]]
    zones = tuple(make_surface(zone, mesh) for zone in moving)
    nodes = np.concatenate([np.empty(0, np.int64), *(zone.nodes for zone in zones)])
    displacer = ZoneDisplacers(config, mesh, nodes, zones)
    return MovingSurface(config, mesh, nodes, displacer, displacer.warnings, zones)


def at_rest(case: Case, mesh: Mesh) -> Step:
    """Return the one step of a design that moves nothing: often the first of an optimiser."""
    if isinstance(mesh, Assembly):
        zones = enumerate(each_zone(case, mesh))
        steps = {k: at_rest(*each) for k, each in zones if each[0].markers_with("moving")}
        step = Step.joined(mesh, mesh, steps, steps, next(iter(steps.values())))
        return replace(step, messages=(*case.warnings, *step.messages))
    setup = make_setup(prepare(case, mesh))
    return Step(
        index=1,
        total=1,
        mesh=mesh,
        control_nodes=0,
        max_error=0.0,
        condition=np.nan,
        node_counts=setup.classes.counts(),
        seconds={},
        messages=(*case.warnings, *setup.warnings),
        candidates=setup.candidates,
        support_radius=setup.basis.radius if case.method == "rbf" else None,
    )


def _left_behind(config: Su2Config, mesh: Mesh) -> list[Remark]:
    """Return a note if variables move the surface, but not the FFD boxes in the mesh; or none."""
    moving = [each for each in config.variables if not each.ignored and each.group != "nothing"]
    kinds = sorted({each.kind for each in moving})
    with suppress(SlidevizError):  # a mesh whose boxes cannot be read has none that could be used
        if kinds and boxes_of(mesh):
            sentence = (
                f"the FFD boxes in {config.case.mesh_out} follow their control points only, and "
                f"not {', '.join(kinds)}; define them again to use them with that mesh"
            )
            return [note(sentence)]
    return []
