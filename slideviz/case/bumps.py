"""Bumps on the surface of an airfoil: functions of x along a chord from 0 to 1, and motions.

Hicks and Henne 1978, *Wing design by numerical optimization*; Kulfan 2008, *Universal parametric
geometry representation method* (class and shape transformation, CST); as SU2 8 has them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from slideviz.case.displacement import Displacements
from slideviz.case.model import Case, Cst, HicksHenne, OnAirfoil, applies_to, named
from slideviz.case.motion_text import term_of
from slideviz.errors import CaseError
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.topology import vertex_normals

EPS = 1e-16
"""What SU2 adds to coordinates of `surface_bump`."""
LEVEL = 1e-12
"""A node is on neither side where y is less than this part of its normal: that is rounding."""


def hicks_henne(x: FloatArray, peak: float) -> FloatArray:
    """Return ``sin³(π x^e)`` (m,), which is 1 at ``peak``; 0 where x is below 0."""
    x = np.maximum(x, 0.0)
    exponent = math.log10(0.5) / math.log10(peak)
    return np.where(x > 1e-15, np.sin(np.pi * x**exponent) ** 3, 0.0)


def kulfan(x: FloatArray, k: float, n: float) -> FloatArray:
    """Return Bernstein polynomial k of n (from 1), times the class function ``√x (1 - x)``: (m,).

    Where x is below 0, it counts as 0.
    """
    i, degree = (value - 1 for value in term_of(k, n))
    x = np.maximum(x, 0.0)
    shape = math.comb(degree, i) * x**i * (1.0 - x) ** (degree - i)
    return np.sqrt(x) * (1.0 - x) * shape


def surface_bump(x: FloatArray, start: float, end: float, peak: float) -> FloatArray:
    """Return a Hicks-Henne bump (m,) between two x, 1 at ``peak``; 0 elsewhere."""
    length = end - start
    if not start < peak < end:
        raise CaseError(
            f"the peak is at x = {peak:g}; it must lie between {start:g} and {end:g}, where the "
            "bump begins and ends"
        )
    exponent = math.log10(0.5) / math.log10((peak - start + EPS) / length)
    along = x - start
    inside = (along > 0.0) & (along < length)
    t = np.where(inside, along + EPS, 0.0) / length
    return np.where(inside, np.sin(np.pi * t**exponent) ** 3, 0.0)


def normals_at(mesh: Mesh, markers: Iterable[str], nodes: IntArray) -> FloatArray:
    """Return normals (m, d) into the mesh at nodes (m,) of some markers; zero at others.

    A node of several of the markers has the normal of the last one in the mesh, as in SU2.
    """
    out = np.zeros((len(nodes), mesh.dim))
    boundary = boundary_of(mesh)
    for index, name in enumerate(boundary.names):
        if name in markers:
            at, normals = vertex_normals(mesh.points, boundary.facets[boundary.marker == index])
            place = np.searchsorted(nodes, at)
            out[place] = -normals
    return out


def bump_displacements(
    case: Case, mesh: Mesh, on: Mapping[str, IntArray]
) -> dict[object, Displacements]:
    """Return the displacements of the nodes ``on`` moving markers, by airfoil motion.

    Raises CaseError if a motion with a height moves no node: none is on its side, along its chord.
    """
    displacements: dict[object, Displacements] = {}
    problems = []
    for place, motion in enumerate(case.motions, start=1):
        markers = [
            name for name in on if isinstance(motion, OnAirfoil) and applies_to(motion, name)
        ]
        if not markers or not isinstance(motion, OnAirfoil):
            continue
        nodes = np.unique(np.concatenate([on[name] for name in markers]))
        shape = _shape(motion, mesh, markers, nodes)
        vectors = np.zeros((len(nodes), mesh.dim))
        vectors[:, 1] = motion.height * shape
        displacements[motion] = Displacements(nodes, vectors)
        if not shape.any():
            of = " or ".join(repr(name) for name in named(motion.marker)) or "a moving marker"
            side = "" if not hasattr(motion, "side") else f" on its {motion.side} side"
            low, high = motion.chord
            problems.append(
                f"motion {place}: no node of {of} is{side} between x = {low:g} and {high:g}; "
                "give x of the leading and of the trailing edge"
            )
    if problems:
        raise CaseError("\n".join(problems))
    return displacements


def _shape(motion: OnAirfoil, mesh: Mesh, markers: list[str], nodes: IntArray) -> FloatArray:
    """Return the displacement (m,) of nodes along y by a height of 1."""
    low, high = motion.chord
    t = (mesh.points[nodes, 0] - low) / (high - low)
    along = (t > 0.0) & (t < 1.0)
    if isinstance(motion, Cst):
        shape = np.where(along, kulfan(np.where(along, t, 0.0), *motion.term), 0.0)
    else:
        shape = np.where(along, hicks_henne(np.where(along, t, 0.0), motion.peak), 0.0)
    if not isinstance(motion, HicksHenne | Cst):
        return shape
    sign = side_of(normals_at(mesh, markers, nodes))
    there = sign > 0.0 if motion.side == "upper" else sign < 0.0
    outwards = sign if isinstance(motion, HicksHenne) else 1.0
    return np.where(there, outwards * shape, 0.0)


def side_of(normals: FloatArray) -> FloatArray:
    """Return 1 for the upper side of an airfoil, -1 for the lower one, by normals (m, d): (m,).

    0 where the normal is level up to rounding.
    """
    upwards = normals[:, 1]
    level = np.abs(upwards) <= LEVEL * np.linalg.norm(normals, axis=1)
    return np.where(level, 0.0, np.sign(upwards))
