"""Keys of a case file about data reduction: which boundary nodes are control nodes.

The numbers of DATA_REDUCTION= AUTO in the text below are EXACT_NODES and AUTO_TOLERANCE of
`slideviz.solver.reduction`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from slideviz.case.key import NO_DEFAULT, REDUCTION, Key, other_method
from slideviz.case.model import Case
from slideviz.case.reduction import Reduction
from slideviz.case.values import YES_NO, Kind, one_of, real, whole
from slideviz.terms import DATA_REDUCTIONS, LEVEL_CRITERIA, SELECTIONS, DataReduction


def why_no_reduction(case: Case) -> str:
    """Return why settings of data reduction have no effect in a case; "" where they have one."""
    off = "" if case.reduction is not None else "data reduction is off"
    return other_method(case, "rbf") or off


def why_no_tolerance(case: Case) -> str:
    """Return why a tolerance of data reduction has no effect in a case; "" where it has one."""
    auto = case.reduction is not None and case.reduction.auto
    return why_no_reduction(case) or ("it is automatic" if auto else "")


def why_no_levels(case: Case) -> str:
    """Return why settings of levels have no effect in a case; "" where they have one."""
    levels = case.reduction is not None and case.reduction.multilevel
    return why_no_reduction(case) or ("" if levels else "there are no levels")


def greedy(name: str, kind: Kind, field: str, meaning: str, **window: Any) -> Key:
    """Return the row of a key whose value is a field of ``Reduction``.

    Where a case has no data reduction, the value is checked and not kept. ``window`` has further
    attributes of the row (`Key`), mostly for the window.
    """

    def put(case: Case, value: Any) -> Case:
        if case.reduction is None:
            return case
        return case.change(reduction=replace(case.reduction, **{field: value}))

    usual = getattr(Reduction(), field)
    default = NO_DEFAULT if usual is None else kind.write(usual)
    window = {"idle_reason": why_no_reduction, **window}

    def get(case: Case) -> Any:
        given = case.reduction
        if given is None:
            return None
        value = getattr(given, field)
        # A tolerance without effect is written to a file only where it is not the default.
        idle = given.auto and window["idle_reason"] is why_no_tolerance and value == usual
        return None if idle else value

    return Key(name, REDUCTION, kind, meaning, put, get, default, field=field, **window)


def put_double_edge(case: Case, wanted: bool) -> Case:
    """Return the case that selects two nodes in a cycle, or one: RBF-SliDe's DOUBLE_EDGE.

    A case without data reduction stays as it is.
    """
    if case.reduction is None:
        return case
    return case.change(reduction=replace(case.reduction, selection="double" if wanted else "one"))


def put_reduction(case: Case, wanted: DataReduction) -> Case:
    """Return the case with data reduction (with the settings it has), automatic, or without."""
    given = replace(case.reduction or Reduction(), auto=wanted == "AUTO")
    return case.change(reduction=None if wanted == "NO" else given)


def get_reduction(case: Case) -> DataReduction:
    """Return whether a case asks for data reduction: "YES", "NO" or "AUTO"."""
    if case.reduction is None:
        return "NO"
    return "AUTO" if case.reduction.auto else "YES"


REDUCTION_ROWS = (
    Key(
        "DATA_REDUCTION",
        REDUCTION,
        one_of(DATA_REDUCTIONS, {"TRUE": "YES", "FALSE": "NO"}),
        "Interpolate with some of the boundary nodes only; with NO the keys below do nothing. AUTO "
        "does so where they are more than 2000, to a thousandth of the largest displacement, or "
        "half of the first layer's height beside sliding boundaries.",
        put_reduction,
        get_reduction,
        "AUTO",
        field="reduction",
        label="Data reduction",
        form="main",
        tip="Interpolate with some of the boundary nodes, as many as the tolerance needs, and "
        "correct the rest: for meshes whose boundary has more than some thousand nodes. Automatic: "
        "where it has.",
        method="rbf",
    ),
    greedy(
        "DATA_RED_TOLERANCE",
        real(0.0),
        "tolerance",
        "Largest error left before the boundary is corrected, over all steps, in the mesh's unit.",
        label="Tolerance",
        form="main",
        tip="The largest error at the boundary that the control nodes may leave to the "
        "correction, in the mesh's length unit.",
        run_label="",
        idle_reason=why_no_tolerance,
    ),
    greedy(
        "DATA_RED_RELATIVE",
        real(0.0),
        "relative",
        "The tolerance as a part of the mesh's largest extent, instead of DATA_RED_TOLERANCE.",
        label="a relative tolerance of a case file,",
        run_label="",
        idle_reason=why_no_tolerance,
    ),
    greedy(
        "MULTILEVEL",
        YES_NO,
        "multilevel",
        "Select the control nodes in levels.",
        label="Levels",
        form="more",
        tip="Whether data reduction selects in levels, each on what the ones before left, and "
        "what ends a level.",
        run_label="",
    ),
    greedy(
        "MULTI_CRIT",
        one_of(LEVEL_CRITERIA),
        "criterion",
        "What ends a level: its number of nodes, or the fall of its error.",
        run_label="levels by {}",
        idle_reason=why_no_levels,
    ),
    greedy(
        "LVL_TOL_CRIT",
        real(0.0, 1.0),
        "level_tolerance",
        "Fall of the error that ends a level.",
        run_label="a level ends at {}",
        idle_reason=why_no_levels,
    ),
    greedy(
        "LVL_SIZE",
        whole(1),
        "level_size",
        "Number of control nodes of a level.",
        label="A level ends at",
        form="more",
        tip="Number of control nodes of a level, or the part of its error at which it ends.",
        idle_reason=why_no_levels,
    ),
    Key(
        "DOUBLE_EDGE",
        REDUCTION,
        YES_NO,
        "Select two nodes at a time, with opposite errors (YES), or one (NO); SELECTION says it "
        "better.",
        put_double_edge,
        lambda _: None,
    ),
    greedy(
        "SELECTION",
        one_of(SELECTIONS),
        "selection",
        "Nodes taken in a cycle: a growing block (fastest), two with opposite errors, or one.",
        label="Selection",
        form="more",
        tip="How many control nodes data reduction takes in a cycle: a growing block (fastest), "
        "two with opposite errors, or the one with the largest error.",
    ),
    greedy(
        "MAX_CONTROL_NODES",
        whole(1),
        "max_nodes",
        "Stop at so many control nodes in any case.",
        run_label="",
    ),
    greedy(
        "GAMMA",
        real(0.0),
        "gamma",
        "Radius of the correction over the largest error.",
        label="Correction radius ×",
        form="more",
        tip="How far the last correction of the boundary reaches, as a multiple of the largest "
        "error that the control nodes leave.",
    ),
)
