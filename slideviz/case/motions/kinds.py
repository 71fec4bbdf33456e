"""The table of all kinds of motions; a new kind is a row here."""

from __future__ import annotations

from slideviz.case.motions.airfoil import Bump, Cst, HicksHenne
from slideviz.case.motions.box import Ffd, FfdCamber, FfdThickness, FfdTwist
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


def _family(kind: type[Motion]) -> type[Motion]:
    """Return the class whose `Motion.placed` serves a kind; a kind that takes time is alone."""
    return kind if kind.takes_time else next(c for c in kind.__mro__ if "placed" in vars(c))


FAMILIES: tuple[type[Motion], ...] = tuple(dict.fromkeys(map(_family, KINDS)))
"""Classes of kinds whose displacements (`Motion.placed`) are found together."""
