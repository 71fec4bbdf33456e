"""Keys of SU2 about its deformation by radial functions (``DEFORM_KIND= RBF``, from 8.3 on)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from slideviz.case.lines import Entry
from slideviz.case.model import Case
from slideviz.case.reduction import Reduction
from slideviz.case.values import YES_NO, real, whole
from slideviz.case.words import not_one_of
from slideviz.errors import CaseError, Note
from slideviz.rbf.kernels import SHAPE

KERNELS = {
    "WENDLAND_C2": ("wendland-c2", 1.0),
    "GAUSSIAN": ("gaussian", 1.0),
    "THIN_PLATE_SPLINE": ("thin-plate", 1.0),
    "MULTI_QUADRIC": ("multiquadric", 1.0 / SHAPE),
    "INV_MULTI_QUADRIC": ("inverse-multiquadric", 1.0 / SHAPE),
}
"""For each function of SU2 ours, and its support radius over SU2's parameter."""
READ_ALWAYS = {
    "RBF_DATA_REDUCTION": YES_NO,
    "RBF_GREEDY_TOLERANCE": real(0.0),
    "RBF_GREEDY_CORRECTION_FACTOR": real(0.0),
}
READ_WITH_RBF = {"RADIAL_BASIS_FUNCTION_PARAMETER": real(0.0), "DEFORM_NONLINEAR_ITER": whole(1)}
"""Kinds of values; of keys that mean something else unless DEFORM_KIND is RBF."""
FUNCTION = "KIND_RADIAL_BASIS_FUNCTION"


def radial_keys(rows: Mapping[str, Entry]) -> set[str]:
    """Return the names of the keys that are read, given all of a configuration."""
    with_rbf = {FUNCTION, *READ_WITH_RBF} if _word(rows, "DEFORM_KIND") == "RBF" else set()
    return {"DEFORM_KIND", *READ_ALWAYS, *with_rbf}


def radial_settings(
    case: Case,
    rows: Mapping[str, Entry],
    note: Callable[[Entry, str], None],
    warnings: list[str],
) -> Case:
    """Return the case with SU2's settings of radial functions, where slideviz's own are not given.

    ``note`` takes a key with a wrong value, and a why about it.
    """
    kind = _word(rows, "DEFORM_KIND")
    if kind not in ("", "ELASTIC", "RBF"):
        note(rows["DEFORM_KIND"], not_one_of(kind, ("ELASTIC", "RBF")))
    if kind == "ELASTIC" and "METHOD" not in rows:
        why = "DEFORM_KIND= ELASTIC: radial functions move the mesh all the same; write METHOD="
        warnings.append(Note(f"{why} elastic for elasticity"))
    given: dict[str, Any] = {}
    for name, form in {**READ_ALWAYS, **(READ_WITH_RBF if kind == "RBF" else {})}.items():
        if name in rows:
            try:
                given[name] = form.read(rows[name].value)
            except CaseError as problem:
                note(rows[name], str(problem))
    if kind == "RBF":
        word = _word(rows, FUNCTION) or "WENDLAND_C2"
        if word not in KERNELS:
            note(rows[FUNCTION], not_one_of(word, KERNELS))
        kernel, factor = KERNELS.get(word, KERNELS["WENDLAND_C2"])
        case = case if "RBF_KERNEL" in rows else case.change(kernel=kernel)
        radius = given.get("RADIAL_BASIS_FUNCTION_PARAMETER")
        if radius and not {"SUPPORT_RADIUS", "INFLUENCE_FACTOR"} & {*rows}:
            case = case.change(support_radius=factor * radius)
        if "DEFORM_NONLINEAR_ITER" in given and "STEPS" not in rows:
            case = case.change(steps=given["DEFORM_NONLINEAR_ITER"])
    return _reduced(case, rows, given)


def _reduced(case: Case, rows: Mapping[str, Entry], given: Mapping[str, Any]) -> Case:
    """Return the case with SU2's greedy selection: one node at a time, the one farthest off."""
    names = {"RBF_GREEDY_TOLERANCE": "tolerance", "RBF_GREEDY_CORRECTION_FACTOR": "gamma"}
    values = {names[key]: value for key, value in given.items() if key in names}
    wanted = given.get("RBF_DATA_REDUCTION", True if values else None)
    if wanted is None or any(key.startswith("DATA_RED") for key in rows):
        return case
    return case.change(reduction=Reduction(selection="one", **values) if wanted else None)


def _word(rows: Mapping[str, Entry], key: str) -> str:
    return rows[key].value.upper() if key in rows else ""
