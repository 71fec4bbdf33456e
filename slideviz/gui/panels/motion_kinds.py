"""The kinds of motions: their words, and one of each that does not move anything yet."""

from __future__ import annotations

from pathlib import Path

from slideviz.case.model import FromFile, Motion, Radial, Rotate, Scale, Target, Translate
from slideviz.session.motions import Axis
from slideviz.terms import MOTION_KINDS

KINDS: dict[type, str] = {
    Translate: MOTION_KINDS["translate"].label,
    Rotate: MOTION_KINDS["rotate"].label,
    Scale: MOTION_KINDS["scale"].label,
    Radial: MOTION_KINDS["radial"].label,
    FromFile: MOTION_KINDS["file"].label,
}


def new_motion(kind: type, marker: Target, dim: int, machine: Axis | None = None) -> Motion:
    """Return a motion of that kind which does not move anything yet.

    Where the mesh repeats about an axis, what turns or is pushed does so about that axis.
    """
    axis, origin = machine or ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    if kind is Translate:
        return Translate(marker, (0.0,) * dim)
    if kind is Rotate:
        return Rotate(marker, 0.0, "centroid" if machine is None else origin[:dim], axis)
    if kind is Radial:
        return Radial(marker, 1.0, 0.0, axis, origin[:dim])
    if kind is Scale:
        return Scale(marker, (1.0,) * dim)
    return FromFile(Path(), marker)
