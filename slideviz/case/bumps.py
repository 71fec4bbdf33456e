"""Bumps on the surface of an airfoil, as functions of x along a chord from 0 to 1.

Hicks and Henne 1978, *Wing design by numerical optimization*; Kulfan 2008, *Universal parametric
geometry representation method* (class and shape transformation, CST); as SU2 8 has them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from slideviz.errors import CaseError
from slideviz.mesh.cached_boundary import boundary_of
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.topology import vertex_normals

EPS = 1e-16
"""What SU2 adds to coordinates of `surface_bump`."""


def require_peak(peak: float) -> None:
    """Raise CaseError where a bump cannot have its peak at x = ``peak``."""
    if not 0.0 < peak < 1.0:
        raise CaseError(f"the peak is at x = {peak:g}; it must lie between 0 and 1")


def hicks_henne(x: FloatArray, peak: float) -> FloatArray:
    """Return ``sin³(π x^e)`` (m,), which is 1 at ``peak``; 0 where x is below 0."""
    x = np.maximum(x, 0.0)
    exponent = math.log10(0.5) / math.log10(peak)
    return np.where(x > 1e-15, np.sin(np.pi * x**exponent) ** 3, 0.0)


def kulfan(x: FloatArray, k: float, n: float) -> FloatArray:
    """Return Bernstein polynomial k of n (from 1), times the class function ``√x (1 - x)``: (m,).

    Where x is below 0, it counts as 0.
    """
    i, degree = int(k) - 1, int(n) - 1
    if not 0 <= i <= degree:
        raise CaseError(f"there is no coefficient {k:g} of {n:g}; the first must be 1 to {n:g}")
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
