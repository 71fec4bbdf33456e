"""Messages about a case with the window's words for the keys of a case file."""

from __future__ import annotations

import re

from slideviz.case.keys import KEYS

_LABELLED = sorted((name for name, key in KEYS.items() if key.label), key=len, reverse=True)
# A key, and its value where one follows; of a file, "DATA_REDUCTION= YES" is one thing.
_KEY = re.compile(rf"\b({'|'.join(_LABELLED)})\b(?:=(?:\s?([\w.+-]*\w))?)?")


def in_window_words(text: str) -> str:
    """Return a message with the window's words instead of the keys of a case file."""
    return _KEY.sub(_words, text)


def _words(found: re.Match[str]) -> str:
    key = KEYS[found[1]]
    return key.label if found[2] is None else f"{key.label} “{key.kind.called(found[2])}”"
