"""Meshes of the contest that the samples do not have: a C-mesh, and bodies in outer flows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

import slideviz as sv
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker
from slideviz.samples.turbine_row import Sizing, front_points, relax

FAR = 15.0
"""Radius of the far field, in sizes of the body."""
FINE, COARSEN = 0.04, 0.15
"""Length of triangles' edges at the body, in its sizes, and its growth with the distance."""
FIRST, GROWTH = 2e-4, 1.25
"""Height of the C-mesh's first cells, as a part of the whole height, and ratio of neighbours."""
LINE, TRIANGLE, QUADRILATERAL = 3, 5, 9


def c_mesh(around: int = 120, wake: int = 24) -> sv.Mesh:
    """Return a C-mesh with layers around a NACA 0012 with a closed trailing edge; its chord is 1.

    It is a sheared grid in the plane of w = sqrt(z - z0), where the airfoil and its wake are nearly
    a straight line. ``around`` and ``wake`` are the numbers of cells around the airfoil and along
    the wake.
    """
    t = np.linspace(-1.0, 1.0, around + 1)
    x = t**2
    half = 0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4
    z = x + 0.6j * np.sign(t) * half - 0.5 * 1.1019 * 0.12**2
    w = np.sqrt(np.abs(z)) * np.exp(0.5j * np.mod(np.angle(z), 2 * np.pi))
    w[0], w[-1] = -np.abs(w[0]), np.abs(w[-1])
    ratio = _ratio((np.sqrt(FAR) - w[-1].real) / (w[-1] - w[-2]).real, wake)
    behind = w[-1].real + (w[-1] - w[-2]).real * np.cumsum(ratio ** np.arange(1, wake + 1))
    base = np.r_[-behind[::-1], w, behind]
    steps = FIRST * GROWTH ** np.arange(60)
    steps = steps[np.cumsum(steps) < 1.0]
    way = np.r_[0.0, np.cumsum(steps)] / steps.sum()
    height = (np.sqrt(FAR) - base.imag)[:, None] * way
    z = (base[:, None] + 1j * height) ** 2 + 0.5 * 1.1019 * 0.12**2
    number = np.arange(z.size).reshape(z.shape)
    number[-wake - 1 :, 0] = number[wake::-1, 0]  # both sides of the wake are one
    quads = _quads(number)
    body, far = number[wake:-wake, 0], np.r_[number[0], number[1:-1, -1], number[-1, ::-1]]
    return _mesh(z, [(QUADRILATERAL, quads)], {"airfoil": body[::-1], "farfield": far[::-1]})


def o_mesh(around: int = 60) -> sv.Mesh:
    """Return an O-mesh of nearly square cells around a circle of diameter 1."""
    rings = round(np.log(2 * FAR) / (2 * np.pi / around))
    radius = 0.5 * np.exp(np.linspace(0, np.log(2 * FAR), rings + 1))
    z = radius * np.exp(2j * np.pi * np.arange(around + 1) / around)[:, None]
    number = np.arange(z.size).reshape(z.shape)
    number[-1] = number[0]
    quads = _quads(number[:, ::-1])
    return _mesh(z, [(QUADRILATERAL, quads)], {"body": number[:, 0], "farfield": number[:, -1]})


def triangle_mesh(shape: str) -> sv.Mesh:
    """Return triangles around a body of size 1, one of `SHAPES`, in a far field."""
    body = _spread(SHAPES[shape](), FINE)
    length = FINE + COARSEN * (FAR - 0.5)
    far = FAR * np.exp(2j * np.pi * np.arange(n := round(2 * np.pi * FAR / length)) / n)
    outline = np.r_[body, far]
    fixed = np.column_stack([outline.real, outline.imag])
    ring = np.arange(len(body))
    inner, outer = _loop(ring)[:, ::-1], _loop(len(body) + np.arange(n))
    axis = np.linspace(-FAR - 0.1, FAR + 0.1, 400)
    grid = axis[:, None] + 1j * axis
    away = np.min([np.abs(grid - z) for z in body], axis=0)
    table = FINE + COARSEN * away
    sizing = Sizing(np.full(2, axis[0]), np.full(2, axis[1] - axis[0]), table)
    cell = (axis[1] - axis[0]) ** 2
    count = 4 / np.sqrt(3) * np.sum(cell / table[np.abs(grid) < FAR] ** 2)
    edges = np.concatenate([inner, outer])
    points = np.concatenate([fixed, front_points(fixed, edges, sizing, count)])
    points, triangles = relax(points, len(fixed), edges)
    sides = {"body": ring, "farfield": np.r_[len(body) + np.arange(n), len(body)]}
    sides["body"] = np.r_[ring, 0][::-1]
    return _mesh(points @ [1, 1j], [(TRIANGLE, triangles)], sides)


def _polygon(*corners: complex) -> FloatArray:
    """Return a closed polygon, counter-clockwise, its first corner again at the end."""
    return np.array([*corners, corners[0]])


def _ellipse(ratio: float) -> FloatArray:
    angle = np.linspace(0, 2 * np.pi, 2001)
    return 0.5 * (np.cos(angle) + 1j * ratio * np.sin(angle))


SHAPES: dict[str, Callable[[], FloatArray]] = {
    "circle": lambda: _ellipse(1.0),
    "ellipse": lambda: _ellipse(0.25),
    "block": lambda: _polygon(-0.5 - 0.1j, 0.5 - 0.1j, 0.5 + 0.1j, -0.5 + 0.1j),
    "wedge": lambda: _polygon(-0.5, 0.5 - 0.2j, 0.5 + 0.2j),
    "corner": lambda: _polygon(
        *(-0.5 - 0.5j, 0.5 - 0.5j, 0.5 - 0.25j, -0.25 - 0.25j, -0.25 + 0.5j, -0.5 + 0.5j)
    ),
    "cross": lambda: _polygon(
        *(a * 1j**k for k in range(4) for a in (0.15 - 0.15j, 0.5 - 0.15j, 0.5 + 0.15j))
    ),
}
"""Outlines (m,) of bodies as complex numbers, counter-clockwise and closed."""


def _spread(outline: FloatArray, length: float) -> FloatArray:
    """Return points (k,) on a closed outline about ``length`` apart, and at each of its corners."""
    turn = np.abs(np.angle(np.diff(outline) / np.diff(np.r_[outline[-2], outline[:-1]])))
    corners = np.flatnonzero(np.r_[turn, turn[0]] > 0.3)
    corners = np.array([0, len(outline) - 1]) if len(corners) == 0 else corners
    parts = []
    for first, last in pairwise(corners):
        piece = outline[first : last + 1]
        arc = np.r_[0.0, np.cumsum(np.abs(np.diff(piece)))]
        at = np.linspace(0.0, arc[-1], max(round(arc[-1] / length), 1) + 1)[:-1]
        parts.append(np.interp(at, arc, piece.real) + 1j * np.interp(at, arc, piece.imag))
    return np.concatenate(parts)


def _ratio(sum_of: float, count: int) -> float:
    """Return q with q + ... + q^count = sum_of."""
    low, high = 1.0, 10.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (
            (middle, high) if np.sum(middle ** np.arange(1, count + 1)) < sum_of else (low, middle)
        )
    return low


def _quads(number: IntArray) -> IntArray:
    """Return the quadrilaterals (m, 4) of a structured grid of node numbers (a, b)."""
    parts = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    return np.stack(parts, axis=-1).reshape(-1, 4)


def _loop(nodes: IntArray) -> IntArray:
    return np.column_stack([nodes, np.roll(nodes, -1)])


def _mesh(z: FloatArray, cells: list[tuple[int, IntArray]], sides: dict[str, IntArray]) -> sv.Mesh:
    """Return the mesh of the nodes in use, from complex points and rows of nodes of its sides."""
    used, flat = np.unique(cells[0][1], return_inverse=True)
    new = np.zeros(z.size, np.int64)
    new[used] = np.arange(len(used))
    points = np.column_stack([z.ravel()[used].real, z.ravel()[used].imag])
    markers = [
        Marker(name, Cells.from_blocks([(LINE, np.column_stack([new[row[:-1]], new[row[1:]]]))]))
        for name, row in sides.items()
    ]
    blocks = [(cells[0][0], flat.reshape(cells[0][1].shape))]
    return sv.Mesh(points, Cells.from_blocks(blocks), tuple(markers))
