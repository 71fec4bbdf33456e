"""The decorator of changes that can be undone, with their words in the menu."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

Change = TypeVar("Change", bound=Callable[..., Any])
Words = str | Callable[[Mapping[str, Any]], str | None]

_WORDS: dict[Callable[..., Any], Words] = {}


def undoable(words: Words) -> Callable[[Change], Change]:
    """Return a decorator of changes that `slideviz.session.store.Store` undoes.

    Parameters
    ----------
    words : str or callable
        What stands after "Undo" in the menu, or what returns it for the named values; None where
        these are not undone.
    """

    def mark(change: Change) -> Change:
        _WORDS[change] = words
        return change

    return mark


def undo_words(change: Callable[..., Any], named: Mapping[str, Any]) -> str | None:
    """Return the words in the menu for a change with these named values; None: no undo."""
    words = _WORDS.get(change)
    return words if words is None or isinstance(words, str) else words(named)
