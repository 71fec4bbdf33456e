"""Results that cannot be right: nodes that overshoot the motion, and systems that were not solved.

A smooth function that has to change from one displacement to another within a thin layer
overshoots behind it: for example at a wall that moves along itself, beside a wall that is fixed,
with cells of a height of 1e-6 between the two.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.case.check import motion_doubts
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.moving_nodes import ROUNDING, moving_nodes
from slideviz.case.spans import span_ends
from slideviz.errors import Message, point_words
from slideviz.mesh.model import (
    FloatArray,
    IntArray,
    Mesh,
    largest_coordinate,
    largest_norm,
    row_norms,
)
from slideviz.rbf.problem import StepSolution
from slideviz.rbf.rims import Rims
from slideviz.solver.domain import Domain, find_domain, roles_of_copies
from slideviz.solver.prescribed import displaced, motion_messages
from slideviz.solver.remedies import SLIDE_RIMS
from slideviz.solver.rims import find_rims, on_walls, rims_key
from slideviz.solver.setup import Setup
from slideviz.system.threads import in_parts
from slideviz.system.weak_cache import WeakCache

GROWTH = 5.0
"""A displacement overshoots where it is longer than this times the reach of the motion (`_reach`).
Sliding nodes get to 2 on the thesis's cases, and to 4 around a thin sharp profile that slides."""

TAKEN = 1.5
"""Boundaries that went farther than this times the largest displacement asked for have overshot
themselves, so that they do not count for the reach of the motion."""

STEEP = 100.0
"""Neighbouring boundary nodes explain an overshoot where the difference of their displacements over
their distance is this times the largest displacement over the mesh's extent."""

STRAY = 10.0
"""A node strays where it goes more than this times as far as the farthest boundary node."""

OFF_WALL = 1e-3  # part of the span by which sliding nodes may leave hub or shroud
NOISE = 1e-6  # part of the size of what moves by which its nodes may leave a wall: digits of a file

ROUGHEST = "wendland-c0"  # the kernel that overshoots least

_DOMAINS = WeakCache()

HOPELESS = 0.1
"""A system was not solved where its solution misses the displacement of a control node by more than
this part of the largest displacement."""


def unsoundness(
    setup: Setup,
    mesh: Mesh,
    solution: StepSolution,
    moved: FloatArray,
    *,
    part: float,
    farthest: float,
    least: float = 0.0,
) -> str | None:
    """Return why the result of a step cannot be right, and what helps; None where it may be.

    ``moved`` (n, d): coordinates in the frame after the step. In a cylindrical one angles are times
    the largest radius: so a body that turns about the axis carries no node farther than itself.
    ``part``: the part of the whole displacement that is reached after the step, 0 to 1.
    ``farthest``: the largest displacement of all nodes, in the frame.
    ``least``: a length: the whole displacement counts as at least so long, where it is smaller.
    """
    # Shorter displacements are rounding, as sin(pi) is.
    largest = max(part * setup.largest, ROUNDING * largest_coordinate(mesh.points))
    if solution.lost > HOPELESS * largest:
        return (
            f"the interpolation misses its own control nodes by {solution.lost:.3g}, where the "
            f"largest displacement is {largest:.3g} (condition number {solution.condition:.0e}): "
            f"{_cause(setup, mesh, moved)}"
        )
    asked = largest
    largest = max(largest, part * least)
    if farthest <= GROWTH * largest:
        return None  # as nearly always: the motion reaches that far at least
    shift = moved - setup.coords
    length = row_norms(shift)
    # Sliding nodes are compared with moving boundaries only: they are data for all other nodes.
    reach = np.full(len(length), _reach(setup, shift, largest, ("moving", "fixed", "sliding")))
    slid = setup.classes.sliding
    reach[slid] = _reach(setup, shift, largest, ("moving",))
    beyond = length > GROWTH * reach
    if not beyond.any():
        return None
    on = slid[beyond[slid]]
    node = int(on[np.argmax(length[on])]) if len(on) else int(np.argmax(length * beyond))
    where = point_words(mesh.points[node], mesh.extent)
    return (
        f"node {mesh.number(node)} at ({where}) would move by {length[node]:.3g}, more than "
        f"{GROWTH:g} times the {reach[node]:.3g} that the motion reaches, whose largest "
        f"displacement so far is {asked:.3g}: {_cause(setup, mesh, moved)}"
    )


def overshoot_of_rest(
    setup: Setup, mesh: Mesh, after: FloatArray, part: float, length: float
) -> str | None:
    """Return that a node outside of the skin overshoots, as the end of a sentence; None if not.

    ``mesh`` and ``after``: the skin of a mesh, and its points (n, d) after the step.
    ``part``: the part of the whole displacement that is reached after the step, 0 to 1.
    ``length``: how far the node has gone, in the frame.
    """
    largest = part * setup.largest
    if length <= GROWTH * largest:
        return None
    moved = setup.frame.coords(after)
    shift = moved - setup.coords
    if length <= GROWTH * _reach(setup, shift, largest, ("moving", "fixed", "sliding")):
        return None
    return (
        f"would move by {length:.3g}, {length / largest:.3g} times the largest displacement that "
        f"is asked for ({largest:.3g}): {_cause(setup, mesh, moved)}"
    )


@record
class Farthest:
    """The node of a mesh that went farthest."""

    length: float  # how far, in the mesh's length unit
    node: int  # its number; of several, the lowest
    point: FloatArray  # (d,): its undeformed place

    def further(self, other: Farthest) -> Farthest:
        """Return the one of two that went farther."""
        return max(self, other, key=lambda each: (each.length, -each.node))


def farthest_node(
    before: FloatArray, after: FloatArray, numbers: IntArray | None = None
) -> Farthest:
    """Return the node that went farthest, of points (n, d) with ``numbers`` (n,), or 0, 1, ..."""
    length = np.empty(len(before))

    def measure(part: slice) -> None:
        length[part] = row_norms(after[part] - before[part])

    in_parts(measure, len(before))
    k = int(np.argmax(length))
    return Farthest(float(length[k]), k if numbers is None else int(numbers[k]), before[k])


def stray_warning(setup: Setup, mesh: Mesh, after: FloatArray, found: Farthest) -> list[str]:
    """Return the warning that a node strays from the motion, or [].

    ``mesh`` and ``after``: the mesh, or its skin, and its points (n, d) after the step.
    ``found``: of the whole mesh.
    """
    nodes = np.concatenate([setup.known, setup.classes.sliding])
    most = largest_norm(after[nodes] - mesh.points[nodes])
    if not found.length > STRAY * most > 0.0:
        return []
    where = point_words(found.point, mesh.extent)
    ratio = found.length / most
    radius = setup.basis.radius
    smaller = f"{0.8 * STRAY / ratio * radius / mesh.extent:.2g}"
    factor = f"INFLUENCE_FACTOR= {smaller}"
    if setup.fitted_radius < radius:
        factor = "INFLUENCE_FACTOR= AUTO"
    plain = "" if setup.basis.kernel == ROUGHEST else f"RBF_KERNEL= {ROUGHEST}"
    remedy = listed_or([factor, plain] if plain else [factor])
    sentence = (
        f"node {found.node} at ({where}) moves by {found.length:.3g}, {ratio:.3g} "
        f"times as far as the farthest boundary node ({most:.3g}): the interpolation, whose "
        f"support radius is {radius:.3g}, continues the turning or stretching of the boundary "
        f"beyond it; use {remedy}"
    )
    return [sentence]


def wall_warnings(setup: Setup, case: Case, mesh: Mesh, points: FloatArray) -> list[Message]:
    """Return warnings that nodes left a wall that they should be on.

    These are nodes of moving boundaries that they share with other ones; and, where blades move
    over the span, all nodes of a sliding hub or shroud. ``points`` (n, d): deformed.
    """
    farthest: dict[tuple[str, str], _OffWall] = {}
    kept = "", f"{SLIDE_RIMS} keeps such nodes on it"
    if case.rims == "slide":
        kept = ", to which it cannot be brought back", "move it less"
    fixed = _fixed_rims(case, mesh, setup)
    for off in (
        *_off_span(setup, case, mesh, points),
        *_off_walls(setup, mesh, points, setup.rims, *kept),
        *_off_walls(setup, mesh, points, fixed, *_of_fixed(case)),
    ):
        # A wall with edges has several pieces, and is told of once.
        known = farthest.setdefault((off.boundary, off.wall), off)
        if off.distance > known.distance:
            farthest[off.boundary, off.wall] = off
    return [off.message(mesh, points) for off in farthest.values()]


def check_motion(case: Case, mesh: Mesh) -> tuple[str | None, Message | None]:
    """Return the `motion_messages` of a case of one zone before it runs, or a doubt about it.

    Without these, that a boundary leaves a fixed wall, as `wall_warnings` of the run will.
    """
    moved = on_walls(case, mesh, displaced(moving_nodes(case, mesh), mesh))
    problem, folded = motion_messages(roles_of_copies(case, mesh)[0], mesh, moved)
    return problem, folded or next(_before_run(case, mesh, moved), None)


def _before_run(case: Case, mesh: Mesh, moved: Displacements) -> Iterator[Message]:
    yield from motion_doubts(case, mesh)

    def domain_and_rims() -> tuple[Domain, Rims] | None:
        domain = find_domain(case, mesh)
        rims = _fixed_rims(case, mesh, domain)
        return None if rims is None else (domain, rims)  # a domain is large

    known = _DOMAINS.of(mesh, rims_key(case), domain_and_rims)
    if known is not None:
        points = mesh.points.copy()
        points[moved.nodes] += moved.vectors
        for off in _off_walls(known[0], mesh, points, known[1], *_of_fixed(case)):
            yield off.message(mesh, points)


def _fixed_rims(case: Case, mesh: Mesh, domain: Domain) -> Rims | None:
    return find_rims(case.change(rims="free"), mesh, domain, ("fixed",))


def _of_fixed(case: Case) -> tuple[str, str]:
    """Return the end of the sentence on a fixed wall that nodes left, and the remedy."""
    slides = "" if case.rims == "slide" else f", with {SLIDE_RIMS}"
    return ", which is fixed", f"let that boundary slide{slides}, or move it less"


@frozen
class _OffWall:
    """The node that is farthest from a wall."""

    node: int
    boundary: str  # that has it
    wall: str
    distance: float  # in the mesh's length unit
    why: str  # the rest of the sentence
    remedy: str

    def message(self, mesh: Mesh, points: FloatArray) -> Message:
        """Return that the node has left the wall; ``points`` (n, d): deformed."""
        place = point_words(points[self.node], mesh.extent)
        return Message(
            f"node {mesh.number(self.node)} of {self.boundary} at ({place}) has left {self.wall} "
            f"by {self.distance:.3g}{self.why}",
            self.remedy,
        )


def _off_walls(
    domain: Domain, mesh: Mesh, points: FloatArray, rims: Rims | None, why: str, remedy: str
) -> Iterator[_OffWall]:
    """Yield for each wall with a rim the node of that which is farthest off."""
    if rims is None:
        return
    least = NOISE * float(np.ptp(mesh.points[rims.nodes], axis=0).max())
    for wall in rims.walls:
        nodes = rims.nodes[rims.rim[wall.rows]]
        off = rims.off(wall, points[nodes])
        k = int(np.argmax(off))
        if off[k] > least and off[k] > least + wall.bulge:
            names = [n for n in _names_at(domain, nodes[k]) if domain.roles.get(n) == "moving"]
            who = " and ".join(names)
            yield _OffWall(int(nodes[k]), who, " and ".join(wall.names), float(off[k]), why, remedy)


def _off_span(setup: Setup, case: Case, mesh: Mesh, points: FloatArray) -> Iterator[_OffWall]:
    """Yield for hub and shroud of a span the node that is farthest off, if they slide.

    Nodes may be off as the undeformed facets are, and `OFF_WALL`. Those of `_off_walls` are not
    among them.
    """
    field = setup.span
    boundary = setup.boundary
    rims = setup.known[:0]
    if field is None:
        return
    if setup.rims is not None:
        rims = setup.rims.nodes[setup.rims.rim]
    for end, name in enumerate(span_ends(case, mesh)):
        if setup.roles.get(name) != "sliding":
            continue
        facets = boundary.facets[boundary.marker == boundary.names.index(name)]
        nodes = np.setdiff1d(facets, rims)
        middles = 0.5 * (mesh.points[facets[:, :3]] + mesh.points[facets[:, [1, 2, 0]]])
        coords = field.meridional(points[nodes])
        off = np.abs(field.span(coords)[0] - end)
        of_facets = np.abs(field.span(field.meridional(middles.reshape(-1, 3)))[0] - end)
        allowed = float(of_facets.max()) + OFF_WALL
        k = int(np.argmax(off))
        if off[k] > allowed:
            far = abs(float(field.distances(coords[[k]])[end][0][0]))
            remedy = f"refine {name}" if field.revolved else "let no periodic side cut the blade"
            remedy = f"move the blade less, or {remedy}"
            why = (
                f", {off[k]:.2%} of the span (its facets: {allowed:.2%}): its shape is not known "
                "where the blade stood"
            )
            yield _OffWall(int(nodes[k]), name, "this boundary", far, why, remedy)


def _reach(setup: Setup, shift: FloatArray, largest: float, kinds: tuple[str, ...]) -> float:
    """Return the reach of the motion: how far its boundaries may carry nodes.

    That is the largest displacement, or the largest strain of a boundary times the mesh's extent:
    a smooth function continues the turning or stretching of a body around it, so that a small
    profile turned in a large far field carries nodes the farther, the farther they are from it.
    ``shift`` (n, d): displacement of all nodes in the frame.
    ``largest``: the largest displacement asked for.
    ``kinds``: classes of boundary nodes that count: "moving", "fixed", "sliding".
    """
    chosen = np.zeros(len(shift), bool)
    for kind in kinds:
        chosen[getattr(setup.classes, kind)] = True
    strains = [0.0]
    for index in range(len(setup.boundary.names)):
        nodes = np.unique(setup.boundary.facets[setup.boundary.marker == index])
        nodes = nodes[chosen[nodes]]
        farthest = row_norms(shift[nodes]).max(initial=0.0)
        if len(nodes) > 1 and farthest <= TAKEN * largest:
            at = setup.coords[nodes]
            moved = shift[nodes]
            size = row_norms(at - at.mean(axis=0)).max()
            strains.append(row_norms(moved - moved.mean(axis=0)).max() / size)
    return max(largest, float(max(strains)) * float(np.ptp(setup.coords, axis=0).max()))


def _cause(setup: Setup, mesh: Mesh, moved: FloatArray) -> str:
    nodes = np.concatenate([setup.known, setup.classes.sliding])
    at = setup.coords[nodes]
    shift = (moved - setup.coords)[nodes]
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    near = cKDTree(at).query(at, k=min(2, len(nodes)))
    gaps = np.reshape(near[0], (len(nodes), -1))[:, -1]
    others = np.reshape(near[1], (len(nodes), -1))[:, -1]
    apart = row_norms(shift - shift[others])
    steep = np.divide(apart, gaps, out=np.zeros_like(apart), where=gaps > 0)
    k = int(np.argmax(steep))
    usual = setup.largest / mesh.extent
    less = less_smooth(setup)
    if steep[k] < STEEP * usual:
        return (
            f"{setup.basis.kernel} is too smooth for nodes so close to each other; "
            f"use {listed_or(less)}"
        )
    pair = sorted((int(nodes[k]), int(nodes[others[k]])))
    named = " and ".join(
        f"{mesh.number(node)} ({', '.join(_names_at(setup, node))})" for node in pair
    )
    motion = "let them move more alike"
    if np.isin(pair, setup.classes.fixed).any():
        motion = "make the fixed boundary moving, internal or periodic"
    return (
        f"boundary nodes {named}, {gaps[k]:.2g} apart, have displacements that differ by "
        f"{apart[k]:.3g}, which a smooth function cannot follow; "
        f"{listed_or([motion, *(f'use {remedy}' for remedy in less)])}"
    )


def less_smooth(setup: Setup) -> list[str]:
    """Return what makes a system easier to solve, of what its case does not have yet."""
    kernel = setup.basis.kernel != ROUGHEST
    return [
        *(["DATA_REDUCTION= YES"] if setup.reduction is None else []),
        *([f"a less smooth RBF_KERNEL such as {ROUGHEST}"] if kernel else []),
        "a smaller INFLUENCE_FACTOR",
    ]


def listed_or(remedies: Sequence[str]) -> str:
    """Return remedies as a list with ``or`` before its last one."""
    *others, last = remedies
    return ", or ".join(filter(None, (", ".join(others), last)))


def _names_at(domain: Domain, node: int) -> list[str]:
    mine = (domain.boundary.facets == node).any(axis=1)
    return [domain.boundary.names[k] for k in np.unique(domain.boundary.marker[mine])]
