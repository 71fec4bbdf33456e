"""Motions in the window: what new ones start with, where they take boundaries; periods in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np

from slideviz.argument_types import record
from slideviz.case.displacement import Displacements, PlacedDisplacements, parsed_displacements
from slideviz.case.lines import read_text
from slideviz.case.model import Case
from slideviz.case.motions.box import (
    BoxMotion,
    box_changes,
    box_definition,
    boxes_for,
    system_of,
)
from slideviz.case.motions.kinds import FAMILIES
from slideviz.case.motions.motion import Axis, Target, applies_to, direction_words, named
from slideviz.case.motions.onto import is_laid
from slideviz.case.moving_nodes import displacements, moved_together, placed_displacements
from slideviz.errors import CaseError, SlidevizError
from slideviz.ffd.box import CORNERS, Box, CoordinateSystem, Index
from slideviz.mesh.model import FloatArray, IntArray, Mesh, largest_norm, row_norms
from slideviz.mesh.periodic import Pair
from slideviz.mesh.zones import marker_zones
from slideviz.session.state import Session
from slideviz.solver.prescribed import displaced, moving_bodies, support_radius
from slideviz.solver.rims import are_ready, on_walls
from slideviz.system.atomic import write_whole
from slideviz.terms import FfdSystem, Numbers, Texts, WholeNumbers

PLACEHOLDER = Path("table")
"""Stands for the file in messages of `parsed_displacements`; `TableRows.check` replaces it."""
MOST_BYTES = 5_000_000  # most bytes of a file that can be edited by hand


@record
class TableRows:
    """The nodes that a table of displacements may list."""

    of: str  # their boundaries, in words
    nodes: IntArray  # (k,): the nodes, sorted
    mesh: Mesh  # in which they have these numbers: that of their zone, if they are of one

    @classmethod
    def on(cls, mesh: Mesh, case: Case, marker: Target) -> TableRows:
        """Return the rows for the boundaries of a motion; all moving ones where it is empty."""
        names = named(marker) or case.markers_with("moving")
        nodes = mesh.nodes_of(names)
        for zone in (part for part in mesh.parts if len(nodes)):
            if zone.points.start <= nodes[0] and nodes[-1] < zone.points.stop:
                nodes = nodes - zone.points.start  # as a file numbers them
                mesh = zone.mesh
                break
        return cls(", ".join(names), nodes, mesh)

    @property
    def heading(self) -> str:
        """Return the names of the columns, with blanks between."""
        return " ".join(["node", "dx", "dy", "dz"][: 1 + self.mesh.dim])

    def check(self, text: str) -> str:
        """Return a sentence on how many nodes a table moves, and how far.

        Raises CaseError if it has no rows, or mistakes; the message has the first one.
        """
        if not text.strip():
            raise CaseError(f"Type or paste rows: {self.heading}")
        try:
            read = parsed_displacements(text, PLACEHOLDER, self.mesh, self.nodes, self.of)
        except CaseError as error:
            first, *others = error.messages
            first = replace(first, place=(f"Line {first.line}",) if first.line else ())
            raise CaseError(f"{first} ({len(others)} more)" if others else first) from error
        moved = row_norms(read.vectors)
        return (
            f"{np.count_nonzero(moved):,} of {len(self.nodes):,} nodes of {self.of} move, "
            f"by at most {moved.max():.4g}"
        )

    def fill(self, text: str) -> str:
        """Return a table with a row of zeros for each node that is not listed yet."""
        listed = set()
        for line in text.splitlines():
            word = line.replace(",", " ").replace(";", " ").split()[:1]
            if word and word[0].isdecimal():
                listed.add(int(word[0]))
        zeros = "\t0" * self.mesh.dim
        rows = [f"{node}{zeros}" for node in self.nodes.tolist() if node not in listed]
        head = [f"% {self.heading}"] if not text.strip() else text.rstrip("\n").split("\n")
        return "\n".join([*head, *rows]) + "\n"


def write_table(path: Path, text: str, replaces: Path | None = None) -> None:
    """Write a table as a displacement file, whole or not at all.

    ``replaces`` is the only input file that may be overwritten: the one the table was read from.
    Raises CaseError if it cannot be written.
    """
    write_whole(path, f"{text.rstrip()}\n", CaseError, replaces)


def table_text(path: Path) -> str:
    """Return the text of a displacement file; "" where there is no such file.

    Raises CaseError if it is too large to be edited by hand, or cannot be read.
    """
    if not path.is_file():
        return ""
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise CaseError(
            f"{path}: the table has {size / 1e6:.0f} MB, too much to be edited here; write it with "
            "another program"
        )
    return read_text(path, "displacement file")[0]


DIGITS = 12
"""Significant digits of a centroid, relative to the extent of the mesh, and of a direction."""


def centroid(mesh: Mesh, names: Iterable[str]) -> Numbers:
    """Return the mean of the nodes of some boundaries together, rounded to `DIGITS`."""
    digits = DIGITS - math.ceil(math.log10(mesh.extent)) if mesh.extent > 0.0 else DIGITS
    nodes = mesh.nodes_of(set(names).intersection(mesh.marker_names))
    middle = mesh.points[nodes].mean(axis=0) if len(nodes) else np.zeros(mesh.dim)
    return tuple(round(float(v), digits) + 0.0 for v in middle)


def chord_of(mesh: Mesh, names: Iterable[str]) -> tuple[float, float]:
    """Return from which x to which x some boundaries go, rounded to `DIGITS`; 0 to 1 for none."""
    x = mesh.points[mesh.nodes_of(set(names).intersection(mesh.marker_names)), 0]
    if not len(x) or not x.min() < x.max():
        return 0.0, 1.0
    digits = DIGITS - math.ceil(math.log10(np.ptp(x)))
    return round(float(x.min()), digits) + 0.0, round(float(x.max()), digits)


def radial(axis: Axis, point: Numbers) -> tuple[float, float, float] | None:
    """Return the unit direction from an axis to a point, perpendicular to it; None on the axis."""
    direction, origin = map(np.array, axis)
    arm = np.array((*point, 0.0)[:3]) - origin
    arm = arm - direction * (arm @ direction) / (direction @ direction)
    length = float(np.linalg.norm(arm))
    if not length > 0.0:
        return None
    x, y, z = (arm / length).tolist()
    return round(x, DIGITS) + 0.0, round(y, DIGITS) + 0.0, round(z, DIGITS) + 0.0


def new_target(session: Session) -> Target:
    """Return the moving boundaries of a new motion: selected, else without motion, else all.

    They are named, so that a boundary that moves later does not join. Those that only a guess made
    moving count where the user chose none.
    """
    case = session.case
    moving = case.markers_with("moving")
    without = [n for n in moving if not any(applies_to(motion, n) for motion in case.motions)]
    names = tuple(name for name in moving if name in session.view.selected)
    chosen = tuple(name for name in without if name not in session.guesses)
    names = names or chosen or tuple(without) or moving
    return names[0] if len(names) == 1 else names or ""


def targets(session: Session) -> tuple[Target, ...]:
    """Return the targets that a motion can have: each moving boundary, selected ones, all now."""
    moving = session.case.markers_with("moving")
    selected = tuple(name for name in moving if name in session.view.selected)
    together = (names for names in (selected, moving) if len(names) > 1)
    return (*moving, *dict.fromkeys(together))


def machine_pair(session: Session) -> Pair | None:
    """Return the first rotational pair of periodic boundaries, or None."""
    return next((pair for pair in session.pairs if is_turned(session, pair)), None)


def is_turned(session: Session, pair: Pair) -> bool:
    """Return whether a pair is periodic by a rotation."""
    both = {session.role(pair.first), session.role(pair.second)}
    return pair.kind == "rotational" and both == {"periodic"}


def machine_axis(session: Session) -> Axis | None:
    """Return the axis of the first rotational pair of periodic boundaries, or None."""
    pair = machine_pair(session)
    return None if pair is None else (pair.axis, pair.origin)


def wheel_passages(session: Session) -> WholeNumbers:
    """Return how many passages make the wheel of each zone; () where a zone has none."""
    if session.mesh is None:
        return ()
    pairs = [pair for pair in session.pairs if is_turned(session, pair)]
    zone_of = dict(zip(session.mesh.marker_names, marker_zones(session.mesh), strict=True))
    around = {zone_of[pair.first]: pair.around for pair in reversed(pairs)}
    counts = tuple(around[zone] or 0 for zone in sorted(around))
    return counts if all(counts) and len(counts) == len(session.mesh.parts) else ()


def box_names(session: Session) -> Texts:
    """Return the names of the FFD boxes that motions can use; () where boxes have mistakes."""
    if session.mesh is None:
        return ()
    try:
        return tuple(boxes_for(session.case, session.mesh))
    except SlidevizError:  # the checks of a motion that uses one have the message
        return ()


def lattices(case: Case, mesh: Mesh) -> tuple[dict[str, Box], dict[str, Box]]:
    """Return the undeformed boxes, and the deformed ones of those that motions move, by name.

    None of both if a box is not valid, which is reported elsewhere.
    """
    try:
        boxes = boxes_for(case, mesh)
    except SlidevizError:
        return {}, {}
    moved = {}
    for name, changes in box_changes(case, mesh, boxes).items():
        total = np.sum([change for _, _, change in changes], axis=0)
        if total.any():
            moved[name] = boxes[name].moved(total)
    return boxes, moved


def chosen_control(session: Session) -> tuple[str, Index] | None:
    """Return the box and the index of the control points that the chosen motion moves, or None."""
    index = session.motion_index
    motion = None if index is None else session.case.motions[index]
    if session.mesh is None or session.view.handle != "motion" or not isinstance(motion, BoxMotion):
        return None
    return motion.box, motion.lattice_index(session.mesh.dim)


BOX_MARGIN = 0.05  # margin of a new box around a boundary, over its longest side
BOX_DEGREE = 5  # its degree along its longest side; in proportion along the others


def with_box(
    session: Session, index: int, degrees: Index | None = None, system: FfdSystem | None = None
) -> Case:
    """Return the case with an FFD box around the boundaries of a motion, which uses it then.

    A box of the case that the motion has already gets other ``degrees``, or coordinates in which it
    is straight; None: as they are.
    """
    case = session.case
    mesh = session.opened_mesh
    motion: Any = case.motions[index]
    boxes = dict(case.ffd_boxes)
    shapes = dict(zip(boxes, case.ffd_degrees, strict=False))
    taken = {*box_names(session), *boxes}
    offered = chain(["BOX"], (f"BOX_{number}" for number in count(2)))
    name = motion.box if motion.box in boxes else next(n for n in offered if n not in taken)
    case = case if system is None else case.change(ffd_system=system)
    if name not in boxes or system is not None:
        names = named(motion.marker) or case.markers_with("moving")
        corners, usual = _around(mesh.points[mesh.nodes_of(names)], system_of(case))
        boxes[name] = tuple(corners.ravel().tolist())
        shapes.setdefault(name, usual)
    shapes[name] = degrees or shapes[name]
    motions = list(case.motions)
    motions[index] = replace(motion, box=name)
    return case.change(
        ffd_boxes=tuple(boxes.items()),
        ffd_degrees=tuple(shapes[name] for name in boxes),
        motions=tuple(motions),
    )


def _around(points: FloatArray, system: CoordinateSystem) -> tuple[FloatArray, Index]:
    """Return the corners (8, 3) of a box around points (n, d), in SU2's order, and its degrees.

    In 2D the last four corners are 0.
    """
    dim = points.shape[1]
    q = points if dim == 2 else system.q_of(points)
    low = q.min(axis=0)
    high = q.max(axis=0)
    lengths = np.ones(dim) if system.kind == "CARTESIAN" else np.array([1.0, high[0], 1.0])
    sides = (high - low) * lengths
    margin = BOX_MARGIN * sides.max() / lengths
    first = [float(f"{v:.6g}") for v in low - margin]
    last = [float(f"{v:.6g}") for v in high + margin]
    corners = np.array(first) + CORNERS[:, :dim] * np.subtract(last, first)
    i, j, k = (*(max(1, round(BOX_DEGREE * side / sides.max())) for side in sides), 0)[:3]
    at = np.zeros((8, 3))
    at[: 4 * (dim - 1), :dim] = corners[: 4 * (dim - 1)] if dim == 2 else system.points_of(corners)
    return at, (i, j, k)


def boxes_hint(session: Session) -> str:
    """Return the hint that there are FFD boxes, and the key that shows them; "" if not needed."""
    count = 0 if "ffd" in session.view.drawn else len(box_names(session))
    if not count:
        return ""
    return f"{count} FFD boxes: B shows them" if count > 1 else "An FFD box: B shows it"


def largest_prescribed(case: Case, mesh: Mesh) -> float:
    """Return the largest displacement that the motions prescribe; 0 if they are invalid.

    It is 0, too, while motions onto surfaces are not computed.
    """
    try:
        vectors = displacements(case, mesh).vectors if is_laid(case, mesh) else np.empty((0, 3))
    except (OSError, SlidevizError):
        return 0.0
    return largest_norm(vectors)


def support_key(case: Case, mesh: Mesh) -> tuple[object, ...]:
    """Return the values on which `support_of` depends."""
    settings = case.method, case.influence_factor, case.support_radius
    moving = case.markers_with("moving")
    return mesh, moving, case.motions, box_definition(case), settings, is_laid(case, mesh)


def shown_case(session: Session) -> Case:
    """Return the case of the run of which a step is shown, or else that in the panels."""
    ran = session.frame is not None and session.frame.step is not None
    run = session.run_shown if ran else None
    return session.case if run is None else run.case


def support_of(case: Case, mesh: Mesh) -> tuple[float, FloatArray]:
    """Return the support radius of a case, and the boxes (b, 2, d) of what moves.

    0 and none where the case has no such radius, or mistakes, which are reported elsewhere, or
    motions onto surfaces that are not computed yet.
    """
    none = 0.0, np.empty((0, 2, mesh.dim))
    unknown = set(case.markers_with("moving")) - {*mesh.marker_names}
    if case.method != "rbf" or unknown or not is_laid(case, mesh):
        return none
    try:
        moved = displaced(displacements(case, mesh), mesh)
        boxes = moving_bodies(case, mesh, moved)
    except (OSError, SlidevizError):
        return none
    return (support_radius(case, mesh, moved), boxes) if len(boxes) else none


def support_case(session: Session) -> Case:
    """Return the case whose support radius is drawn: that in the panels, or of a compared run."""
    return session.case if session.view.beside is None else shown_case(session)


def support_words(session: Session) -> str:
    """Return the message on the support radius that is drawn, on an open mesh: length, place."""
    mesh = session.opened_mesh
    case = support_case(session)
    radius, boxes = support_of(case, mesh)
    if not radius:
        return "There is no support radius to draw: nothing moves by radial functions"
    of = " of the settings" if case is session.case else f" of run {session.shown}"
    of = of if session.runs else ""
    shape = "circle" if mesh.dim == 2 else "sphere"
    middles = boxes.mean(axis=1)
    low, high = mesh.bounds
    farthest = row_norms(np.maximum(high - middles, middles - low))
    if radius > farthest.max():
        return f"Support radius{of}: {radius:.4g}, a {shape} larger than the whole mesh"
    return f"Support radius{of}: {radius:.4g}, a {shape} around what moves; F shows all"


class Ghosts:
    """Computes where motions take the boundaries of a mesh, to be drawn before a run."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._nodes = {marker.name: marker.nodes for marker in mesh.markers}

    def moved(self, case: Case, wait: bool = False) -> dict[str, FloatArray]:
        """Return the moved points (u, d) of the nodes of each boundary with motions, by name.

        A displacement file that cannot be read, or a missing box, moves nothing here; the checks
        before a run report it. Motions onto surfaces take seconds: without ``wait`` they move
        nothing until their displacement is known (`slideviz.session.jobs.find_intersection`), and
        rims stay on their walls (RIMS= SLIDE) from when these are.
        """
        on = {
            name: self._nodes[name]
            for name in case.markers_with("moving")
            if name in self._nodes and any(applies_to(motion, name) for motion in case.motions)
        }
        placed: PlacedDisplacements = {}
        for family in FAMILIES:
            if family.takes_time and not (wait or is_laid(case, self.mesh)):
                continue
            with suppress(SlidevizError):
                placed |= placed_displacements(case, self.mesh, on, [], (family,))
        points = self.mesh.points
        moved = moved_together(case.motions, points, on, placed)
        with suppress(SlidevizError):
            if on and (wait or are_ready(case, self.mesh)):
                moved = self._on_walls(case, on, moved)
        return {name: points[nodes] + moved[name] for name, nodes in on.items()}

    def _on_walls(
        self, case: Case, on: Mapping[str, IntArray], moved: Mapping[str, FloatArray]
    ) -> dict[str, FloatArray]:
        """Return displacements (k, d) of the nodes of each boundary with rims on their walls."""
        nodes, first = np.unique(np.concatenate(list(on.values())), return_index=True)
        together = Displacements(nodes, np.concatenate(list(moved.values()))[first])
        kept = on_walls(case, self.mesh, together)
        return {name: kept.at(nodes) for name, nodes in on.items()}


def period_text(pair: Pair) -> str:
    """Return the period of a pair in a few words: λ along a direction, or θ about an axis."""
    if pair.kind == "rotational":
        return f"θ = {math.degrees(pair.period):.6g}° about {_axis(pair.axis)}"
    return f"λ = {pair.period:.6g} along {_axis((pair.vector / pair.period).tolist())}"


def _axis(direction: Sequence[float]) -> str:
    return direction_words(direction).removeprefix("-")


def pair_text(session: Session) -> str:
    """Return lines on the periodic boundaries: matching pairs with their period, and the others."""
    names = session.case.markers_with("periodic")
    lines = [
        f"Found: {pair.first} → {pair.second}, {period_text(pair)}"
        for pair in session.pairs
        if pair.first in names and pair.second in names
    ]
    paired = {
        end
        for p in session.pairs
        if {p.first, p.second} <= set(names)
        for end in (p.first, p.second)
    }
    alone = [name for name in names if name not in paired]
    if alone and len(names) >= 2 and session.mesh is not None:
        lines.append(f"No match found yet for {' and '.join(alone)}; the run will try.")
    return "\n".join(lines)
