"""Remedies against inverted cells, in one order for the command line and the window."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slideviz.argument_types import frozen
from slideviz.case.model import Case
from slideviz.case.moving_nodes import by_zone, displacements
from slideviz.case.spans import periodic_pairs
from slideviz.case.zone_cases import each_zone
from slideviz.errors import SlidevizError, doubts_of, messages_of
from slideviz.mesh.axis_frame import in_axis_frame
from slideviz.mesh.model import FloatArray, IntArray, Mesh, Skin, largest_size, mask_of
from slideviz.mesh.periodic import Pair
from slideviz.rbf.reduction import Reduction
from slideviz.solver.steps import Step
from slideviz.terms import SLIDES

SLIDE_RIMS = "RIMS= SLIDE"  # in the remedy of messages that nodes left a wall
MOST_NAMES = 2  # most boundaries that a remedy names; of more it has the number


@frozen
class Remedy:
    """A remedy in the words of the case file (``keys``) and in those of the window."""

    keys: str
    window: str


def remedies(
    case: Case,
    beside: Sequence[str] = (),
    pitch: str = "",
    step: Step | None = None,
    folded: bool = True,
) -> tuple[Remedy, ...]:
    """Return the remedies that a case has not tried yet, the most promising first.

    ``case``: the case of the run.
    ``beside``: fixed boundaries with nodes of inverted cells, from `fixed_beside`.
    ``pitch``: sentence from `beyond_pitch`.
    ``step``: the one with inverted cells, if it is known.
    ``folded``: whether there are inverted cells: repair is a remedy for these.
    """
    doubts = doubts_of(step.messages) if step else ()
    found = [Remedy(*[doubt.remedy] * 2) for doubt in doubts]
    roles = set(case.roles.values())
    if case.method != "rbf":
        found.append(Remedy("METHOD= rbf", "radial basis functions as the method"))
    if case.layers != "no" and case.layer_thickness:
        found.append(Remedy("LAYER_THICKNESS= AUTO", "an automatic thickness of the layers"))
    if step and any(SLIDE_RIMS in each.remedy for each in messages_of(step.messages)):
        found.append(Remedy(SLIDE_RIMS, "“stay on walls” for nodes on walls"))
    if step and step.layers:
        given = case.reduction or Reduction()
        yes = "DATA_REDUCTION= YES with " if given.auto else ""
        no = " instead of DATA_RED_RELATIVE" if given.relative and not given.auto else ""
        why = "half of the smallest distance between moving and sliding nodes"
        found.append(
            Remedy(
                f"{yes}DATA_RED_TOLERANCE= {step.layers:.2g}{no}, {why}",
                f"a data reduction with the tolerance {step.layers:.2g}, {why}",
            )
        )
    if pitch:
        found.append(Remedy(*["a motion below the pitch"] * 2))
    slides = {"sliding", "periodic"} & roles
    if beside or (not slides and "fixed" in roles):
        few = len(beside) <= MOST_NAMES
        who = " and ".join(beside) if few else f"{len(beside)} fixed boundaries"
        who = f"{who} beside these cells" if beside else "boundaries near these cells"
        off = case.sliding == "none"
        keys = f"MARKER_SLIDING for {who}" + (f", and SLIDING_MODE= {SLIDES}" if off else "")
        words = f"the role “sliding” for {who}" + (", and a sliding method" if off else "")
        found.append(Remedy(keys, words))
    elif slides and case.sliding == "none":
        found.append(Remedy(f"SLIDING_MODE= {SLIDES}", "sliding boundary nodes"))
    if "periodic" in roles and case.sliding != "none" and case.periodic in ("none", "periodic"):
        found.append(Remedy("PERIODIC_MODE= moving", "periodicity with moving vertices"))
    streamed = step is not None and isinstance(step.mesh, Skin)
    if case.relax == "no" and case.method == "rbf" and not streamed:
        found.append(Remedy("RELAX= YES", "relaxation"))
    if case.steps:
        found.append(Remedy("more STEPS, or STEPS= auto", "more steps, or automatic steps"))
    if folded and case.repair == "no" and not pitch:
        found.append(Remedy("REPAIR= YES", "repair, in the menu Run"))
    if not pitch:
        found.append(Remedy(*["a smaller motion"] * 2))
    return tuple(found)


def fixed_beside(case: Case, mesh: Mesh, cells: IntArray) -> tuple[str, ...]:
    """Return the fixed boundaries that have nodes of cells (k,); none of a mesh in its file."""
    if isinstance(mesh, Skin):
        return ()
    near = mask_of(len(mesh.points), mesh.cells.take(cells).connectivity)
    return tuple(
        marker.name
        for marker in mesh.markers
        if case.roles.get(marker.name, "fixed") == "fixed" and near[marker.nodes].any()
    )


def beyond_pitch(case: Case, mesh: Mesh) -> str:
    """Return a sentence on a motion that takes a node farther than the pitch; "" for none."""
    if case.periodic == "none" or not case.markers_with("periodic"):
        return ""
    words = (_beyond_pitch_of_zone(*one) for one in each_zone(by_zone(case, mesh), mesh))
    return next(filter(None, words), "")


def _beyond_pitch_of_zone(case: Case, mesh: Mesh) -> str:
    try:
        pairs = periodic_pairs(case, mesh)
        moved = displacements(case, mesh)
    except SlidevizError:  # the run itself reports what is wrong
        return ""
    for pair in pairs:
        farthest = _along(pair, mesh.points[moved.nodes], moved.vectors)
        if farthest > pair.period * (1.0 + 1e-9):
            turned = pair.kind == "rotational"
            far = f"{np.degrees(farthest):.4g}°" if turned else f"{farthest:.4g}"
            return f"The motion is {far}, farther than the pitch: {pair.describe()}"
    return ""


def _along(pair: Pair, points: FloatArray, vectors: FloatArray) -> float:
    if pair.kind == "translational":
        return largest_size(vectors @ (pair.vector / pair.period))
    plane = (1.0, 1.0j, 0.0)
    before = in_axis_frame(points, pair.axis, pair.origin) @ plane
    after = in_axis_frame(points + vectors, pair.axis, pair.origin) @ plane
    return largest_size(np.angle(after * before.conj()))
