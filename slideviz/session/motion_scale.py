"""Motions that go farther or less far, and how far one goes compared with another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from slideviz.case.motions.motion import Motion
from slideviz.mesh.model import FloatArray

DIGITS = 10  # significant digits of a scaled value


def can_scale(motions: Sequence[Motion]) -> bool:
    """Return whether motions can be scaled: displacements in files cannot."""
    return not any(motion.lists_nodes for motion in motions)


def scaled(motions: Sequence[Motion], part: float) -> tuple[Motion, ...] | None:
    """Return motions that go ``part`` times as far; None where not all can (`can_scale`)."""
    if not can_scale(motions):
        return None
    changed = ({k: _times(v, part, rest) for k, v, rest in motion.amounts()} for motion in motions)
    return tuple(replace(motion, **new) for motion, new in zip(motions, changed, strict=True))


def moves_nothing(motion: Motion) -> bool:
    """Return whether a motion leaves its boundary in place; False for displacement files."""
    far = [one for _, value, rest in motion.amounts() for one in _list(value, rest)]
    return bool(far) and not any(far)


def factor_of(motions: Sequence[Motion], others: Sequence[Motion]) -> float | None:
    """Return the common scale factor of two motion lists; None if they differ in more."""
    at_rest = scaled(motions, 0.0)
    if at_rest is None or at_rest != scaled(others, 0.0):
        return None
    now = _amounts(motions)
    before = _amounts(others)
    if now.shape != before.shape or not before.any():
        return None
    factor = float(now @ before / (before @ before))
    alike = np.abs(now - factor * before).max() <= 1e-6 * np.abs(now).max()
    return factor if alike and factor > 0 else None


def _amounts(motions: Sequence[Motion]) -> FloatArray:
    amounts = [amount for motion in motions for amount in motion.amounts()]
    return np.array([number for _, value, rest in amounts for number in _list(value, rest)])


def _list(value: Any, rest: float) -> list[float]:
    return [one - rest for one in (value if isinstance(value, tuple) else (value,))]


def _times(value: Any, part: float, rest: float) -> Any:
    found = tuple(float(f"{rest + part * one:.{DIGITS}g}") for one in _list(value, rest))
    return found if isinstance(value, tuple) else found[0]
