"""Repair as a stage: which nodes may move to mend bad cells, and what became of these.

The nodes that the case moves or fixes stay to the bit, and so do all away from bad cells. Those of
layers move only where cells stay folded else. Others move freely inside the mesh, along the
boundary that they slide on, and as their periodic images and copies do. Here a boundary with the
role internal is one to slide on: its nodes stay on its surface.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np
from numpy.typing import NDArray

from slideviz.argument_types import check_types
from slideviz.case.check import unknown_markers
from slideviz.case.displacement import Displacements
from slideviz.case.model import Case
from slideviz.case.words import counted
from slideviz.case.zone_cases import zone_cases
from slideviz.elastic.relaxation import Unknowns
from slideviz.errors import CaseError, MeshError, Message, not_one_of, raise_all
from slideviz.mesh.cached_boundary import shell_of
from slideviz.mesh.halo import without_halo
from slideviz.mesh.model import (
    Assembly,
    Cells,
    FloatArray,
    IntArray,
    Mesh,
    Skin,
    checked_reference,
    largest_norm,
    mask_of,
    sealed,
)
from slideviz.mesh.nearest import row_groups
from slideviz.mesh.periodic import find_pairs, pair_up
from slideviz.mesh.quality import VALID, Quality, quality
from slideviz.mesh.repair.freedom import Freedom
from slideviz.mesh.repair.repair import Impossible, quality_ratings, repair_mesh
from slideviz.mesh.zones import spellings, with_zones, zones_of
from slideviz.solver.domain import find_domain
from slideviz.solver.layers import layer_zone
from slideviz.solver.prescribed import BoundaryConditions
from slideviz.solver.remedies import MOST_NAMES
from slideviz.solver.setup import Setup, elastic_body, setup_of
from slideviz.solver.stepping import problem_at
from slideviz.solver.steps import MeshRepair, Progress, Step, step_timer
from slideviz.system.threads import Tick, equal_shares
from slideviz.terms import REPAIR_TARGETS, SKEW_METRICS, SLIDES, RepairTarget, Role, SkewMetric

LIFTED = 1.0
LOSS = 0.002
"""Of the cells that are lifted after a relaxation: their number over the root of that of all cells,
and how much lower the mean quality may be for it."""

_NO_IMAGES = "they are not images of each other; name two that are"


@check_types
def repair(
    mesh: Mesh,
    reference: Mesh | None = None,
    *,
    fixed: Sequence[str] = (),
    sliding: Sequence[str] = (),
    periodic: Sequence[str] = (),
    below: float = 0.1,
    target: RepairTarget | None = None,
    metric: SkewMetric = "knupp",
    progress: Callable[[Progress], None] | None = None,
) -> MeshRepair:
    """Return a mesh with its inverted and poor cells mended, whoever made it, without a motion.

    Parameters
    ----------
    mesh
        The mesh to mend.
    reference
        The undeformed mesh, with the same cells.
    fixed, sliding, periodic
        Boundaries whose nodes stay, slide along it, or move as their images (in pairs). Those that
        are not named stay.
    below
        Valid cells are mended, too, if their quality is below this, and below that of all cells of
        the reference. With 0 only cells that are not proved valid are mended.
    target
        The shapes that mended cells shall have: those of the reference, or the ideal ones in the
        local size. By default those of the reference, if there is one.
    metric
        Of the quality.
    progress
        Called often with a ``Progress``; an exception it raises ends the work at once.

    Raises
    ------
    CaseError
        The mesh has no such boundary, one is named twice, or periodic ones are not pairs; ``below``
        is below 0 or not below 1; another target or metric, or the reference's without one.
    MeshError
        Periodic boundaries do not match, or the reference has other cells.

    Examples
    --------
    The node in the middle of four squares is outside of them:

    >>> import slideviz as sv
    >>> points = [[x, y] for y in (0.0, 1.0, 2.0) for x in (0.0, 1.0, 2.0)]
    >>> points[4] = [2.5, 1.0]
    >>> squares = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    >>> mended = sv.repair(sv.Mesh(points, sv.Cells.from_blocks([(9, squares)])))
    >>> len(mended.cells), len(mended.left)
    (2, 0)
    >>> mended.nodes
    array([4])
    """
    problems = [
        f"{name}: {not_one_of(value, known)}"
        for name, value, known in (
            ("target", target or "ideal", REPAIR_TARGETS),
            ("metric", metric, SKEW_METRICS),
        )
        if value not in known
    ]
    if target == "reference" and reference is None:
        problems.append("target: 'reference' needs the undeformed mesh; give it, or take 'ideal'")
    lists: dict[Role, Sequence[str]] = {"fixed": fixed, "sliding": sliding, "periodic": periodic}
    case = _case_alone(mesh, lists, below, problems)
    if reference is not None:
        reference = checked_reference(reference, mesh)
    report = progress or (lambda _: None)
    timer = step_timer(report)
    shapes = None if target == "ideal" else reference
    with timer.phase("repair") as tick:
        return mend(case.change(quality_metric=metric), mesh, mesh, shapes, tick)


def _case_alone(
    mesh: Mesh, lists: Mapping[Role, Sequence[str]], below: float, problems: Sequence[str]
) -> Case:
    """Return the case of a repair without motion; CaseError with all mistakes and ``problems``."""
    roles: dict[str, Role] = {}
    known = spellings(mesh)
    lists = {role: [known.get(name, name) for name in names] for role, names in lists.items()}
    for role, names in lists.items():
        roles |= {name: role for name in names if name not in roles}
    twice = tuple(
        f"{name!r} is both {roles[name]} and {role}; name it once"
        for role, names in lists.items()
        for name in names
        if roles[name] != role
    )
    case = Case(roles=roles, repair="yes")
    wrong = list[str | Message]()
    try:
        case = case.change(repair_below=below)
    except CaseError as problem:
        wrong += [replace(message, place=("below",)) for message in problem.messages]
    periodic = case.markers_with("periodic")
    if len(periodic) % 2:
        rule = "boundaries repeat in pairs, so name both of each"
        wrong.append(f"periodic: {', '.join(periodic)}; {rule}")
    raise_all((*problems, *twice, *unknown_markers(mesh, roles), *wrong))
    if lists["sliding"] or periodic:
        case = case.change(sliding="ps")
    if periodic:
        case = case.change(periodic="moving")
        for pair in find_pairs(mesh):
            if pair.first in periodic and pair.second in periodic:
                case = case.change(axis=pair.axis, origin=pair.origin)
        try:
            pair_up(without_halo(mesh)[0], periodic, "auto", case.axis, case.origin)
        except MeshError as problem:
            messages = (replace(m, remedy=m.remedy and _NO_IMAGES) for m in problem.messages)
            raise MeshError(*messages) from None
    return case


def mended_step(
    case: Case, mesh: Mesh, setup: Setup | None, report: Callable[[Progress], None], step: Step
) -> Step:
    """Return a step of a run with its bad cells mended; ``mesh`` is undeformed."""
    timer = step_timer(report, step.index, step.total)
    with timer.phase("repair") as tick:
        lifts = setup is not None and step.relaxed is not None
        done = mend(case, mesh, step.mesh, mesh.undeformed, tick, setup, lifts=lifts)
    seconds = {**step.seconds, "repair": timer.seconds["repair"]}
    return replace(step, mesh=done.mesh, repaired=done, seconds=seconds)


def mended_frame(
    case: Case, mesh: Mesh, step: Step | None, report: Callable[[Progress], None]
) -> Step:
    """Return the last step of a run, mended afterwards; without one, the mesh as a mended step."""
    if step is not None:
        done = mended_step(case, mesh, None, report, step)
    else:
        moving = dict.fromkeys(case.markers_with("moving"), "fixed")
        case = case.change(roles={**case.roles, **moving}, motions=())
        step = Step(1, 1, mesh, 0, 0.0, nan, node_counts={}, seconds={}, messages=())
        timer = step_timer(report)
        with timer.phase("repair") as tick:
            mended = mend(case, mesh, mesh, None, tick)
        done = replace(step, mesh=mended.mesh, repaired=mended, seconds=timer.seconds)
    assert done.repaired is not None
    return replace(done, messages=tuple(dict.fromkeys((*done.messages, *done.repaired.warnings))))


def mend(
    case: Case,
    mesh: Mesh,
    now: Mesh,
    reference: Mesh | None,
    tick: Tick,
    setup: Setup | None = None,
    *,
    lifts: bool = False,
) -> MeshRepair:
    """Return a mesh with its bad cells mended.

    ``case``: roles and settings.
    ``mesh`` and ``now``: the mesh whose boundaries nodes slide on, undeformed, and the one to mend.
    ``reference``: the mesh whose shapes cells shall have; None: the ideal ones.
    ``setup``: that of the run, if there was one.
    ``lifts``: whether the lowest of the valid cells are lifted, too.
    """
    if isinstance(mesh, Assembly) and isinstance(now, Assembly):
        return _mended_zones(case, mesh, now, reference, tick)
    domain, cells = without_halo(now)
    shapes = None if reference is None else without_halo(reference)[0]
    metric = case.quality_metric
    found = quality(domain, shapes, metric)
    limit = case.repair_below
    goal = limit
    if shapes is not None:
        undeformed = quality(shapes, metric=metric).min
        limit = min(limit, undeformed)
        goal = min(undeformed, max(limit, _low_quality(found))) if lifts else limit
    if not (quality_ratings(found) < goal).any():
        none = np.empty(0, np.int64)
        return MeshRepair(now, none, none, none, none, none, now.points[none], 0.0)
    freedom = find_freedom(case, mesh, now.points, setup)
    layers = _layers(case, mesh.undeformed) if setup is None else setup.rigid
    mending, lifting = equal_shares(tick, 2)
    done = repair_mesh(
        domain, freedom, shapes, layers=layers, below=limit, metric=metric, report=mending
    )
    points = done.points
    if setup is not None and goal > limit and not len(done.folded_after):
        plain = domain.with_points(points)
        stays = np.concatenate([layers, _first_layers(domain.cells, setup)])
        lifted = repair_mesh(
            plain, freedom, shapes, layers=stays, below=goal, metric=metric, report=lifting
        ).points
        mean = quality(domain.with_points(lifted), shapes, metric).mean
        if mean >= quality(plain, shapes, metric).mean - LOSS:
            points = lifted
    if now.halo is not None:
        beyond = np.flatnonzero(np.isin(now.halo.receivers, now.halo.outer))
        points = now.halo.move_receivers(now.points, points, beyond)
    moved = np.flatnonzero((points != now.points).any(axis=1))
    number = now.file_cells(np.arange(len(now.cells)) if cells is None else cells)
    mended = now.with_points(sealed(points))
    before = sealed(now.points[moved])
    unmendable, warnings = unmendable_words(done.impossible, mesh, number)
    poor = domain.cells.take(np.setdiff1d(done.bad_after, done.folded_after))
    return MeshRepair(
        mended,
        np.unique(number[done.bad_before]),
        np.unique(number[done.bad_after]),
        np.unique(number[found.status != VALID]),
        np.unique(number[done.folded_after]),
        moved,
        before,
        largest_norm(now.points[moved] - mended.points[moved]),
        unmendable,
        (*warnings, *moved_layers(np.isin(layers, moved)), *slide_advice(case, mesh, poor, limit)),
    )


def _low_quality(found: Quality) -> float:
    """Return the quality below which as many cells as `LIFTED` says are."""
    count = min(int(LIFTED * np.sqrt(len(found.values))), len(found.values) - 1)
    return float(np.partition(found.values, count)[count])


def _first_layers(cells: Cells, setup: Setup) -> IntArray:
    """Return the nodes of a run's layers in cells at moving boundaries: they have first heights."""
    if setup.zone is None:
        return setup.rigid
    wall = mask_of(len(setup.coords), setup.classes.moving)
    rows = [nodes[wall[nodes].any(axis=1)].ravel() for _, nodes in cells.by_type.values()]
    return np.intersect1d(np.concatenate(rows), setup.zone.nodes)


def _layers(case: Case, mesh: Mesh) -> IntArray:
    """Return the nodes of layers (LAYERS) of an undeformed mesh without the setup of its run."""
    domain = find_domain(case, mesh)
    known = np.concatenate([domain.classes.moving, domain.classes.fixed])
    zone = layer_zone(case, mesh, domain, known)
    return known[:0] if zone is None else zone.rigid


def moved_layers(moved: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the warning that nodes of layers were moved, or (); ``moved`` (l,): of each node."""
    if not moved.any():
        return ()
    sentence = (
        f"{counted(int(moved.sum()), 'node')} of layers moved to mend folded cells, which the "
        "others could not: first heights change there; move the boundary less, or set a smaller "
        "LAYER_THICKNESS"
    )
    return (sentence,)


def _mended_zones(
    case: Case, mesh: Assembly, now: Assembly, reference: Mesh | None, tick: Tick
) -> MeshRepair:
    """Return a mesh of all zones with the bad cells of each mended."""
    shapes = (None,) * mesh.zones if reference is None else zones_of(reference)
    shares = equal_shares(tick, mesh.zones)
    each = zip(
        zone_cases(case, mesh, False), zones_of(mesh), zones_of(now), shapes, shares, strict=True
    )
    done = {k: mend(*of_zone) for k, of_zone in enumerate(each)}
    mended = MeshRepair.joined(mesh, with_zones(now, [one.mesh for one in done.values()]), done)
    assert mended is not None
    return mended


def unmendable_words(
    impossible: Sequence[Impossible], mesh: Mesh, number: IntArray | None = None
) -> tuple[tuple[tuple[int, str], ...], tuple[str, ...]]:
    """Return the cells that no motion of free nodes mends, with reasons, and a warning of them.

    ``mesh``: it has the markers.
    ``number`` (m,): numbers of the cells that were repaired, if they are not all.
    """
    if not impossible:
        return (), ()
    nodes = {marker.name: mesh.numbers(marker.nodes) for marker in mesh.markers}

    def on(ones: Sequence[Impossible]) -> str:
        wrong = np.concatenate([one.nodes for one in ones])
        names = [name for name, some in nodes.items() if np.isin(wrong, some).any()]
        layers = " in layers" if any(one.layered for one in ones) else ""
        return f"held on {' and '.join(names)}{layers}" if names else f"held{layers}"

    reasons = {
        one.cell if number is None else int(number[one.cell]): f"its nodes are {on([one])}"
        for one in impossible
    }
    cells = [*reasons]
    first = ", ".join(map(str, cells[:5]))
    first += " ..." if len(cells) > 5 else ""
    sentence = (
        f"{counted(len(cells), 'cell')} cannot be mended ({first}): the nodes that make them bad "
        f"are {on(impossible)}, so moving the others does not help; let that boundary slide, "
        "move it less, or mend its mesh"
    )
    return tuple(reasons.items()), (sentence,)


def slide_advice(case: Case, mesh: Mesh, poor: Cells, limit: float) -> tuple[str, ...]:
    """Return the warning that cells stay poor beside boundaries whose role nobody chose, or ().

    ``mesh``: it has the markers.
    ``poor``: the cells that are proved valid, but below a limit after the repair.
    """
    beside = [
        marker.name
        for marker in mesh.markers
        if marker.name not in case.roles and np.isin(mesh.numbers(marker.nodes), poor.nodes).any()
    ]
    if not beside:
        return ()
    few = len(beside) <= MOST_NAMES
    who = " and ".join(beside) if few else f"{len(beside)} boundaries ({', '.join(beside)})"
    one = len(beside) == 1
    off = f", with SLIDING_MODE= {SLIDES}" if case.sliding == "none" else ""
    sentence = (
        f"{counted(len(poor), 'cell')} {'stays' if len(poor) == 1 else 'stay'} poor after repair, "
        f"below {limit:.3g}, beside {who}, which {'is' if one else 'are'} fixed only because no "
        f"role was chosen; let {'it' if one else 'them'} slide{off}"
    )
    return (sentence,)


def repair_case(case: Case) -> Case:
    """Return the case in which internal boundaries are ones to slide on."""
    if "internal" not in case.roles.values():
        return case
    roles: dict[str, Role] = {
        name: "sliding" if role == "internal" else role for name, role in case.roles.items()
    }
    way = "ps" if case.sliding == "none" else case.sliding
    return case.change(roles=roles, sliding=way, relax="no", layers="no")


def still_setup(case: Case, mesh: Mesh, points: FloatArray) -> Setup:
    """Return the setup of a mesh whose known nodes have come to ``points`` (n, d) already."""
    domain = find_domain(case, mesh)
    known = np.concatenate([domain.classes.moving, domain.classes.fixed])
    gone = domain.frame.coords(points[known]) - domain.coords[known]
    nothing = Displacements(known[:0], points[:0])
    return setup_of(case, mesh, domain, BoundaryConditions(known, gone, nothing, ()))


def find_freedom(case: Case, mesh: Mesh, points: FloatArray, setup: Setup | None = None) -> Freedom:
    """Return the freedom of the nodes of a mesh that was deformed to ``points`` (n, d).

    ``mesh``: undeformed, with its halo. Nodes slide on its boundaries. It may be a skin.
    ``setup``: that of the run, if there was one: its known nodes stay.
    """
    if not mesh.markers:
        return Freedom.within(mesh.dim, mask_of(len(points), shell_of(mesh)))
    sliding = repair_case(case)
    # What stays is as in the run, where without a sliding method all other boundaries do.
    classes = find_domain(case, mesh).classes if setup is None else setup.classes
    known = np.concatenate([classes.moving, classes.fixed])
    if setup is None or sliding is not case:
        setup = still_setup(sliding, mesh, points)
    held = np.concatenate([known, setup.known])
    if not isinstance(mesh, Skin):
        held = np.concatenate([held, unmarked_sides(mesh, setup.boundary.facets).ravel()])
    if mesh.halo is not None:  # copies that are not images would have to follow their donors
        copies = np.setdiff1d(mesh.halo.receivers, setup.images)
        pairs = np.isin(mesh.halo.receivers, np.setdiff1d(copies, mesh.halo.outer))
        held = np.concatenate([held, copies, mesh.halo.donors[pairs]])
    held = np.unique(setup.classes.representative[held])
    frame = setup.frame
    coords = setup.frame.coords(points)
    body = elastic_body(mesh, frame, setup.axis)
    problem = problem_at(setup, coords, coords[setup.known])

    slides = mask_of(len(points), setup.classes.sliding)
    # A run takes nodes of internal boundaries off these: they move in planes beside their surface,
    # whose normals are those before (facets beside a boundary that moved away have others).
    inner = slides & _only_on(mesh, case.markers_with("internal"))
    before = setup.constraints(setup.coords)[1]

    def constraints(coords: FloatArray) -> tuple[IntArray, FloatArray]:
        nodes, normals = setup.constraints(coords)
        return nodes, np.where(inner[nodes][:, None], before, normals)

    unknowns = Unknowns.of(problem, body, held).on(constraints, coords)
    place = sealed(unknowns.place)
    bound = np.flatnonzero(np.isin(place, unknowns.blocks))
    bound = np.union1d(bound, unknowns.turned)
    maps = unknowns.maps(bound)
    if not (setup.tracks.curved or frame.cylindrical):  # an arc about the axis is straight there
        return Freedom(place, bound, maps, bound[:0])
    curved = np.flatnonzero(slides & (place >= 0))

    def maps_at(coords: FloatArray, nodes: IntArray) -> FloatArray:
        return unknowns.on(constraints, coords).maps(nodes)

    project = _projection(setup, points, coords, inner, maps_at)
    return Freedom(place, bound, maps, curved, project)


def _only_on(mesh: Mesh, names: Sequence[str]) -> NDArray[np.bool_]:
    """Return a mask (n,) of the nodes that are on boundaries of these names, and on no others."""
    mask = np.zeros(len(mesh.points), bool)
    for inside in (True, False):
        for marker in mesh.markers:
            if (marker.name in names) == inside:
                mask[marker.nodes] = inside
    return mask


def _orthonormal(nodes: IntArray, normals: FloatArray, count: int) -> list[FloatArray]:
    """Return arrays (n, d) of the first, second... normals of each node, made orthogonal; or 0."""
    order = np.argsort(nodes, kind="stable")
    place = np.arange(len(nodes)) - np.searchsorted(nodes[order], nodes[order])
    out: list[FloatArray] = []
    for k in range(place.max(initial=-1) + 1):
        rows = np.zeros((count, normals.shape[1]))
        at = order[place == k]
        rows[nodes[at]] = normals[at]
        for other in out:
            rows -= other * (other * rows).sum(axis=1, keepdims=True)
        length = np.linalg.norm(rows, axis=1, keepdims=True)
        out.append(np.divide(rows, length, out=np.zeros_like(rows), where=length > 1e-9))
    return out


def _projection(
    setup: Setup,
    at: FloatArray,
    start: FloatArray,
    inner: NDArray[np.bool_],
    maps_at: Callable[[FloatArray, IntArray], FloatArray],
) -> Callable[[IntArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Return the function that puts sliding nodes back on their boundary (`Freedom.project`).

    ``at``, ``start`` (n, d): points and coordinates before the repair.
    ``inner`` (n,): nodes that move in the planes of their normals before, wherever they are.
    ``maps_at``: returns the maps of nodes at coordinates.
    """
    frame = setup.frame
    representative = setup.classes.representative
    normals = _orthonormal(*setup.constraints(setup.coords), len(at))

    def project(nodes: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        one = representative[nodes]
        own = np.flatnonzero(one == nodes)
        free = frame.coords(points[own]) - start[nodes[own]]
        slid = np.zeros_like(start)
        slid[nodes[own]] = setup.project(start, nodes[own], free)
        for rows in normals:
            free = free - rows[nodes[own]] * (rows[nodes[own]] * free).sum(axis=1, keepdims=True)
        slid[nodes[own]] = np.where(inner[nodes[own], None], free, slid[nodes[own]])
        now = start.copy()
        now[nodes] += slid[one]
        # A node in its place keeps its bits.
        stays = ~slid[one].any(axis=1, keepdims=True)
        return np.where(stays, at[nodes], frame.points(now[nodes])), maps_at(now, nodes)

    return project


def unmarked_sides(mesh: Mesh, marked: IntArray) -> IntArray:
    """Return the outer sides (s, 2 or 4) that are none of ``marked`` (f, 2 or 4)."""
    shell = shell_of(without_halo(mesh)[0])
    group = row_groups(np.sort(np.concatenate([marked, shell]), axis=1))
    return shell[~np.isin(group[len(marked) :], group[: len(marked)])]
