"""Words of the window for the keys of a case file, which messages about a case have."""

from __future__ import annotations

import re
from collections.abc import Mapping

METHOD_WORDS = {
    "rbf": "RBF interpolation",
    "idw": "Inverse distance weighting",
    "elastic": "Linear elasticity",
}
SLIDING_WORDS = {"none": "none", "ps": "pseudo sliding", "ds": "direct sliding"}
PERIODIC_WORDS = {
    "none": "none",
    "periodic": "periodic distance",
    "fixed": "periodic, fixed vertices",
    "moving": "periodic, moving vertices",
}
TYPE_WORDS = {"auto": "automatic", "translational": "translational", "rotational": "rotational"}
SWITCH_WORDS = {"YES": "on", "NO": "off"}

FIELDS: dict[str, tuple[str, Mapping[str, str]]] = {
    "METHOD": ("Method", METHOD_WORDS),
    "SLIDING_MODE": ("Sliding", SLIDING_WORDS),
    "PERIODIC_MODE": ("Periodicity", PERIODIC_WORDS),
    "PERIODIC_TYPE": ("Type", TYPE_WORDS),
    "PERIODIC_AXIS": ("Axis", {}),
    "PERIODIC_ORIGIN": ("Through", {}),
    "STEPS": ("Steps", {"auto": "automatic"}),
    "DATA_REDUCTION": ("Data reduction", SWITCH_WORDS),
    "DATA_RED_TOLERANCE": ("Tolerance", {}),
    "DATA_RED_RELATIVE": ("a relative tolerance of a case file,", {}),
    "INFLUENCE_FACTOR": ("Support radius ×", {}),
    "RBF_KERNEL": ("Kernel", {}),
    "FEATURE_ANGLE": ("Feature angle", {}),
    "MARKER_MOVING": ("the role “moving”", {}),
    "MARKER_FIXED": ("the role “fixed”", {}),
    "MARKER_SLIDING": ("the role “sliding”", {}),
    "MARKER_PERIODIC": ("the role “periodic”", {}),
    "MARKER_INTERNAL": ("the role “internal”", {}),
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
