"""Random meshes of many shapes, spacings, sizes and places, and the same in another order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from slideviz.mesh.axis_frame import axis_basis
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh
from tests import builders
from tools.laws import shapes
from tools.laws.draw import Made, Period, Rng
from tools.laws.oracle import carried


def random_mesh(rng: Rng) -> Made:
    """Return a random mesh of up to some 2,000 nodes."""
    makers: tuple[tuple[Callable[[Rng], Made], float], ...] = (
        (shapes.box, 0.4),
        (shapes.ring, 0.27),
        (shapes.around, 0.15),
        (shapes.special, 0.08),
        (shapes.sample, 0.04),
        (shapes.small, 0.06),
    )
    chances = [chance for _, chance in makers]
    made = makers[rng.choice(len(makers), p=chances)][0](rng)
    return _placed(rng, _jittered(rng, made))


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
    found = []
    for first, second in period.sides:
        a, b = (made.mesh.marker(name).nodes for name in (first, second))
        there = carried(period, made.mesh.points[a])
        gap = np.linalg.norm(there[:, None] - made.mesh.points[b][None], axis=2)
        assert gap.min(axis=1).max(initial=0.0) < 1e-7 * made.mesh.extent, (first, second)
        found.append(np.stack([a, b[gap.argmin(axis=1)]], axis=1))
    return np.concatenate(found)


def renumbered(mesh: Mesh, rng: np.random.Generator) -> tuple[Mesh, IntArray]:
    """Return the mesh in another order, and which old node each new one is (n,)."""
    order = rng.permutation(len(mesh.points))
    mesh = builders.permuted(mesh, order)
    markers = tuple(Marker(m.name, _shuffled(m.cells, rng)) for m in mesh.markers)
    return Mesh(mesh.points, _shuffled(mesh.cells, rng), markers, name=mesh.name), order


def _shuffled(cells: Cells, rng: np.random.Generator) -> Cells:
    order = rng.permutation(len(cells))
    parts = [cells.connectivity[cells.offsets[i] : cells.offsets[i + 1]] for i in order]
    return Cells.from_types(cells.types[order], np.concatenate(parts))
