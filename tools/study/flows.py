"""Meshes of the contest that are not samples: airfoils by formula, and bodies in outer flows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

import slideviz as sv
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker
from tools.study.vane_mesh import Sizing, front_points, relax

FAR = 15.0
"""Radius of the far field, in sizes of the body."""
FINE, COARSEN = 0.04, 0.15
"""Length of triangles' edges at the body, in its sizes, and its growth with the distance."""
FIRST, GROWTH = 2e-4, 1.25
"""Height of a C-mesh's first cells, as a part of the whole height, and ratio of neighbours."""
LINE, TRIANGLE, QUADRILATERAL = 3, 5, 9


Outline = Callable[[FloatArray], FloatArray]
"""An airfoil of chord 1 as complex points at t (m,) from -1 to 1: from its trailing edge, 1, along
the lower side to the leading edge, 0, and back along the upper one; about x = t^2."""


def naca_0012(t: FloatArray) -> FloatArray:
    """Return a NACA 0012 with a closed trailing edge, an `Outline`."""
    x = t**2
    half = 0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4
    return x + 0.6j * np.sign(t) * half


def joukowski(t: FloatArray) -> FloatArray:
    """Return a cambered airfoil of Joukowski's, whose trailing edge is a cusp, an `Outline`."""
    centre = -0.08 + 0.08j
    zeta = centre + (1.0 - centre) * (2.0 * t**2 - 1.0 + 2.0j * t * np.sqrt(1.0 - t**2))
    front = 2.0 * centre - 1.0 + 1.0 / (2.0 * centre - 1.0)
    return (zeta + 1.0 / zeta - front) / (2.0 - front)


def cusped(t: FloatArray) -> FloatArray:
    """Return an airfoil with 4 % of camber, 12 % thick, that ends in a cusp, an `Outline`."""
    x = t**2
    return x + 0.16j * x * (1.0 - x) + 0.185j * t * (1.0 - x) ** 1.5


FOCUS = 0.5 * 1.1019 * 0.12**2
"""Half the nose radius of a NACA 0012: the origin of the square roots of a C-mesh."""


def c_mesh(
    outline: Outline = naca_0012,
    around: int = 120,
    wake: int = 24,
    first: float = FIRST,
    far: float = FAR,
) -> sv.Mesh:
    """Return a C-mesh with layers around an airfoil.

    It is a sheared grid in the plane of w = sqrt(z - z0), where the airfoil and its wake are nearly
    a straight line. ``around`` and ``wake`` are the numbers of cells around the airfoil and along
    the wake; ``first`` is the height of the first cells, as a part of the whole height, and
    ``far`` the radius of the far field.
    """
    z = outline(np.linspace(-1.0, 1.0, around + 1)) - FOCUS
    z[0] = z[-1]
    w = np.sqrt(np.abs(z)) * np.exp(0.5j * (np.unwrap(np.angle(z))))
    w *= np.sign(w[-1].real)
    ratio = _ratio((np.sqrt(far) - w[-1].real) / (w[-1] - w[-2]).real, wake)
    behind = w[-1].real + (w[-1] - w[-2]).real * np.cumsum(ratio ** np.arange(1, wake + 1))
    base = np.r_[-behind[::-1], w, behind]
    steps = first * GROWTH ** np.arange(80)
    steps = steps[np.cumsum(steps) < 1.0]
    way = np.r_[0.0, np.cumsum(steps)] / steps.sum()
    height = (np.sqrt(far) - base.imag)[:, None] * way
    z = (base[:, None] + 1j * height) ** 2 + FOCUS
    number = np.arange(z.size).reshape(z.shape)
    number[-wake - 1 :, 0] = number[wake::-1, 0]  # both sides of the wake are one
    body, far = number[wake:-wake, 0], np.r_[number[0], number[1:-1, -1], number[-1, ::-1]]
    return grid_mesh(z, number, {"airfoil": body[::-1], "farfield": far[::-1]})


def layered_o_mesh(outline: Outline, around: int = 120, first: float = 1e-5) -> sv.Mesh:
    """Return an O-mesh with layers around an airfoil: lines along its normals, bent to a circle.

    At a sharp trailing edge one line continues the airfoil. ``first``: height of the first cells.
    """
    wall = outline(np.linspace(-1.0, 1.0, around + 1))[:-1]
    along = np.roll(wall, -1) - wall
    before = np.roll(along, 1)
    normal = 1j * before / np.abs(before) * np.exp(0.5j * np.angle(along / before))
    behind = wall[0] - 0.5 * (wall[1] + wall[-1])
    normal[0] = behind / np.abs(behind)  # of a cusp, whose two facets fold back on each other
    height = first * (1.2 ** np.arange(200) - 1.0) / 0.2
    height = height[height < FAR]
    part = (height / height[-1]) ** 1.2
    far = 1.0 + FAR * normal[0] * np.exp(-2j * np.pi * np.arange(around) / around)
    z = (1.0 - part)[:, None] * (wall + height[:, None] * normal) + part[:, None] * far
    z = np.c_[z, z[:, :1]].T
    number = np.arange(z.size).reshape(z.shape)
    number[-1] = number[0]
    sides = {"airfoil": number[::-1, 0], "farfield": number[:, -1]}
    return grid_mesh(z, number, sides)


def o_mesh(around: int = 60) -> sv.Mesh:
    """Return an O-mesh of nearly square cells around a circle of diameter 1."""
    rings = round(np.log(2 * FAR) / (2 * np.pi / around))
    radius = 0.5 * np.exp(np.linspace(0, np.log(2 * FAR), rings + 1))
    z = radius * np.exp(2j * np.pi * np.arange(around + 1) / around)[:, None]
    number = np.arange(z.size).reshape(z.shape)
    number[-1] = number[0]
    sides = {"body": number[:, 0], "farfield": number[:, -1]}
    return grid_mesh(z, number[:, ::-1], sides)


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
    return _mesh(points @ [1, 1j], TRIANGLE, triangles, sides)


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


def _loop(nodes: IntArray) -> IntArray:
    return np.column_stack([nodes, np.roll(nodes, -1)])


def grid_mesh(z: FloatArray, number: IntArray, sides: dict[str, IntArray]) -> sv.Mesh:
    """Return quadrilaterals of a structured grid of node numbers (a, b).

    ``z``: the points as complex numbers; ``sides``: rows of nodes of the boundaries.
    """
    parts = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    return _mesh(z, QUADRILATERAL, np.stack(parts, axis=-1).reshape(-1, 4), sides)


def _mesh(z: FloatArray, kind: int, cells: IntArray, sides: dict[str, IntArray]) -> sv.Mesh:
    """Return the mesh of the nodes in use, from complex points and rows of nodes of its sides."""
    used, flat = np.unique(cells, return_inverse=True)
    new = np.zeros(z.size, np.int64)
    new[used] = np.arange(len(used))
    points = np.column_stack([z.ravel()[used].real, z.ravel()[used].imag])
    markers = [
        Marker(name, Cells.from_blocks([(LINE, np.column_stack([new[row[:-1]], new[row[1:]]]))]))
        for name, row in sides.items()
    ]
    blocks = [(kind, flat.reshape(cells.shape))]
    return sv.Mesh(points, Cells.from_blocks(blocks), tuple(markers))
