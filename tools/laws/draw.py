"""Random parts of grids: sizes, kinds of cells, spacings and names of sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from slideviz.mesh.model import FloatArray, Mesh
from tests import builders


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


Rng = np.random.Generator


def size(rng: Rng, dim: int) -> tuple[int, ...]:
    """Return numbers of cells along the axes: mostly small ones."""
    high = (14 if rng.random() < 0.9 else 36) if dim == 2 else (6 if rng.random() < 0.9 else 10)
    return tuple(int(n) for n in rng.integers(3, high + 1, dim))


def kind(rng: Rng, dim: int) -> str:
    """Return a kind of cells of ``builders.grid``."""
    kinds = ("plain", "simplex", "mixed") if dim == 2 else ("plain", "simplex", "prism", "mixed")
    return str(rng.choice(kinds))


def hole(rng: Rng, shape: tuple[int, ...], through: int | None) -> list[tuple[int, int]]:
    """Return the cells of a block inside, or from end to end along the axis ``through``."""
    cells = []
    for axis, size in enumerate(shape):
        low = int(rng.integers(1, size - 1))
        cells.append((0, size) if axis == through else (low, int(rng.integers(low + 1, size))))
    return cells


def spacing(rng: Rng, size: int) -> FloatArray:
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


def spread(rng: Rng, shape: tuple[int, ...]) -> Callable[[FloatArray], FloatArray]:
    """Return a map of indices (n, d) to places in the unit box."""
    lines = [spacing(rng, size) for size in shape]

    def place(p: FloatArray) -> FloatArray:
        at = [np.interp(c, np.arange(len(x)), x) for c, x in zip(p.T, lines, strict=True)]
        return np.stack(at, axis=1)

    return place


def rules(
    rng: Rng, shape: tuple[int, ...], names: tuple[str, ...], body: str
) -> tuple[list[builders.Rule], dict[str, tuple[str, ...]]]:
    """Return rules that name sides, some in two halves, and the parts of each name.

    Opposite sides are cut in the same place, so that they still repeat.
    """
    found: list[builders.Rule] = []
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
            found += [(name, low), (f"{name}_2", whole)] if cut else [(name, whole)]
    cut, axis = rng.random() < 0.15, int(rng.integers(len(shape)))
    middle = shape[axis] // 2
    if cut:
        found.append((body, lambda p: bool(np.all(p[:, axis] <= middle))))
    found.append((f"{body}_2" if cut else body, lambda _: True))
    parts[body] = (body, f"{body}_2") if cut else (body,)
    return found, parts


def there(mesh: Mesh, parts: tuple[str, ...]) -> tuple[str, ...]:
    """Return the parts of a side or body that the mesh has."""
    return tuple(name for name in parts if name in mesh.marker_names)


def sides(mesh: Mesh, low: tuple[str, ...], high: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """Return the parts of two opposite sides that face each other."""
    return tuple(
        (a, b)
        for a, b in zip(low, high, strict=True)
        if a in mesh.marker_names and b in mesh.marker_names
    )
