"""Motions in words: each in full, and those of several cases in as few as tell them apart."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slideviz.case.model import (
    Case,
    Ffd,
    FromFile,
    Motion,
    Point,
    Prescribed,
    Radial,
    Rotate,
    Scale,
    Target,
    Translate,
    named,
)
from slideviz.mesh.model import Mesh
from slideviz.terms import AXES

ALONG = 1e-12
"""What the cosine of the angle between a direction and an axis may miss of 1."""
NOTHING = 1e-10
"""Part of the extent of a mesh below which a coordinate is what rounding left of zero."""


def describe(motion: Motion, dim: int = 2, extent: float = 0.0) -> str:
    """Return a motion in a few words.

    Parameters
    ----------
    motion : Motion
    dim : int
        Dimensions of the mesh; in 3D a rotation has an axis.
    extent : float
        Size of the mesh: of a point, what rounding left of zero beside it is written as 0.
    """
    return f"{target_words(motion.marker)}: {_in_full(motion, dim, extent)}"


def target_words(target: Target) -> str:
    """Return the markers that a motion moves, in words."""
    return " + ".join(named(target)) or "all moving"


def _in_full(motion: Motion, dim: int, extent: float) -> str:
    its = "its" if len(named(motion.marker)) == 1 else "their"
    if isinstance(motion, Translate):
        return f"translate by {vector_words(motion.vector)}"
    if isinstance(motion, Rotate):
        turned = f"rotate by {motion.angle_deg:.5g}°"
        if dim == 3:
            through = _place(motion.point, extent, its=its)
            return f"{turned} about {direction_words(motion.axis)} through {through}"
        return f"{turned} about {_place(motion.point, extent, its=its)}"
    if isinstance(motion, Scale):
        about = _place(motion.point, extent, its=its)
        return f"scale by {_factors(motion.factors)} about {about}"
    if isinstance(motion, Radial):
        return f"push radially by {_push(motion)}"
    if isinstance(motion, Ffd):
        return f"move {_control(motion)} by {vector_words(motion.vector[:dim])}"
    if isinstance(motion, Prescribed):
        return f"displace {len(motion.nodes):,} nodes as given"
    return f"displace as in {motion.path.name or '(no file yet)'}"


def deformation(case: Case) -> tuple[object, ...]:
    """Return the part of a case that moves boundaries: the same for cases to compare."""
    return frozenset(case.markers_with("moving")), case.motions


def motion_labels(cases: Sequence[Case]) -> list[str]:
    """Return for each case its motions in few words; empty texts where all have the same.

    A boundary is named where several move; points, axes and folders are given where the rest
    would read alike.
    """
    if len({case.motions for case in cases}) < 2:
        return [""] * len(cases)
    several = len({motion.marker for case in cases for motion in case.motions} - {""}) > 1
    labels = [_label(case, several, exact=False) for case in cases]
    alike: dict[str, set[object]] = {}
    for label, case in zip(labels, cases, strict=True):
        alike.setdefault(label, set()).add(case.motions)
    return [
        _label(case, several, exact=True) if len(alike[label]) > 1 else label
        for label, case in zip(labels, cases, strict=True)
    ]


def _label(case: Case, several: bool, exact: bool) -> str:
    parts = []
    for motion in case.motions:
        words = _exactly(motion) if exact else _briefly(motion)
        with_target = several and bool(motion.marker)
        parts.append(f"{target_words(motion.marker)}: {words}" if with_target else words)
    return " + ".join(parts) or "no motion"


def _briefly(motion: Motion) -> str:
    """Return what a motion does, without where, in some words."""
    if isinstance(motion, Translate):
        moved = [at for at, value in enumerate(motion.vector) if value]
        if len(moved) == 1:
            return f"translate {'xyz'[moved[0]]} {motion.vector[moved[0]]:+.4g}"
        return f"translate {vector_words(motion.vector)}"
    if isinstance(motion, Rotate):
        return f"rotate {motion.angle_deg:+.4g}°"
    if isinstance(motion, Scale):
        same = len(set(motion.factors)) == 1
        return f"scale {_factors(motion.factors[:1] if same else motion.factors)}"
    if isinstance(motion, Radial):
        return f"radially {_push(motion)}"
    if isinstance(motion, Ffd):
        return f"{_control(motion)} {vector_words(motion.vector)}"
    if isinstance(motion, Prescribed):
        return f"{len(motion.nodes):,} nodes as given"
    return motion.path.name or "(no file yet)"


def _exactly(motion: Motion) -> str:
    """Return all that a motion says, with every digit."""
    if isinstance(motion, FromFile):
        return str(motion.path)
    if isinstance(motion, Ffd):
        return f"{_control(motion)} {vector_words(motion.vector, '.15g')}"
    if isinstance(motion, Prescribed):
        return _briefly(motion)
    if isinstance(motion, Translate):
        return f"translate {vector_words(motion.vector, '.15g')}"
    if isinstance(motion, Scale):
        return f"scale {_factors(motion.factors, '.15g')}" + _about(motion.point)
    if isinstance(motion, Radial):
        by = f"× {motion.factor:.15g} {motion.distance:+.15g}"
        return f"radially {by}" + _about(motion.point) + _along(motion.axis)
    turned = f"rotate {motion.angle_deg:+.15g}°" + _about(motion.point)
    return turned + _along(motion.axis)


def mesh_words(mesh: Mesh) -> tuple[str, str]:
    """Return dimensions, counts and size of a mesh in a line, and in other lines its ends."""
    halo = "" if mesh.halo is None else f"  (halo: {int(mesh.halo.cells.sum()):,})"
    about = "" if mesh.halo is None else f"With {mesh.halo.describe()}.\n"
    size, ends = box_words(mesh)
    part = mesh.part
    cells, points = (part.n_cells, part.n_points) if part else (len(mesh.cells), len(mesh.points))
    count = f"{cells:,} cells{halo}   {points:,} points"
    if part is not None:
        count += "   boundary and sections only"
        about += f"In memory: {len(mesh.cells):,} cells at the boundary; the rest is in its file.\n"
    return f"{mesh.dim}D   {count}   {size}", about + ends


def box_words(mesh: Mesh) -> tuple[str, str]:
    """Return the size of a mesh along each axis, and the ends of it, a line for each axis."""
    if not len(mesh.points):
        return "", ""
    low, high = mesh.bounds
    size = " × ".join(f"{value:.4g}" for value in high - low)
    rows = zip("xyz", low, high, high - low, strict=False)
    ends = (f"{axis} from {a:.6g} to {b:.6g}: {c:.6g}" for axis, a, b, c in rows)
    return size, "\n".join(["The undeformed mesh, in its length unit:", *ends])


def vector_words(values: Sequence[float], form: str = ".4g") -> str:
    """Return a vector in words, its numbers with four digits unless ``form`` says otherwise."""
    return f"({', '.join(format(value, form) for value in values)})"


def _factors(values: Sequence[float], form: str = ".4g") -> str:
    return " × ".join(format(value, form) for value in values)


def _push(motion: Radial) -> str:
    parts = [f"{100.0 * (motion.factor - 1.0):+.4g} %"] if motion.factor != 1.0 else []
    parts += [f"{motion.distance:+.4g}"] if motion.distance or not parts else []
    return " and ".join(parts)


def _control(motion: Ffd) -> str:
    """Return the control points that a motion moves, in words."""
    at = ", ".join("all" if index < 0 else str(index) for index in motion.index)
    return f"({at}) of {motion.box or '(no box yet)'}"


def _place(point: Point, extent: float = 0.0, form: str = ".4g", its: str = "its") -> str:
    if isinstance(point, str):
        return f"{its} {point}"
    return vector_words([v if abs(v) >= NOTHING * extent else 0.0 for v in point], form)


def _about(point: Point) -> str:
    return f" about {_place(point, form='.15g')}"


def _along(axis: Sequence[float]) -> str:
    return "" if tuple(axis) == AXES["z"] else f", axis {vector_words(axis, '.15g')}"


def direction_words(direction: Sequence[float]) -> str:
    """Return a direction as x, -x and so on where it is one, else its components."""
    whole = (*direction, 0.0)[:3]
    least = (1.0 - ALONG) * math.hypot(*whole)
    for name, value in zip(AXES, whole, strict=True):
        if abs(value) > least > 0.0:
            return name if value > 0.0 else f"-{name}"
    return vector_words(direction)
