"""Deformation of boxes and of the nodes inside by a list of moves, and its exact derivatives.

SU2 8, ``CSurfaceMovement::SetSurface_Deformation``: boxes are deformed level by level in their
order, each by its moves in the order of the list. A node in several boxes goes where the last one
takes it. Of nested boxes, the control points of the inner one are carried by the outer one.
Parametric coordinates of points are found by Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product

import numpy as np

from slideviz.argument_types import frozen, record
from slideviz.errors import CaseError
from slideviz.ffd.box import CARTESIAN, Box, Embedding
from slideviz.ffd.kinds import Move, Shift, Twist
from slideviz.mesh.model import BoolArray, FloatArray, IntArray, row_norms

INSIDE = 1e-8
"""A parametric coordinate may be so far outside of [0, 1]: a point on a side is inside."""
MET = 1e-13
"""Distance from a point at which Newton's method ends, in parts of the box's size on each axis."""
CLOSE = 1e-9  # largest distance at which a point counts as found, in the same measure
ROUNDING = 1e-14  # part of the largest coordinate that is added to `CLOSE`
STEPS = 40
HALVINGS = 12
STARTS = 4
"""Most steps of Newton's method, most halvings of a step, and number of starts of a point."""
SAMPLES = 3  # sampled points for each control point and direction; the nearest ones are the starts
REACH = 0.5  # Newton's method stays so near to [0, 1] in each parametric coordinate
CHUNK = 20_000  # points solved for together


def parametric(box: Box, points: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the parametric coordinates of points, and which points are in the box.

    Returns ``uvw`` (m, 3): in [0, 1]; NaN outside of the box; ``inside`` (m,) bool.
    ``points`` (m, 3) or (m, 2) float64: in 2D, points of the plane z = 0.
    """
    spatial = np.zeros((len(points), 3))
    spatial[:, : points.shape[1]] = points
    if box.system.kind != "CARTESIAN":
        straight = replace(box, points=box.q, system=CARTESIAN)
        return parametric(straight, box.system.q_of(spatial))
    control = box.points.reshape(-1, 3)
    low = control.min(axis=0)
    high = control.max(axis=0)
    # A point of the box is a mean of control points, with weights that are not negative.
    size = high - low
    slack = INSIDE * size
    near = ((spatial >= low - slack) & (spatial <= high + slack)).all(axis=1)
    uvw = np.full(spatial.shape, np.nan)
    chosen = np.flatnonzero(near)
    for first in range(0, len(chosen), CHUNK):
        rows = chosen[first : first + CHUNK]
        uvw[rows] = _solved(box, spatial[rows], size)
    inside = _are_inside(uvw)
    uvw[~inside] = np.nan
    return np.clip(uvw, 0.0, 1.0), inside


def _closest(points: FloatArray, size: FloatArray) -> float:
    """Return the distance over the size of a box (3,) within which a point is met."""
    return CLOSE + ROUNDING * float((np.abs(points).max(initial=0.0) / size).max())


def _are_inside(uvw: FloatArray) -> BoolArray:
    return np.asarray(((uvw >= -INSIDE) & (uvw <= 1.0 + INSIDE)).all(axis=1))


def placed_again(box: Box, points: FloatArray, uvw: FloatArray) -> FloatArray:
    """Return the parametric coordinates (m, 3) of points (m, 3) near known ones, uvw (m, 3).

    They may be outside of [0, 1]. Raises CaseError if the box has no such point there.
    """
    size = np.ptp(box.points.reshape(-1, 3), axis=0)
    found, gap = _newton(box, points, uvw, size)
    if (gap > _closest(points, size)).any():
        raise CaseError(
            f"the FFD box {box.name!r} folds over, or loses nodes, where its parent or one inside "
            "it moves these; move control points less"
        )
    return found


def _solved(box: Box, points: FloatArray, size: FloatArray) -> FloatArray:
    """Return the parametric coordinates (m, 3) of points (m, 3), NaN where none are found.

    They may be outside of [0, 1]. ``size`` (3,) is that of the box along each axis.
    """
    # Late: scipy.spatial takes 0.1 s.
    from scipy.spatial import cKDTree

    steps = [np.linspace(0.0, 1.0, SAMPLES * (degree + 1)) for degree in box.degrees]
    seeds = np.array(list(product(*steps)))
    _, nearest = cKDTree(box.at(seeds)).query(points, k=min(STARTS, len(seeds)))
    coordinates = np.full(points.shape, np.nan)
    left = np.arange(len(points))
    close = _closest(points, size)
    for start in np.atleast_2d(nearest.T):
        uvw, gap = _newton(box, points[left], seeds[start[left]], size)
        met = gap <= close
        coordinates[left[met]] = uvw[met]
        # Outside of the box there may be a second solution within it, where it is bent.
        left = left[~(met & _are_inside(uvw))]
        if not len(left):
            break
    return coordinates


def _newton(
    box: Box, points: FloatArray, uvw: FloatArray, size: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return Newton's end from ``uvw`` (m, 3), and its distance (m,) over the size of the box."""
    uvw = uvw.copy()
    remaining = points - box.at(uvw)
    gap = row_norms(remaining / size)
    going = np.flatnonzero(gap > MET)
    for _ in range(STEPS):
        if not len(going):
            break
        step = uvw_step(box.slopes(uvw[going]), remaining[going])
        scale = np.ones(len(going))
        better = np.zeros(len(going), bool)
        for _ in range(HALVINGS):
            rows = going[~better]
            trial = np.clip(uvw[rows] + scale[~better, None] * step[~better], -REACH, 1.0 + REACH)
            there = points[rows] - box.at(trial)
            left = row_norms(there / size)
            good = left < gap[rows]
            uvw[rows[good]] = trial[good]
            remaining[rows[good]] = there[good]
            gap[rows[good]] = left[good]
            better[np.flatnonzero(~better)[good]] = True
            if better.all():
                break
            scale[~better] *= 0.5
        going = going[better & (gap[going] > MET)]
    return uvw, gap


def uvw_step(slopes: FloatArray, rest: FloatArray) -> FloatArray:
    """Return the changes (m, 3) of uvw that shift points by ``rest`` (m, 3), to first order.

    They are least-squares ones if any derivative, ``slopes`` (m, 3, 3), is singular.
    """
    try:
        step = np.linalg.solve(slopes, rest[..., None])[..., 0]
    except np.linalg.LinAlgError:
        step = np.einsum("mij,mj->mi", np.linalg.pinv(slopes), rest)
    return np.asarray(step)


@frozen
class Limits:
    """What keeps boxes from being deformed too much."""

    bound: float = np.inf  # OPT_LINE_SEARCH_BOUND: largest displacement of a node by a box
    iterations: int = 0
    depth: int = 3
    """`iterations`, `depth`: FFD_INTPREV_ITER and FFD_INTPREV_DEPTH; 0 iterations: boxes may
    intersect themselves."""


@record
class DrivenMove:
    """A link between a design variable and a move of a box."""

    box: str
    move: Move
    value: int  # place of the value in the design
    relaxed: bool = True  # whether the relaxation factor multiplies it


@dataclass(eq=False)
class _Rates:
    value: int
    nodes: FloatArray
    change: dict[str, FloatArray]
    uvw: dict[str, FloatArray]
    amounts: dict[str, list[float]]
    relax: float = 0.0


@dataclass(eq=False)
class BoxDeformation:
    """The displacement of nodes by boxes that a design deforms."""

    boxes: Sequence[Box]  # undeformed, in the order of the file
    inside: dict[str, Embedding]  # nodes in each box, by their place in 0..m-1
    drives: Sequence[DrivenMove]
    values: FloatArray  # (v,): the design
    relax: float  # OPT_RELAX_FACTOR
    count: int  # m, the number of nodes
    limits: Limits = field(default_factory=Limits)
    nodes: FloatArray = field(init=False)  # (m, 3): the displacement
    change: dict[str, FloatArray] = field(init=False)
    """dict of str to (I, J, K, 3): change of the control points of each box, in its coordinates
    q."""
    notes: list[str] = field(init=False, default_factory=list)
    """What the limits did, and which nodes a later box took over."""
    missed: set[int] = field(init=False, default_factory=set)
    """Values whose twist has no centre, so that they do nothing."""

    def __post_init__(self) -> None:
        self._by_name = {box.name: box for box in self.boxes}
        self._carried = {box.name: self._in_parent(box) for box in self.boxes if box.parent}
        self._tape: list[Callable[[_Rates], None]] = []
        self._done: dict[str, list[tuple[DrivenMove, float]]] = {}
        self._factor = 1.0
        self._relax = self.relax
        self._embedded = dict(self.inside)
        self.nodes = np.zeros((self.count, 3))
        self.change = {box.name: np.zeros(box.points.shape) for box in self.boxes}
        self._placed: set[str] = set()
        for level in sorted({box.level for box in self.boxes}):
            for box in self.boxes:
                if box.level == level:
                    self._deform(box)

    def slope(self, value: int) -> FloatArray:
        """Return the derivative (m, 3) of the displacement with respect to a value."""
        rates = _Rates(value, np.zeros((self.count, 3)), {}, {}, {})
        for step in self._tape:
            step(rates)
        return rates.nodes

    def moved(self) -> dict[str, Box]:
        """Return the deformed boxes, by name."""
        changed = ((box, self.change[box.name]) for box in self.boxes)
        return {box.name: box.moved(change) if change.any() else box for box, change in changed}

    def uvw(self) -> dict[str, tuple[IntArray, FloatArray]]:
        """Return nodes (k,) and parametric coordinates (k, 3) of boxes where these have changed.

        They are where the deformed box has the deformed nodes: of nested boxes, and of those that
        have nested ones.
        """
        outer = {box.parent for box in self.boxes}
        boxes = {}
        for box in self.boxes:
            if not box.level and box.name not in outer:
                continue
            inside = self._embedded[box.name]
            moved = box.moved(self.change[box.name])
            there = self._base(box) + self.nodes[inside.nodes]
            if len(there):
                boxes[box.name] = inside.nodes, placed_again(moved, there, inside.uvw)
        return boxes

    def _in_parent(self, box: Box) -> Embedding:
        """Return the control points of a nested box, embedded in its parent."""
        parent = self._by_name[box.parent]
        points = box.points.reshape(-1, 3)
        uvw, inside = parametric(parent, points)
        if not inside.all():
            raise CaseError(
                f"the FFD box {box.name!r} is not inside its parent {box.parent!r}, which could "
                "not carry it; make it smaller"
            )
        return parent.embed(np.arange(len(points)), uvw)

    def _base(self, box: Box) -> FloatArray:
        return box.system.points_of(self.inside[box.name].sums(box.q))

    def _deform(self, box: Box) -> None:
        if box.level:
            self._carry(box)
        self._apply(box, 1.0)
        self._place(box)
        self._bound(box)
        if self.limits.iterations:
            self._unfold(box)

    def _carry(self, box: Box) -> None:
        """Move the control points of a nested box with its parent; embed its nodes anew."""
        name = box.name
        parent = box.parent
        cage = self._carried.get(box.name)
        change = np.zeros(box.points.shape)
        if cage is not None:
            change = cage.sums(self.change[parent]).reshape(change.shape)
        inside = self._embedded[name]
        self.change[name] = change
        at = box.moved(change)
        there = self._base(box) + self.nodes[inside.nodes]
        inside = box.embed(inside.nodes, placed_again(at, there, inside.uvw))
        self._embedded[name] = inside
        slopes = at.slopes(inside.uvw)

        def rates_of(rates: _Rates) -> None:
            if cage is not None and parent in rates.change:
                rates.change[name] = cage.sums(rates.change[parent]).reshape(change.shape)
            shifted = rates.nodes[inside.nodes]
            if name in rates.change:
                shifted = shifted - inside.sums(rates.change[name])
            rates.uvw[name] = uvw_step(slopes, shifted)

        self._tape.append(rates_of)

    def _apply(self, box: Box, part: float) -> None:
        part *= self._factor
        for drive in self.drives:
            if drive.box != box.name:
                continue
            relax = self._relax if drive.relaxed else 1.0
            amount = relax * float(self.values[drive.value]) * part
            points = box.q + self.change[box.name]
            if isinstance(drive.move, Twist) and drive.move.turn(points) is None:
                self.missed.add(drive.value)
            self.change[box.name] = self.change[box.name] + drive.move.change(points, amount)
            self._done.setdefault(box.name, []).append((drive, amount))
            self._tape.append(partial(self._moved, drive, points, amount, relax, part))

    def _moved(
        self,
        drive: DrivenMove,
        points: FloatArray,
        amount: float,
        relax: float,
        part: float,
        rates: _Rates,
    ) -> None:
        """Carry the rates of control points through a move by value * relax * part."""
        before = rates.change.get(drive.box)
        rate = relax * part if rates.value == drive.value else 0.0
        if drive.relaxed:
            rate += rates.relax * float(self.values[drive.value]) * part
        rates.amounts.setdefault(drive.box, []).append(rate)
        if before is not None:
            rates.change[drive.box] = before = drive.move.pushed(points, amount, before)
        if rate:
            mine = rate * drive.move.slope(points, amount)
            rates.change[drive.box] = mine if before is None else before + mine

    def _place(self, box: Box) -> None:
        """Displace the nodes of a box to where its control points take them now."""
        name = box.name
        inside = self._embedded[box.name]
        done = tuple(self._done.get(name, ()))
        shifts = all(isinstance(drive.move, Shift) for drive, _ in done)
        if box.system.kind == "CARTESIAN" and not box.level and shifts:
            # One sum for each value, as a slope has.
            total = np.zeros((len(inside.nodes), 3))
            for drive, amount in done:
                assert isinstance(drive.move, Shift)
                total += amount * inside.sums(drive.move.unit)

            def rates_of(rates: _Rates) -> None:
                total = np.zeros((len(inside.nodes), 3))
                for (drive, _), rate in zip(done, rates.amounts.get(name, ()), strict=True):
                    if rate:
                        assert isinstance(drive.move, Shift)
                        total += rate * inside.sums(drive.move.unit)
                rates.nodes[inside.nodes] = total

        else:
            q = inside.sums(box.q + self.change[name])
            total = box.system.points_of(q) - self._base(box)
            if not self.change[name].any():
                total[:] = 0.0
            slopes = box.moved(self.change[name]).slopes(inside.uvw)

            def rates_of(rates: _Rates) -> None:
                rate = np.zeros((len(inside.nodes), 3))
                if name in rates.change:
                    rate = inside.sums(rates.change[name])
                if name in rates.uvw:
                    rate = rate + np.einsum("mij,mj->mi", slopes, rates.uvw[name])
                rates.nodes[inside.nodes] = box.system.pushed(q, rate)

        self._overtake(box)
        self.nodes[inside.nodes] = total
        self._tape.append(rates_of)

    def _overtake(self, box: Box) -> None:
        """Note how many nodes a box takes over from boxes before it."""
        if box.name in self._placed:
            return
        self._placed.add(box.name)
        nodes = self._embedded[box.name].nodes
        lost = int(self.nodes[nodes].any(axis=1).sum())
        if lost and not box.level:
            self.notes.append(
                f"{lost} nodes in the FFD box {box.name!r} are also in an earlier box; as in SU2, "
                "they move with the last box only"
            )

    def _bound(self, box: Box) -> None:
        """Scale the displacement of a box back to the bound, as SU2 does: by one more pass."""
        nodes = self._embedded[box.name].nodes
        lengths = row_norms(self.nodes[nodes])
        bound = self.limits.bound
        largest = float(lengths.max(initial=0.0))
        if largest <= bound:
            return
        node = nodes[int(np.argmax(lengths))]
        vector = self.nodes[node].copy()
        before = self._relax
        self._relax = before * (bound / largest - 1.0)

        def rates_of(rates: _Rates) -> None:
            growth = float(vector @ rates.nodes[node]) / largest
            shrunk = rates.relax * (bound / largest - 1.0)
            rates.relax = shrunk - before * bound / largest**2 * growth

        self._tape.append(rates_of)
        self._apply(box, 1.0)
        self._place(box)
        text = (
            f"OPT_LINE_SEARCH_BOUND: the FFD box {box.name!r} would move a node by {largest:.6g}; "
            f"its variables are scaled back to {bound:g}"
        )
        mine = [drive for drive in self.drives if drive.box == box.name]
        if not all(drive.relaxed for drive in mine):
            text += ", but variables with several values are applied twice, as in SU2"
        if after := self._after(box, relaxed=True):
            text += (
                f"; as in SU2, the variables of {after} get {self._relax:.6g} for OPT_RELAX_FACTOR"
            )
        self.notes.append(text)

    def _after(self, box: Box, *, relaxed: bool = False) -> str:
        """Return the boxes with moves that are deformed after a box, in words; "" if none is."""
        order = sorted(self.boxes, key=lambda each: each.level)
        names = [each.name for each in order]
        left = names[names.index(box.name) + 1 :]
        found = {d.box: None for d in self.drives if d.relaxed or not relaxed}
        return ", ".join(name for name in left if name in found)

    def _is_folded(self, box: Box) -> bool:
        """Return whether a deformed box has turned inside out at any of its nodes."""
        uvw = self._embedded[box.name].uvw
        # In q, as angles of points would jump where they pass the end of their range.
        straight = replace(box, points=box.q + self.change[box.name], system=CARTESIAN)
        before = np.linalg.det(box.slopes(uvw))
        after = np.linalg.det(straight.slopes(uvw))
        return bool((after * np.sign(before) < 0.0).any())

    def _unfold(self, box: Box) -> None:
        """Take back a part of a box's deformation until it no longer intersects itself.

        SU2's bisection, after Gain and Dodgson 2001: passes with a part of the values each.
        """
        if not self._is_folded(box):
            return
        step = -0.5
        total = 0.5
        depth = 0
        for number in range(1, self.limits.iterations + 1):
            self._apply(box, step)
            self._place(box)
            folded = self._is_folded(box)
            depth += not folded
            if not folded and depth == self.limits.depth:
                break
            if number < self.limits.iterations:
                step = abs(step) / (-2.0 if folded else 2.0)
                total += step
        self._factor *= step
        text = f"FFD_INTPREV: the FFD box {box.name!r} is deformed by {100.0 * total:g} % only"
        text += ", and still intersects itself" if folded else ", since it intersected itself"
        if after := self._after(box):
            text += f"; as in SU2, the variables of {after} get {self._factor:g} times their values"
        self.notes.append(text)
