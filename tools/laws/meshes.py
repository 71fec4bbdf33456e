"""Random meshes: what can be built from a grid, of many shapes, spacings, sizes and places."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from slideviz.case.samples import sample
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.periodic import axis_basis
from tests import builders

Rng = np.random.Generator

SAMPLES = {"square": (4, 16), "polar": (4, 16), "hexahedron": (3, 7), "cylindrical": (3, 7)}
"""Samples by name, and the sizes that are small enough; the blade passage is one of its own."""


@dataclass(frozen=True)
class Period:
    """How some markers repeat: by a shift, or by a rotation about an axis.

    Attributes
    ----------
    sides : tuple of (str, str)
        Markers, and those that are their images.
    vector : (d,) float64
        Zero for a rotation.
    angle_deg : float
        Zero for a shift.
    """

    sides: tuple[tuple[str, str], ...]
    vector: FloatArray
    angle_deg: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Made:
    """A mesh, and what its maker knows of it.

    Attributes
    ----------
    mesh : Mesh
    bodies : tuple of tuple of str
        Markers that make sense to move, those of one body together.
    periods : tuple of Period
        The ways in which the mesh repeats; a case can have one of them.
    """

    mesh: Mesh
    bodies: tuple[tuple[str, ...], ...]
    periods: tuple[Period, ...] = ()


def random_mesh(rng: Rng) -> Made:
    """Return a random mesh of up to some 2,000 nodes."""
    makers: tuple[tuple[Callable[[Rng], Made], float], ...] = (
        (_box, 0.4),
        (_ring, 0.27),
        (_around, 0.15),
        (_special, 0.08),
        (_sample, 0.1),
    )
    chances = [chance for _, chance in makers]
    made = makers[rng.choice(len(makers), p=chances)][0](rng)
    return _placed(rng, _jittered(rng, made))


def _size(rng: Rng, dim: int) -> tuple[int, ...]:
    """Return numbers of cells along the axes: mostly small ones."""
    high = (14 if rng.random() < 0.9 else 36) if dim == 2 else (6 if rng.random() < 0.9 else 10)
    return tuple(int(n) for n in rng.integers(3, high + 1, dim))


def _kind(rng: Rng, dim: int) -> str:
    kinds = ("plain", "simplex", "mixed") if dim == 2 else ("plain", "simplex", "prism", "mixed")
    return str(rng.choice(kinds))


def _hole(rng: Rng, shape: tuple[int, ...], through: int | None) -> list[tuple[int, int]]:
    """Return the cells of a block inside, or from end to end along the axis ``through``."""
    hole = []
    for axis, size in enumerate(shape):
        low = int(rng.integers(1, size - 1))
        hole.append((0, size) if axis == through else (low, int(rng.integers(low + 1, size))))
    return hole


def _spacing(rng: Rng, size: int) -> FloatArray:
    """Return places from 0 to 1: even, uneven, or in layers at one end or both."""
    style = rng.choice(["even", "uneven", "layers"], p=[0.5, 0.25, 0.25])
    if style == "even":
        steps = np.ones(size)
    elif style == "uneven":
        steps = rng.uniform(0.4, 1.6, size)
    else:
        first = 10.0 ** rng.uniform(-5, -1.5)
        depth = np.arange(size)
        if rng.random() < 0.4:
            depth = np.minimum(depth, depth[::-1])
        steps = first ** (1.0 - depth / max(1, depth.max()))
    return np.r_[0.0, np.cumsum(steps)] / steps.sum()


def _spread(rng: Rng, shape: tuple[int, ...]) -> Callable[[FloatArray], FloatArray]:
    """Return a map of indices (n, d) to places in the unit box."""
    lines = [_spacing(rng, size) for size in shape]

    def place(p: FloatArray) -> FloatArray:
        at = [np.interp(c, np.arange(len(x)), x) for c, x in zip(p.T, lines, strict=True)]
        return np.stack(at, axis=1)

    return place


def _rules(
    rng: Rng, shape: tuple[int, ...], names: tuple[str, ...], body: str
) -> tuple[list[builders.Rule], dict[str, tuple[str, ...]]]:
    """Return rules that name sides, some in two halves, and the parts of each name.

    Opposite sides are cut in the same place, so that they still repeat.
    """
    rules: list[builders.Rule] = []
    parts: dict[str, tuple[str, ...]] = {}
    for axis, size in enumerate(shape):
        cut = rng.random() < 0.15
        across = int(rng.choice([a for a in range(len(shape)) if a != axis]))
        middle = shape[across] // 2
        for end, name in zip((0, size), names[2 * axis : 2 * axis + 2], strict=True):

            def whole(p: FloatArray, a: int = axis, e: int = end) -> bool:
                return bool(np.all(p[:, a] == e))

            def low(
                p: FloatArray, a: int = axis, e: int = end, b: int = across, m: int = middle
            ) -> bool:
                return bool(np.all(p[:, a] == e) and np.all(p[:, b] <= m))

            parts[name] = (name, f"{name}_2") if cut else (name,)
            rules += [(name, low), (f"{name}_2", whole)] if cut else [(name, whole)]
    cut, axis = rng.random() < 0.15, int(rng.integers(len(shape)))
    middle = shape[axis] // 2
    if cut:
        rules.append((body, lambda p: bool(np.all(p[:, axis] <= middle))))
    rules.append((f"{body}_2" if cut else body, lambda p: True))
    parts[body] = (body, f"{body}_2") if cut else (body,)
    return rules, parts


def _there(mesh: Mesh, parts: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name for name in parts if name in mesh.marker_names)


def _sides(mesh: Mesh, low: tuple[str, ...], high: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return the parts of two opposite sides that face each other."""
    return tuple(
        (a, b)
        for a, b in zip(low, high, strict=True)
        if a in mesh.marker_names and b in mesh.marker_names
    )


def _box(rng: Rng) -> Made:
    """Return a box, with a block in it or without, its walls flat or with bumps."""
    dim = int(rng.choice([2, 3], p=[0.6, 0.4]))
    shape = _size(rng, dim)
    with_hole = rng.random() < 0.75
    hole = _hole(rng, shape, None) if with_hole else None
    names = tuple(f"{a}_{s}" for a in "xyz"[:dim] for s in "mp")
    rules, parts = _rules(rng, shape, names, "BLOCK")
    spread, height = _spread(rng, shape), rng.choice([0.0, 0.12]) * rng.uniform(0.2, 1.0)
    aspect = np.r_[1.0, rng.uniform(0.5, 2.0, dim - 1)]
    sheared, both = np.eye(dim), rng.random() < 0.5
    if rng.random() < 0.3:
        sheared[0, 1] = rng.uniform(-0.6, 0.6)

    def place(p: FloatArray) -> FloatArray:
        x = spread(p)
        bump = height * np.sin(2 * np.pi * x[:, 0])
        if dim == 3:
            bump = bump * (1.0 + 0.5 * np.cos(2 * np.pi * x[:, 2]))
        x[:, 1] += bump * (np.abs(1 - 2 * x[:, 1]) if both else 1 - x[:, 1])
        return x * aspect @ sheared.T

    mesh = builders.grid(shape, hole, _kind(rng, dim), place, rules)
    periods = [
        Period(
            _sides(mesh, parts[names[2 * a]], parts[names[2 * a + 1]]),
            sheared[:, a] * aspect[a],
        )
        for a in range(dim)
        # Bumps stay images of each other in x and z; in y only where both walls have them.
        if a != 1 or height == 0 or both
    ]
    walls = [_there(mesh, parts["y_m"])]
    body = _there(mesh, parts["BLOCK"])
    return Made(mesh, (body, *walls) if body else tuple(walls), tuple(periods))


def _ring(rng: Rng) -> Made:
    """Return an annular passage: a block or a blade between inner and outer boundary."""
    dim = int(rng.choice([2, 3], p=[0.45, 0.55]))
    shape = _size(rng, dim)
    through = 0 if dim == 3 and rng.random() < 0.7 else None
    hole = _hole(rng, shape, through) if rng.random() < 0.85 else None
    names = ("hub", "shroud", "per1", "per2", "inflow", "outflow")[: 2 * dim]
    rules, parts = _rules(rng, shape, names, "blade")
    spread, low = _spread(rng, shape), rng.uniform(0.2, 0.8)
    angle, start = rng.uniform(8, 100), rng.choice([0.0, rng.uniform(-180, 180)])
    length, wave = rng.uniform(0.3, 1.5), rng.choice([0.0, 0.1]) * rng.uniform(0.2, 1.0)

    def place(p: FloatArray) -> FloatArray:
        x = spread(p)
        phase = np.pi * x[:, 2] if dim == 3 else 2 * np.pi * x[:, 1]
        inner = low * (1 + wave * np.sin(phase))
        r = inner + (1 - inner) * x[:, 0]
        t = np.radians(start + angle * x[:, 1])
        columns = [r * np.cos(t), r * np.sin(t)]
        return np.stack([*columns, length * x[:, 2]] if dim == 3 else columns, axis=1)

    mesh = builders.grid(shape, hole, _kind(rng, dim), place, rules)
    sides = _sides(mesh, parts["per1"], parts["per2"])
    periods = [Period(sides, np.zeros(dim), angle)]
    body = _there(mesh, parts["blade"])
    walls = (_there(mesh, parts["hub"]), _there(mesh, parts["shroud"]))
    return Made(mesh, (body, *walls[:1]) if body else walls, tuple(periods))


def _around(rng: Rng) -> Made:
    """Return an O-grid around a circle, an ellipse or a profile, also extruded."""
    dim = int(rng.choice([2, 3], p=[0.7, 0.3]))
    layers, n = int(rng.integers(3, 9)), int(rng.integers(8, 30 if dim == 2 else 14))
    shape = (layers, n) if dim == 2 else (layers, n, int(rng.integers(2, 6)))
    style, thick = rng.choice(["circle", "ellipse", "profile"]), rng.uniform(0.1, 0.9)
    lines = [_spacing(rng, size) for size in shape]

    def section(t: FloatArray) -> FloatArray:
        c, s = np.cos(t), np.sin(t)
        if style == "profile":
            s = s * np.sqrt((1 - np.clip(c, -1, 1)) / 2 + 1e-12)
        return 0.5 * np.stack([c, s if style == "circle" else thick * s], axis=1)

    def place(p: FloatArray) -> FloatArray:
        t = 2 * np.pi * p[:, 1] / n
        s = np.interp(p[:, 0], np.arange(layers + 1), lines[0])[:, None]
        far = 2.5 * np.stack([np.cos(t), np.sin(t)], axis=1)
        x = (1 - s) * section(t) + s * far
        return x if dim == 2 else np.c_[x, np.interp(p[:, 2], np.arange(len(lines[2])), lines[2])]

    rules: list[builders.Rule] = [
        ("wall", lambda p: bool(np.all(p[:, 0] == 0))),
        ("far", lambda p: bool(np.all(p[:, 0] == layers))),
    ]
    if dim == 3:
        rules += [
            ("z_m", lambda p: bool(np.all(p[:, 2] == 0))),
            ("z_p", lambda p: bool(np.all(p[:, 2] == shape[2]))),
        ]
    mesh = builders.grid(shape, None, _kind(rng, dim), place, rules, wrap=1)
    periods = (Period((("z_m", "z_p"),), np.eye(3)[2]),) if dim == 3 else ()
    return Made(mesh, (("wall",),), periods)


def _special(rng: Rng) -> Made:
    """Return one of the meshes that are no plain grid."""
    which = rng.choice(["wedge", "plate", "sphere", "channel"])
    if which == "wedge":
        angle = rng.uniform(20, 100)
        mesh = builders.wedge(int(rng.integers(4, 10)), angle)
        return Made(mesh, (("BLOCK",),), (Period((("per1", "per2"),), np.zeros(2), angle),))
    if which == "plate":
        mesh = builders.plate(int(rng.choice([4, 8, 12])))
        sides = [Period(((f"{a}_m", f"{a}_p"),), np.eye(2)[i]) for i, a in enumerate("xy")]
        return Made(mesh, (("below", "above"),), tuple(sides))
    if which == "sphere":
        mesh = builders.sphere_in_box(int(rng.integers(2, 6)), int(rng.integers(2, 5)))
        sides = [Period(((f"{a}_m", f"{a}_p"),), 2 * np.eye(3)[i]) for i, a in enumerate("xyz")]
        return Made(mesh, (("sphere",),), tuple(sides))
    mesh = builders.channel(2 * int(rng.integers(2, 8)))
    return Made(mesh, (("bump",), ("y_p",)), (Period((("x_m", "x_p"),), np.array([2.0, 0.0])),))


def _sample(rng: Rng) -> Made:
    """Return the mesh of a sample case, small."""
    name = str(rng.choice([*SAMPLES, "passage"]))
    size = int(rng.integers(*SAMPLES[name])) if name in SAMPLES else int(rng.integers(12, 20))
    made = sample(name, size)
    body, (first, second) = made.case.markers_with("moving"), made.case.markers_with("periodic")
    points = made.mesh.points
    if made.case.periodic_type == "rotational":
        period = Period(((first, second),), np.zeros(made.mesh.dim), 30.0)
    else:
        low, high = (points[made.mesh.marker(m).nodes].mean(axis=0) for m in (first, second))
        period = Period(((first, second),), high - low)
    return Made(made.mesh, (body,), (period,))


def _jittered(rng: Rng, made: Made) -> Made:
    """Return the mesh with its inner nodes pushed about, or as it is."""
    if rng.random() < 0.5:
        return made
    mesh = made.mesh
    near = nearest_neighbour(mesh)
    inner = np.ones(len(mesh.points), bool)
    for marker in mesh.markers:
        inner[marker.nodes] = False
    push = rng.uniform(-0.15, 0.15, mesh.points.shape) * near[:, None]
    return replace(made, mesh=mesh.with_points(mesh.points + np.where(inner[:, None], push, 0.0)))


def nearest_neighbour(mesh: Mesh) -> FloatArray:
    """Return the length of the shortest edge at each node, (n,)."""
    near = np.full(len(mesh.points), np.inf)
    for vtk, (_, nodes) in mesh.cells.by_type.items():
        for a, b in ELEMENTS[vtk].edges:
            length = np.linalg.norm(mesh.points[nodes[:, a]] - mesh.points[nodes[:, b]], axis=1)
            for column in (a, b):
                np.minimum.at(near, nodes[:, column], length)
    return near


def _placed(rng: Rng, made: Made) -> Made:
    """Return the mesh turned, scaled and shifted, together with its periods."""
    mesh, dim = made.mesh, made.mesh.dim
    scale = 10.0 ** rng.uniform(-3, 3) if rng.random() < 0.6 else 1.0
    offset = np.zeros(dim)
    if rng.random() < 0.5:
        offset = rng.normal(size=dim) * scale * 10.0 ** rng.uniform(-1, 1.5)
    turn, axis = np.eye(dim), np.array([0.0, 0.0, 1.0])
    if rng.random() < 0.5:
        if dim == 3:
            axis = rng.normal(size=3)
            turn = axis_basis(axis).T
        else:
            a = rng.uniform(-np.pi, np.pi)
            turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    origin = np.zeros(3)
    origin[:dim] = offset
    periods = tuple(
        replace(
            period,
            vector=scale * turn @ period.vector,
            axis=tuple(axis.tolist()) if period.angle_deg else period.axis,
            origin=tuple(origin.tolist()) if period.angle_deg else period.origin,
        )
        for period in made.periods
    )
    points = scale * mesh.points @ turn.T + offset
    return replace(made, mesh=mesh.with_points(points), periods=periods)


def images(made: Made, period: Period) -> IntArray:
    """Return nodes and their images by the maker's own knowledge, (k, 2)."""
    from tools.laws.oracle import carried

    found = []
    for first, second in period.sides:
        a, b = (made.mesh.marker(name).nodes for name in (first, second))
        there = carried(period, made.mesh.points[a])
        gap = np.linalg.norm(there[:, None] - made.mesh.points[b][None], axis=2)
        assert gap.min(axis=1).max(initial=0.0) < 1e-7 * made.mesh.extent, (first, second)
        found.append(np.stack([a, b[gap.argmin(axis=1)]], axis=1))
    return np.concatenate(found)
