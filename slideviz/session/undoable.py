"""The decorator of changes that can be undone, which has their words in the menu."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

Change = TypeVar("Change", bound=Callable[..., Any])
Words = str | Callable[[Mapping[str, Any]], str | None]

_WORDS: dict[Callable[..., Any], Words] = {}


def undoable(words: Words) -> Callable[[Change], Change]:
    """Return a decorator that lets `slideviz.session.store.Store` undo a change.

    Parameters
    ----------
    words : str or callable
        The words after "Undo" in the menu; or a function that returns them for the change's
        keyword arguments, or None if such a change is not to be undone.
    """

    def mark(change: Change) -> Change:
        _WORDS[change] = words
        return change

    return mark


def undo_words(change: Callable[..., Any], named: Mapping[str, Any]) -> str | None:
    """Return the words in the menu for a change with keyword arguments ``named``; None: no undo."""
    words = _WORDS.get(change)
    return words if words is None or isinstance(words, str) else words(named)
