"""Motions and meshes in words: a motion in full, or in few words that distinguish cases."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slideviz.case import model
from slideviz.case.model import Case, Motion, Point, Target, named
from slideviz.mesh.model import Mesh
from slideviz.terms import AXES, SPAN_KINDS

ALONG = 1e-12
"""A direction is along an axis where the cosine of their angle differs from 1 by less than this."""
MOST_NAMED = 4  # most markers of a motion whose names are all in its words
NOTHING = 1e-10
"""A coordinate smaller than this part of the mesh's extent is written as 0: it is rounding."""


def describe(motion: Motion, dim: int = 2, extent: float = 0.0) -> str:
    """Return a motion in a few words.

    ``dim``: dimensions of the mesh; in 3D a rotation has an axis. ``extent``: extent of the mesh:
    coordinates that are only rounding beside it are written as 0.
    """
    return f"{target_words(motion.marker)}: {_in_full(motion, dim, extent)}"


def target_words(target: Target) -> str:
    """Return the markers that a motion moves, in words: of many the first ones, and a number."""
    names = named(target)
    more = len(names) - MOST_NAMED + 1
    if more > 1:
        names = (*names[: MOST_NAMED - 1], f"{more} more")
    return " + ".join(names) or "all moving"


def _in_full(motion: Motion, dim: int, extent: float) -> str:
    its = "its" if len(named(motion.marker)) == 1 else "their"
    point = getattr(motion, "point", None)
    place = "" if point is None else _place(point, extent, its=its)
    if isinstance(motion, model.Translate):
        return f"translate by {vector_words(motion.vector)}"
    if isinstance(motion, model.Rotate):
        through = f"{direction_words(motion.axis)} through " if dim == 3 else ""
        return f"rotate by {motion.angle_deg:.5g}° about {through}{place}"
    if isinstance(motion, model.Scale):
        return f"scale by {_factors(motion.factors)} about {place}"
    if isinstance(motion, model.Radial):
        return f"push radially by {_push(motion)}"
    if isinstance(motion, model.Ffd):
        return f"move {_control(motion)} by {vector_words(motion.vector[:dim])}"
    if isinstance(motion, model.HicksHenne):
        return f"move {_bump(motion, f'outwards by {motion.height:.4g}')}"
    if isinstance(motion, model.OnAirfoil):
        return f"raise {_bump(motion, f'by {motion.height:.4g}')}"
    if isinstance(motion, model.FfdTwist):
        return f"{_of_box(motion)} about {direction_words(motion.axis)} through {place}"
    if isinstance(motion, model.BoxMotion):
        return _of_box(motion)
    if isinstance(motion, model.SpanMotion):
        return f"{_curve(motion)} about {place}" if place else _curve(motion)
    if isinstance(motion, model.Prescribed):
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
        words = _in_few_words(motion, exact)
        with_target = several and bool(motion.marker)
        parts.append(f"{target_words(motion.marker)}: {words}" if with_target else words)
    return " + ".join(parts) or "no motion"


def _in_few_words(motion: Motion, exact: bool) -> str:
    """Return a motion in words; with ``exact``, its point, axis and folder, and 15 digits."""
    form = ".15g" if exact else ".4g"
    if isinstance(motion, model.Translate):
        moved = [at for at, value in enumerate(motion.vector) if value]
        if len(moved) == 1 and not exact:
            return f"translate {'xyz'[moved[0]]} {motion.vector[moved[0]]:+.4g}"
        words = f"translate {vector_words(motion.vector, form)}"
    elif isinstance(motion, model.Rotate):
        words = f"rotate {motion.angle_deg:+{form}}°"
    elif isinstance(motion, model.Scale):
        same = len(set(motion.factors)) == 1 and not exact
        words = f"scale {_factors(motion.factors[:1] if same else motion.factors, form)}"
    elif isinstance(motion, model.Radial):
        by = f"× {motion.factor:.15g} {motion.distance:+.15g}" if exact else _push(motion)
        words = f"radially {by}"
    elif isinstance(motion, model.Ffd):
        words = f"{_control(motion)} {vector_words(motion.vector, form)}"
    elif isinstance(motion, model.OnAirfoil):
        along = exact and motion.chord != (0.0, 1.0)
        chord = f", chord {vector_words(motion.chord, form)}" * along
        words = _bump(motion, f"{motion.height:+{form}}", form) + chord
    elif isinstance(motion, model.BoxMotion):
        words = _of_box(motion, form)
    elif isinstance(motion, model.SpanMotion):
        words = _curve(motion, form)
    elif isinstance(motion, model.Prescribed):
        words = f"{len(motion.nodes):,} nodes as given"
    else:
        path = str(motion.path) if exact else motion.path.name or "(no file yet)"
        words = f"{_laid(motion)}{path}"
    return words + _about(motion) * exact


def _laid(motion: model.FromFile) -> str:
    return "lay onto " if isinstance(motion, model.Onto) else ""


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


def _push(motion: model.Radial) -> str:
    parts = [f"{100.0 * (motion.factor - 1.0):+.4g} %"] if motion.factor != 1.0 else []
    parts += [f"{motion.distance:+.4g}"] if motion.distance or not parts else []
    return " and ".join(parts)


def _bump(motion: model.OnAirfoil, by: str, form: str = ".4g") -> str:
    """Return what a motion moves of an airfoil, in words, with the height as in ``by``."""
    if isinstance(motion, model.Cst):
        return f"{motion.side} side {by} × CST {motion.term[0]} of {motion.term[1]}"
    what = "both sides" if isinstance(motion, model.Bump) else f"{motion.side} side"
    return f"{what} {by} at {format(100.0 * motion.peak, form)} % chord"


def _curve(motion: model.SpanMotion, form: str = ".4g") -> str:
    """Return what a motion over the span changes, in words, with its values along the span."""
    unit = "°" if SPAN_KINDS[motion.kind].unit == "°" else ""
    values = [f"{format(value, form)}{unit}" for value in motion.values]
    if len(values) == 1:
        return f"{motion.kind} {values[0]}"
    spans = [format(100.0 * span, form) for span in motion.spans]
    pairs = (f"{value} at {span} %" for value, span in zip(values, spans, strict=True))
    return f"{motion.kind} {', '.join(pairs)} span"


def _control(motion: model.Ffd | model.FfdCamber | model.FfdThickness) -> str:
    at = ", ".join("all" if index < 0 else str(index) for index in motion.index)
    return f"({at}) of {_box(motion)}"


def _box(motion: model.BoxMotion) -> str:
    return motion.box or "(no box yet)"


def _of_box(
    motion: model.FfdCamber | model.FfdThickness | model.FfdTwist, form: str = ".4g"
) -> str:
    """Return a motion of many control points of a box in words, without axis and point."""
    if isinstance(motion, model.FfdTwist):
        planes = "all planes" if motion.plane < 0 else f"plane {motion.plane}"
        return f"twist {planes} of {_box(motion)} {motion.angle_deg:+{form}}°"
    what = "camber" if isinstance(motion, model.FfdCamber) else "thickness"
    return f"{what} {_control(motion)} {motion.amount:+{form}}"


def _place(point: Point, extent: float = 0.0, form: str = ".4g", its: str = "its") -> str:
    if isinstance(point, str):
        return f"{its} {point}"
    return vector_words([v if abs(v) >= NOTHING * extent else 0.0 for v in point], form)


def _about(motion: Motion) -> str:
    """Return words for the point and the axis of a motion, if it has them."""
    point, axis = getattr(motion, "point", None), getattr(motion, "axis", AXES["z"])
    about = "" if point is None else f" about {_place(point, form='.15g')}"
    return about + ("" if tuple(axis) == AXES["z"] else f", axis {vector_words(axis, '.15g')}")


def direction_words(direction: Sequence[float]) -> str:
    """Return ``x``, ``-x`` and so on for a direction along an axis, else the vector as text."""
    spatial = (*direction, 0.0)[:3]
    least = (1.0 - ALONG) * math.hypot(*spatial)
    for name, value in zip(AXES, spatial, strict=True):
        if abs(value) > least > 0.0:
            return name if value > 0.0 else f"-{name}"
    return vector_words(direction)
