"""The layers at walls, facet by facet, from their definitions alone."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from slideviz.mesh.elements import ELEMENTS


class Column(NamedTuple):
    """The nodes of a column (none of a bare facet), and its numbers."""

    nodes: tuple
    height: float
    growth: float
    equal: float
    angle: float


def columns(mesh, marker, skip=(), most=5):
    """The columns of a boundary, sorted; cells ``skip`` are a halo's."""
    of_side = defaultdict(list)
    cells = [
        mesh.cells.connectivity[a:b].tolist() for a, b in pairwise(mesh.cells.offsets.tolist())
    ]
    for c, (vtk, nodes) in enumerate(zip(mesh.cells.types.tolist(), cells, strict=True)):
        for local in ELEMENTS[vtk].facets if c not in skip else ():
            of_side[frozenset(nodes[k] for k in local)].append(c)
    stacks = defaultdict(list)
    bare = []
    for name in mesh.marker_names:
        boundary = mesh.marker(name).cells
        for a, b in pairwise(boundary.offsets.tolist()):
            side = boundary.connectivity[a:b].tolist()
            owners = of_side[frozenset(side)]
            if not owners:
                continue
            (cell,) = owners
            normal = inward(mesh, side, cells[cell])
            lines = climb(mesh, side, cell, cells, of_side, most)
            for line in lines:
                stacks[tuple(line[:2])].append((name, line, normal))
            if not lines and name == marker:
                off = mesh.points[[k for k in cells[cell] if k not in side]].mean(0)
                away = (off - mesh.points[side].mean(0)) @ normal / np.linalg.norm(normal)
                bare.append(Column((), away, np.nan, np.nan, np.nan))
    made = []
    for members in stacks.values():
        if any(name == marker for name, _, _ in members):
            longest = max((line for _, line, _ in members), key=len)
            made.append(numbers(mesh, longest, sum(normal for _, _, normal in members)))
    return sorted([*made, *bare], key=lambda column: (column.nodes, column.height))


def inward(mesh, side, cell):
    """The unit normal of a side into its cell."""
    x = mesh.points[side]
    if mesh.dim == 2:
        normal = np.array([x[1, 1] - x[0, 1], x[0, 0] - x[1, 0]])
    else:
        normal = sum(np.cross(x[k] - x[0], x[k + 1] - x[0]) for k in range(1, len(x) - 1)) / 2
    towards = mesh.points[cell].mean(0) - x.mean(0)
    normal = normal / np.linalg.norm(normal)
    return normal if normal @ towards > 0 else -normal


def climb(mesh, side, cell, cells, of_side, most):
    """The chains of nodes above the corners of a side."""
    lines = [[node] for node in side]
    for _ in range(most):
        nodes, here = cells[cell], [line[-1] for line in lines]
        if len(nodes) != 2 * len(here):
            break
        for line in lines:
            edges = [{nodes[k] for k in e} for e in ELEMENTS[int(mesh.cells.types[cell])].edges]
            line += next(e for e in edges if e & set(here) == {line[-1]}) - {line[-1]}
        beyond = [c for c in of_side[frozenset(line[-1] for line in lines)] if c != cell]
        if not beyond:
            break
        (cell,) = beyond
    return lines if len(lines[0]) > 1 else []


def numbers(mesh, line, normal):
    x = mesh.points[line]
    lengths = [float(np.linalg.norm(b - a)) for a, b in pairwise(x)]
    height = (x[1] - x[0]) @ normal / np.linalg.norm(normal)
    steps = [max(a / b, b / a) for a, b in pairwise(lengths)]
    equal = 0
    for length in lengths:
        if abs(length / lengths[0] - 1) >= 0.01:
            break
        equal += 1
    angle = 90 - np.degrees(np.arccos(np.clip(height / lengths[0], -1, 1)))
    return Column(tuple(line), height, max(steps, default=np.nan), float(equal), angle)
