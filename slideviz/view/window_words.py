"""Words of the window for the keys of a case file, which messages about a case have."""

from __future__ import annotations

import re
from collections.abc import Mapping

from slideviz.terms import METHODS, PERIODIC_MODES, PERIODIC_TYPES, ROLES, SLIDING, labels

SWITCH_WORDS = {"YES": "on", "NO": "off"}

FIELDS: dict[str, tuple[str, Mapping[str, str]]] = {
    "METHOD": ("Method", labels(METHODS)),
    "SLIDING_MODE": ("Sliding", labels(SLIDING)),
    "PERIODIC_MODE": ("Periodicity", labels(PERIODIC_MODES)),
    "PERIODIC_TYPE": ("Type", labels(PERIODIC_TYPES)),
    "PERIODIC_AXIS": ("Axis", {}),
    "PERIODIC_ORIGIN": ("Through", {}),
    "STEPS": ("Steps", {"auto": "automatic"}),
    "DATA_REDUCTION": ("Data reduction", SWITCH_WORDS),
    "DATA_RED_TOLERANCE": ("Tolerance", {}),
    "DATA_RED_RELATIVE": ("a relative tolerance of a case file,", {}),
    "INFLUENCE_FACTOR": ("Support radius ×", {}),
    "RBF_KERNEL": ("Kernel", {}),
    "FEATURE_ANGLE": ("Feature angle", {}),
    **{term.key: (f"the role “{term.label}”", {}) for term in ROLES.values()},
    "DEFORMATION_FILENAME": ("a displacement file", {}),
    "MOTION": ("Motion", {}),
}
"""By key: what the window calls it, and its values."""

# A key, and its value where one follows; of a file, "DATA_REDUCTION= YES" is one thing.
_KEY = re.compile(
    rf"\b({'|'.join(sorted(FIELDS, key=len, reverse=True))})\b(?:=(?:\s?([\w.+-]*\w))?)?"
)


def in_window_words(text: str) -> str:
    """Return a message with the window's words instead of the keys of a case file."""
    return _KEY.sub(_words, text)


def _words(found: re.Match[str]) -> str:
    title, values = FIELDS[found[1]]
    return title if found[2] is None else f"{title} “{values.get(found[2], found[2])}”"
