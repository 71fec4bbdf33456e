"""The makers of random meshes: boxes, annular passages, O-grids, small bodies, samples, others."""

from __future__ import annotations

import numpy as np

from slideviz.mesh.model import FloatArray
from slideviz.samples import table
from slideviz.samples.airfoil import airfoil_mesh
from tests import builders
from tools.laws import draw
from tools.laws.draw import Made, Period, Rng

SAMPLES = {"square": (4, 16), "polar": (4, 16), "hexahedron": (3, 7), "cylindrical": (3, 7)}
"""Samples by name, and the sizes that are small enough; the blade passage is one of its own."""


def box(rng: Rng) -> Made:
    """Return a box, with a block in it or without, its walls flat or with bumps."""
    dim = int(rng.choice([2, 3], p=[0.6, 0.4]))
    shape = draw.size(rng, dim)
    with_hole = rng.random() < 0.75
    hole = draw.hole(rng, shape, None) if with_hole else None
    names = tuple(f"{a}_{s}" for a in "xyz"[:dim] for s in "mp")
    rules, parts = draw.rules(rng, shape, names, "BLOCK")
    spread, height = draw.spread(rng, shape), rng.choice([0.0, 0.12]) * rng.uniform(0.2, 1.0)
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

    mesh = builders.grid(shape, hole, draw.kind(rng, dim), place, rules)
    periods = [
        Period(
            draw.sides(mesh, parts[names[2 * a]], parts[names[2 * a + 1]]),
            sheared[:, a] * aspect[a],
        )
        for a in range(dim)
        # Bumps stay images of each other in x and z; in y only where both walls have them.
        if a != 1 or height == 0 or both
    ]
    walls = [draw.there(mesh, parts["y_m"])]
    body = draw.there(mesh, parts["BLOCK"])
    return Made(mesh, (body, *walls) if body else tuple(walls), tuple(periods))


def ring(rng: Rng) -> Made:
    """Return an annular passage: a block or a blade between inner and outer boundary."""
    dim = int(rng.choice([2, 3], p=[0.45, 0.55]))
    shape = draw.size(rng, dim)
    through = 0 if dim == 3 and rng.random() < 0.7 else None
    hole = draw.hole(rng, shape, through) if rng.random() < 0.85 else None
    names = ("hub", "shroud", "per1", "per2", "inflow", "outflow")[: 2 * dim]
    rules, parts = draw.rules(rng, shape, names, "blade")
    spread, low = draw.spread(rng, shape), rng.uniform(0.2, 0.8)
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

    mesh = builders.grid(shape, hole, draw.kind(rng, dim), place, rules)
    sides = draw.sides(mesh, parts["per1"], parts["per2"])
    periods = [Period(sides, np.zeros(dim), angle)]
    body = draw.there(mesh, parts["blade"])
    walls = (draw.there(mesh, parts["hub"]), draw.there(mesh, parts["shroud"]))
    return Made(mesh, (body, *walls[:1]) if body else walls, tuple(periods))


def around(rng: Rng) -> Made:
    """Return an O-grid around a circle, an ellipse or a profile, also extruded."""
    dim = int(rng.choice([2, 3], p=[0.7, 0.3]))
    layers, n = int(rng.integers(3, 9)), int(rng.integers(8, 30 if dim == 2 else 14))
    shape = (layers, n) if dim == 2 else (layers, n, int(rng.integers(2, 6)))
    style, thick = rng.choice(["circle", "ellipse", "profile"]), rng.uniform(0.1, 0.9)
    lines = [draw.spacing(rng, size) for size in shape]

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
    mesh = builders.grid(shape, None, draw.kind(rng, dim), place, rules, wrap=1)
    periods = (Period((("z_m", "z_p"),), np.eye(3)[2]),) if dim == 3 else ()
    return Made(mesh, (("wall",),), periods)


def special(rng: Rng) -> Made:
    """Return one of the meshes that are not plain grids."""
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


def small(rng: Rng) -> Made:
    """Return one or two small bodies in a far field of 20 to 1,000 times their size."""
    size = float(10.0 ** rng.uniform(1.3, 3))
    if rng.random() < 0.3:
        mesh = airfoil_mesh(int(rng.integers(16, 30)), str(rng.choice(["motion", "layers"])))
        return Made(mesh, (("airfoil",),))
    bodies = int(rng.integers(1, 3))
    mesh = builders.far_field(size, bodies, int(rng.integers(2, 7)))
    return Made(mesh, (("body",), ("other",))[:bodies])


def sample(rng: Rng) -> Made:
    """Return the mesh of a sample case, small."""
    name = str(rng.choice([*SAMPLES, "passage"]))
    size = int(rng.integers(*SAMPLES[name])) if name in SAMPLES else int(rng.integers(12, 20))
    made = table.sample(name, size)
    body, (first, second) = made.case.markers_with("moving"), made.case.markers_with("periodic")
    points = made.mesh.points
    if made.case.periodic_type == "rotational":
        period = Period(((first, second),), np.zeros(made.mesh.dim), 30.0)
    else:
        low, high = (points[made.mesh.marker(m).nodes].mean(axis=0) for m in (first, second))
        period = Period(((first, second),), high - low)
    return Made(made.mesh, (body,), (period,))
