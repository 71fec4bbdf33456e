"""The table of all kinds of motions; a new kind is a row here."""

from __future__ import annotations

from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne, OnAirfoil
from slideviz.case.motions.box import BoxMotion, Ffd, FfdCamber, FfdThickness, FfdTwist
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import Motion
from slideviz.case.motions.onto import Onto
from slideviz.case.motions.rigid import Radial, Rotate, Scale, Translate
from slideviz.case.motions.span import SpanMotion

KINDS: tuple[type[Motion], ...] = (
    Translate,
    Rotate,
    Scale,
    Radial,
    HicksHenne,
    Cst,
    Bump,
    Ffd,
    FfdCamber,
    FfdThickness,
    FfdTwist,
    SpanMotion,
    FromFile,
    Onto,
)
"""The kinds that a case file or the window can have, in the order of the lists."""

KIND_OF: dict[str, type[Motion]] = {verb: kind for kind in KINDS for verb in kind.verbs}
"""The kind of each verb of ``MOTION``."""

IN_ZONES: tuple[type[Motion], ...] = (BoxMotion, OnAirfoil, SpanMotion)
"""Families whose displacements (`Motion.placed`) are those of each zone of a mesh."""

OF_MESH: tuple[type[Motion], ...] = (FromFile, Onto)
"""Families whose displacements are those of the whole mesh."""
