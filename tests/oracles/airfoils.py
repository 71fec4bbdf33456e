"""SU2's design variables of airfoils, node by node, as its CSurfaceMovement has them."""

from __future__ import annotations

from math import atan, comb, cos, hypot, log10, pi, sin, sqrt

import numpy as np


def vertices(marker) -> list[int]:
    """Nodes of a marker in the order in which its elements name them first."""
    return list(dict.fromkeys(marker.cells.connectivity.tolist()))


def inward_normals(mesh, marker) -> dict[int, np.ndarray]:
    """At each node the sum of its parts of the facets' normals, into the cells."""
    found = {node: np.zeros(3) for node in vertices(marker)}
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.dim] = mesh.points
    for k in range(len(marker.cells)):
        nodes = marker.cells.connectivity[marker.cells.offsets[k] : marker.cells.offsets[k + 1]]
        centre = points[nodes].mean(axis=0)
        for place, node in enumerate(nodes):
            if mesh.dim == 2:
                along = points[nodes[1]] - points[nodes[0]]
                part = 0.5 * np.array([-along[1], along[0], 0.0])
            else:
                here = points[node]
                before = 0.5 * (here + points[nodes[place - 1]])
                after = 0.5 * (here + points[nodes[(place + 1) % len(nodes)]])
                part = 0.5 * np.cross(after - here, centre - here)
                part += 0.5 * np.cross(centre - here, before - here)
            cell = cell_of(mesh, nodes)
            inside = points[cell].mean(axis=0) - centre
            found[int(node)] += part if part @ inside > 0 else -part
    return found


def cell_of(mesh, nodes) -> np.ndarray:
    """The nodes of the cell with this facet."""
    for k in range(len(mesh.cells)):
        cell = mesh.cells.connectivity[mesh.cells.offsets[k] : mesh.cells.offsets[k + 1]]
        if set(nodes.tolist()) <= set(cell.tolist()):
            return cell
    raise AssertionError("no cell")


def henne(x, peak):
    """Hicks and Henne's bump."""
    x = max(0.0, x)
    return sin(pi * x ** (log10(0.5) / log10(peak))) ** 3 if x > 1e-15 else 0.0


def displaced(mesh, markers, kind, numbers, amount) -> dict[int, np.ndarray]:
    """Displacement of each node by one variable; ``amount`` is its value times the relaxation."""
    found = {}
    for marker in mesh.markers:
        if marker.name not in markers:
            continue
        normals = inward_normals(mesh, marker)
        for node in vertices(marker):
            x, y = mesh.points[node, :2]
            shift = np.zeros(mesh.dim)
            shift[1] = raised(kind, numbers, amount, x, y, normals[node][1])
            found[node] = shift
    return found


def raised(kind, numbers, amount, x, y, ny):
    """Displacement along y of a node at (x, y) whose normal has the component ``ny``."""
    if kind == "HICKS_HENNE":
        side, peak = numbers
        if side:
            return amount * henne(x, peak) if ny > 0 else 0.0
        return -amount * henne(x, peak) if ny < 0 else 0.0
    if kind == "CST":
        side, k, n = (int(number) for number in numbers)
        there = ny > 0 if side else ny < 0
        x = max(0.0, x)
        shape = comb(n - 1, k - 1) * x ** (k - 1) * (1 - x) ** (n - k)
        return amount * x**0.5 * (1 - x) * shape if there else 0.0
    if kind == "SURFACE_BUMP":
        start, end, peak = numbers
        length, along = end - start, x - start
        power = log10(0.5) / log10((peak - start + 1e-16) / length)
        inside = 0 < along < length
        return amount * sin(pi * ((along + 1e-16) / length) ** power) ** 3 if inside else 0.0
    if kind == "NACA_4DIGITS":
        most, where, thick = numbers[0] / 100, numbers[1] / 10, numbers[2] / 100
        if x < where:
            camber = most / where**2 * (2 * where * x - x**2)
        else:
            camber = most / (1 - where) ** 2 * (1 - 2 * where + 2 * where * x - x**2)
        half = thick * (
            1.4845 * sqrt(max(x, 0)) - 0.63 * x - 1.758 * x**2 + 1.4215 * x**3 - 0.518 * x**4
        )
        return camber + half - y if ny > 0 else camber - half - y if ny < 0 else 0.0
    assert kind == "PARABOLIC"
    centre, thick = numbers
    half = thick / 100 * (x * x - x) / (2 * (centre * centre - centre))
    return half - y if ny > 0 else -half - y if ny < 0 else 0.0


def cambered(mesh, markers, peaks, values) -> dict[int, np.ndarray]:
    """Displacement of each node by variables HICKS_HENNE_CAMBER."""
    for marker in mesh.markers:
        if marker.name in markers:
            order = vertices(marker)
            upper = lower = mesh.points[order[0], :2]
            nx, ny, _ = inward_normals(mesh, marker)[order[0]]
            for node in order:
                at = mesh.points[node, :2]
                if at[0] > 0 and abs(ny) > abs(nx):
                    upper, lower = (at, lower) if ny >= 0 else (upper, at)
    trailing = (upper + lower) / 2
    nodes = sorted({node for m in mesh.markers if m.name in markers for node in vertices(m)})
    leading = max((mesh.points[node, :2] for node in nodes), key=lambda p: hypot(*(p - trailing)))
    angle = atan((leading[1] - trailing[1]) / (trailing[0] - leading[0]))
    found = {}
    for node in nodes:
        dx, dy = mesh.points[node, :2] - leading
        x = max(0.0, dx * cos(angle) - dy * sin(angle))
        total = sum(v * henne(x, peak) for v, peak in zip(values, peaks, strict=True))
        total = 0.0 if x > 0.99 else total
        found[node] = np.zeros(mesh.dim)
        found[node][:2] = total * sin(angle), total * cos(angle)
    return found
