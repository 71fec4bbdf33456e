"""Motions and meshes in words: a motion in full, or in few words that distinguish cases."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slideviz.case.model import (
    BoxMotion,
    Bump,
    Case,
    Cst,
    Ffd,
    FfdCamber,
    FfdThickness,
    FfdTwist,
    FromFile,
    HicksHenne,
    Motion,
    OnAirfoil,
    Onto,
    Point,
    Prescribed,
    Radial,
    Rotate,
    Scale,
    SpanMotion,
    Target,
    Translate,
    named,
)
from slideviz.mesh.model import Mesh
from slideviz.terms import AXES, SPAN_KINDS

ALONG = 1e-12
"""A direction is along an axis where the cosine of their angle differs from 1 by less than this."""
NOTHING = 1e-10
"""A coordinate smaller than this part of the mesh's extent is written as 0: it is rounding."""


def describe(motion: Motion, dim: int = 2, extent: float = 0.0) -> str:
    """Return a motion in a few words.

    ``dim``: dimensions of the mesh; in 3D a rotation has an axis. ``extent``: extent of the mesh:
    coordinates that are only rounding beside it are written as 0.
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
    if isinstance(motion, HicksHenne):
        return f"move {_bump(motion, f'outwards by {motion.height:.4g}')}"
    if isinstance(motion, OnAirfoil):
        return f"raise {_bump(motion, f'by {motion.height:.4g}')}"
    if isinstance(motion, BoxMotion):
        if not isinstance(motion, FfdTwist):
            return _of_box(motion)
        about = f"{direction_words(motion.axis)} through {_place(motion.point, extent)}"
        return f"{_of_box(motion)} about {about}"
    if isinstance(motion, SpanMotion):
        about = "" if motion.point is None else f" about {_place(motion.point, extent)}"
        return f"{_curve(motion)}{about}"
    if isinstance(motion, Prescribed):
        return f"displace {len(motion.nodes):,} nodes as given"
    return f"{_laid(motion) or 'displace as in '}{motion.path.name or '(no file yet)'}"


def deformation(case: Case) -> tuple[object, ...]:
    """Return what cases must have in common to be compared: moving markers, and motions."""
    return frozenset(case.markers_with("moving")), case.motions


def motion_labels(cases: Sequence[Case]) -> list[str]:
    """Return a short label of the motions of each case; all are "" if all motions are the same.

    If the cases have equally many motions, labels contain only those that differ. Labels name
    boundaries only if several boundaries move. They contain points, axes and folders only if
    different motions would have the same label otherwise.
    """
    if len({case.motions for case in cases}) < 2:
        return [""] * len(cases)
    every = [case.motions for case in cases]
    if len({len(motions) for motions in every}) == 1:
        # What all have in common would push what differs out of a narrow list.
        places = [at for at, column in enumerate(zip(*every, strict=True)) if len({*column}) > 1]
        every = [tuple(motions[at] for at in places) for motions in every]
    several = len({motion.marker for motions in every for motion in motions} - {""}) > 1
    labels = [_label(motions, several, exact=False) for motions in every]
    alike: dict[str, set[object]] = {}
    for label, motions in zip(labels, every, strict=True):
        alike.setdefault(label, set()).add(motions)
    return [
        _label(motions, several, exact=True) if len(alike[label]) > 1 else label
        for label, motions in zip(labels, every, strict=True)
    ]


def _label(motions: Sequence[Motion], several: bool, exact: bool) -> str:
    parts = []
    for motion in motions:
        words = _exactly(motion) if exact else _briefly(motion)
        with_target = several and bool(motion.marker)
        parts.append(f"{target_words(motion.marker)}: {words}" if with_target else words)
    return " + ".join(parts) or "no motion"


def _briefly(motion: Motion) -> str:
    """Return a motion in few words, without its point and axis."""
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
    if isinstance(motion, OnAirfoil):
        return _bump(motion, f"{motion.height:+.4g}")
    if isinstance(motion, BoxMotion):
        return _of_box(motion)
    if isinstance(motion, SpanMotion):
        return _curve(motion)
    if isinstance(motion, Prescribed):
        return f"{len(motion.nodes):,} nodes as given"
    return f"{_laid(motion)}{motion.path.name or '(no file yet)'}"


def _exactly(motion: Motion) -> str:
    """Return a motion in words, with its point and axis, and numbers with 15 digits."""
    if isinstance(motion, FromFile):
        return f"{_laid(motion)}{motion.path}"
    if isinstance(motion, Ffd):
        return f"{_control(motion)} {vector_words(motion.vector, '.15g')}"
    if isinstance(motion, OnAirfoil):
        chord = f", chord {vector_words(motion.chord, '.15g')}" * (motion.chord != (0.0, 1.0))
        return _bump(motion, f"{motion.height:+.15g}", ".15g") + chord
    if isinstance(motion, FfdTwist):
        return _of_box(motion, ".15g") + _about(motion.point) + _along(motion.axis)
    if isinstance(motion, BoxMotion):
        return _of_box(motion, ".15g")
    if isinstance(motion, SpanMotion):
        return _curve(motion, ".15g") + ("" if motion.point is None else _about(motion.point))
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


def _laid(motion: FromFile) -> str:
    return "lay onto " if isinstance(motion, Onto) else ""


def mesh_words(mesh: Mesh) -> tuple[str, str]:
    """Return a line on a mesh, and further ones: halo, what is in memory, extreme coordinates."""
    halo = "" if mesh.halo is None else f"  (halo: {int(mesh.halo.cells.sum()):,})"
    about = "" if mesh.halo is None else f"With {mesh.halo.describe()}.\n"
    size, ends = bounds_words(mesh)
    part = mesh.part
    cells, points = (part.n_cells, part.n_points) if part else (len(mesh.cells), len(mesh.points))
    count = f"{cells:,} cells{halo}   {points:,} points"
    if part is not None:
        count += "   boundary and sections only"
        about += f"In memory: {len(mesh.cells):,} cells at the boundary; the rest is in its file.\n"
    return f"{mesh.dim}D   {count}   {size}", about + ends


def bounds_words(mesh: Mesh) -> tuple[str, str]:
    """Return the mesh's size along each axis, and its extreme coordinates; "" without points."""
    if not len(mesh.points):
        return "", ""
    low, high = mesh.bounds
    size = " × ".join(f"{value:.4g}" for value in high - low)
    rows = zip("xyz", low, high, high - low, strict=False)
    ends = (f"{axis} from {a:.6g} to {b:.6g}: {c:.6g}" for axis, a, b, c in rows)
    return size, "\n".join(["The undeformed mesh, in its length unit:", *ends])


def vector_words(values: Sequence[float], form: str = ".4g") -> str:
    """Return a vector as text, its numbers in the format ``form``: by default four digits."""
    return f"({', '.join(format(value, form) for value in values)})"


def _factors(values: Sequence[float], form: str = ".4g") -> str:
    return " × ".join(format(value, form) for value in values)


def _push(motion: Radial) -> str:
    parts = [f"{100.0 * (motion.factor - 1.0):+.4g} %"] if motion.factor != 1.0 else []
    parts += [f"{motion.distance:+.4g}"] if motion.distance or not parts else []
    return " and ".join(parts)


def _bump(motion: OnAirfoil, by: str, form: str = ".4g") -> str:
    """Return what a motion moves of an airfoil, in words, with the height as in ``by``."""
    if isinstance(motion, Cst):
        return f"{motion.side} side {by} × CST {motion.term[0]} of {motion.term[1]}"
    what = "both sides" if isinstance(motion, Bump) else f"{motion.side} side"
    return f"{what} {by} at {format(100.0 * motion.peak, form)} % chord"


def _curve(motion: SpanMotion, form: str = ".4g") -> str:
    """Return what a motion over the span changes, in words, with its values along the span."""
    unit = "°" if SPAN_KINDS[motion.kind].unit == "°" else ""
    values = [f"{format(value, form)}{unit}" for value in motion.values]
    if len(values) == 1:
        return f"{motion.kind} {values[0]}"
    spans = [format(100.0 * span, form) for span in motion.spans]
    pairs = (f"{value} at {span} %" for value, span in zip(values, spans, strict=True))
    return f"{motion.kind} {', '.join(pairs)} span"


def _control(motion: Ffd | FfdCamber | FfdThickness) -> str:
    at = ", ".join("all" if index < 0 else str(index) for index in motion.index)
    return f"({at}) of {_box(motion)}"


def _box(motion: BoxMotion) -> str:
    return motion.box or "(no box yet)"


def _of_box(motion: FfdCamber | FfdThickness | FfdTwist, form: str = ".4g") -> str:
    """Return a motion of many control points of a box in words, without axis and point."""
    if isinstance(motion, FfdTwist):
        planes = "all planes" if motion.plane < 0 else f"plane {motion.plane}"
        return f"twist {planes} of {_box(motion)} {motion.angle_deg:+{form}}°"
    what = "camber" if isinstance(motion, FfdCamber) else "thickness"
    return f"{what} {_control(motion)} {motion.amount:+{form}}"


def _place(point: Point, extent: float = 0.0, form: str = ".4g", its: str = "its") -> str:
    if isinstance(point, str):
        return f"{its} {point}"
    return vector_words([v if abs(v) >= NOTHING * extent else 0.0 for v in point], form)


def _about(point: Point) -> str:
    return f" about {_place(point, form='.15g')}"


def _along(axis: Sequence[float]) -> str:
    return "" if tuple(axis) == AXES["z"] else f", axis {vector_words(axis, '.15g')}"


def direction_words(direction: Sequence[float]) -> str:
    """Return ``x``, ``-x`` and so on for a direction along an axis, else the vector as text."""
    spatial = (*direction, 0.0)[:3]
    least = (1.0 - ALONG) * math.hypot(*spatial)
    for name, value in zip(AXES, spatial, strict=True):
        if abs(value) > least > 0.0:
            return name if value > 0.0 else f"-{name}"
    return vector_words(direction)
