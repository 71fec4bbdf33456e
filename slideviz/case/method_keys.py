"""Keys of a case file about the method: how nodes slide, how inner nodes follow, how many steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from slideviz.case.key import METHOD, setting
from slideviz.case.model import Case
from slideviz.case.values import MAX_STEPS, YES_NO, Kind, one_of, real, whole
from slideviz.errors import CaseError
from slideviz.terms import KERNELS, METHODS, SLIDING, names

_WAYS = " or ".join(f"{name} ({way})" for way, name in names(SLIDING).items() if way != "none")
FACTORS = 1e-6, 1e6
"""Limits of the support radius over the extent of the mesh."""


def nothing_slides(case: Case) -> str:
    """Return why SLIDING_MODE has no effect in a case; "" where some boundary may slide."""
    slides = {"sliding", "periodic", "internal"}.intersection(case.roles.values())
    return "" if slides else "no boundary has the role “sliding” or “periodic”"


def or_auto(kind: Kind, word: str) -> Kind:
    """Return the kind of the values of ``kind``, which are numbers, or ``word``: 0 in the case."""
    nothing = 0 if kind.entry == "whole" else 0.0

    def read(text: str) -> Any:
        if text.lower() == word.lower():
            return nothing
        try:
            return kind.read(text)
        except CaseError as problem:
            raise CaseError(f"{problem}, or {word}") from None

    return replace(
        kind,
        allowed=f"{kind.allowed}, or {word}",
        read=read,
        write=lambda value: kind.write(value) if value else word,
        words={nothing: "automatic"},
    )


def automatic_radius(case: Case) -> bool:
    """Return whether the support radius of a case is found from its motion."""
    return case.method == "rbf" and case.support_radius is None and not case.influence_factor


def put_factor(case: Case, factor: float) -> Case:
    """Return the case with a support radius that is a multiple of the extent; 0: automatic."""
    return case.change(influence_factor=factor, support_radius=None)


METHOD_ROWS = (
    setting(
        "METHOD",
        METHOD,
        one_of(METHODS),
        "method",
        "Radial basis functions, or to compare with them: inverse distance weighting, or linear "
        "elasticity with cells that are the stiffer the smaller they are (as SU2 by default). "
        "With both, ps and ds do the same, and kernel, radius and data reduction nothing.",
        label="Method",
        form="main",
        tip="How the inner nodes follow: by radial basis functions, or to compare with them, as "
        "means weighted with the inverse distance to the boundary, or as an elastic body whose "
        "cells are the stiffer the smaller they are (as SU2 deforms by default).",
        run_label="",
    ),
    setting(
        "SLIDING_MODE",
        METHOD,
        one_of(SLIDING),
        "sliding",
        f"How nodes slide: not, {_WAYS}.",
        label="Sliding",
        form="main",
        tip="Whether the nodes of sliding boundaries stay (none), slide and are put back on the "
        "boundary in stages (pseudo), or slide as part of the system itself (direct).",
        run_label="",
        idle_reason=nothing_slides,
    ),
    setting(
        "STEPS",
        METHOD,
        replace(or_auto(whole(1), "auto"), span=(0, MAX_STEPS)),
        "steps",
        "Steps in which the deformation is applied; auto tries 1, 2, 3, 5, 8, 13, 21 and 34, "
        "halves steps that fold a cell, and takes the fewest that are enough.",
        label="Steps",
        form="main",
        tip="Into how many equal parts the motion is divided: more keep large motions valid and "
        "take longer; automatic (0) takes as few as give no inverted cell.",
        run_label="",
    ),
    setting(
        "STEPS_GAIN",
        METHOD,
        real(0.0, 1.0),
        "steps_gain",
        "With STEPS= auto, enough is when more steps raise the minimum quality by less than "
        "this part.",
        run_label="gain {}",
    ),
    replace(
        setting(
            "INFLUENCE_FACTOR",
            METHOD,
            or_auto(real(*FACTORS), "AUTO"),
            "influence_factor",
            "Support radius of the radial function over the largest extent of the mesh. AUTO: 15 "
            "times the largest extent of a connected moving body, or 20 times the largest "
            "displacement where that is more, and 2.5 extents of the mesh at most.",
            label="Radius × extent",
            form="more",
            tip="Support radius: how far a boundary node reaches into the mesh, as a multiple of "
            "the mesh's largest extent. Automatic: as far as the motion needs.",
            run_label="radius × {}",
            method="rbf",
        ),
        put=put_factor,
    ),
    setting(
        "SUPPORT_RADIUS",
        METHOD,
        real(0.0),
        "support_radius",
        "Support radius in the mesh's length unit, instead of INFLUENCE_FACTOR.",
        label="Support radius as a length",
        run_label="radius {}",
        method="rbf",
    ),
    setting(
        "RBF_KERNEL",
        METHOD,
        replace(
            one_of(KERNELS),
            allowed="one of the names below",
            details=tuple(f"{name:<22}{kernel.label}" for name, kernel in KERNELS.items()),
            words=names(KERNELS),
        ),
        "kernel",
        "The radial function; those without compact support need a smaller INFLUENCE_FACTOR.",
        label="Kernel",
        form="more",
        tip="The radial function; a global one reaches through the whole mesh whatever the "
        "radius, and wants a smaller support radius.",
        run_label="{}",
        method="rbf",
    ),
    setting(
        "IDW_POWER",
        METHOD,
        real(0.0, 20.0, closed=True),
        "idw_power",
        "With METHOD= idw, the power of the inverse distance; the number of dimensions if not "
        "given.",
        run_label="power {}",
        method="idw",
    ),
    setting(
        "IDW_FIXED_WEIGHT",
        METHOD,
        real(1e-12, 1e12),
        "idw_fixed_weight",
        "With METHOD= idw, what a boundary node that stays counts, where one that moves counts 1.",
        run_label="fixed weight {}",
        method="idw",
    ),
    setting(
        "CURVED",
        METHOD,
        YES_NO,
        "curved",
        "Without effect: curved boundaries, RBF-SliDe's switch, are found and followed anyway.",
        run_label="",
        no_effect="curved boundaries are found and followed anyway",
    ),
    setting(
        "FEATURE_ANGLE",
        METHOD,
        real(0.0, 180.0, closed=True),
        "feature_angle_deg",
        "Angle in degrees from which a bend within a boundary is an edge.",
        label="Feature angle",
        unit="°",
        form="more",
        tip="A boundary that turns by more than this angle has an edge there, which sliding nodes "
        "do not cross.",
    ),
)
