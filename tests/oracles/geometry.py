"""Normals, closest points and node classes by the plainest means."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from slideviz.mesh.model import Mesh


def outward_normal(mesh: Mesh, nodes) -> np.ndarray:
    """Unit normal of a side, away from the middle of the cell that has all its nodes."""
    x = mesh.points[list(nodes)]
    if mesh.dim == 2:
        t = x[1] - x[0]
        normal = np.array([t[1], -t[0]])
    else:
        normal = np.cross(x[1] - x[0], x[2] - x[0])
        if len(x) == 4:
            normal = normal + np.cross(x[2] - x[0], x[3] - x[0])
    for start, stop in zip(mesh.cells.offsets[:-1], mesh.cells.offsets[1:], strict=True):
        cell = mesh.cells.connectivity[start:stop]
        if set(nodes) <= set(cell.tolist()):
            if normal @ (x.mean(axis=0) - mesh.points[cell].mean(axis=0)) < 0:
                normal = -normal
            return normal / np.linalg.norm(normal)
    raise AssertionError("no cell has this side")


def node_normal(mesh: Mesh, node: int, marker: str) -> np.ndarray:
    """Section 2.4.4: mean of the facets' unit normals, weighted with the inverse distance."""
    total = np.zeros(mesh.dim)
    cells = mesh.marker(marker).cells
    for start, stop in zip(cells.offsets[:-1], cells.offsets[1:], strict=True):
        side = cells.connectivity[start:stop].tolist()
        if node in side:
            middle = mesh.points[side].mean(axis=0)
            gap = np.linalg.norm(mesh.points[node] - middle)
            total += outward_normal(mesh, side) / gap
    return total / np.linalg.norm(total)


def closest_on_triangle(x: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Point of the triangle nearest to x, by a search grid that shrinks around the best point."""
    a, b, c = corners
    at, width = np.array([1 / 3, 1 / 3]), 1.0
    best, gap = a, np.inf
    for _ in range(60):
        steps = np.linspace(-width, width, 9)
        for ds in steps:
            for dt in steps:
                s, t = max(0.0, at[0] + ds), max(0.0, at[1] + dt)
                if s + t > 1:
                    s, t = s / (s + t), t / (s + t)
                p = a + s * (b - a) + t * (c - a)
                if np.linalg.norm(p - x) < gap:
                    gap, best, new = np.linalg.norm(p - x), p, np.array([s, t])
        at = new
        width *= 0.6
    return best


def closest_on_segment(x: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Point of the segment nearest to x, by golden-section search."""
    a, b = ends
    low, high = 0.0, 1.0
    ratio = (np.sqrt(5) - 1) / 2
    for _ in range(100):
        s, t = high - ratio * (high - low), low + ratio * (high - low)
        if np.linalg.norm(a + s * (b - a) - x) < np.linalg.norm(a + t * (b - a) - x):
            high = t
        else:
            low = s
    return a + (low + high) / 2 * (b - a)


def box_classes(
    places: np.ndarray, size: float, block: set[int], sliding: str, periodic: str, axis: int
) -> Mapping[str, set[int]]:
    """Classes of the nodes of a box with a moving block, by counting the sides they lie on.

    All outer sides slide; those across ``axis`` are periodic.
    """
    found: dict[str, set[int]] = {k: set() for k in ("fixed", "edge", "surface", "internal")}
    dim = places.shape[1]
    for node, p in enumerate(places):
        if node in block:
            continue
        sides = [a for a in range(dim) if p[a] in (0.0, size)]
        free = periodic in ("fixed", "moving")
        solid = [a for a in sides if a != axis] if free else sides
        if not solid:
            found["internal"].add(node)
        elif sliding == "none" or len(solid) == dim or (periodic == "fixed" and len(sides) == dim):
            found["fixed"].add(node)
        elif len(solid) == dim - 1:
            found["edge"].add(node)
        else:
            found["surface"].add(node)
    return found
