"""Results that are kept as long as what they were computed from."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

P = ParamSpec("P")
R = TypeVar("R")


class WeakCache:
    """Results by what they were computed from, as long as it lives, and a further key.

    Neither the key nor the result may keep that alive: it would never be freed.
    """

    def __init__(self) -> None:
        self._results: WeakKeyDictionary[Any, dict[object, Any]] = WeakKeyDictionary()

    def has(self, source: object, key: object) -> bool:
        """Return whether there is a result."""
        return key in self._results.get(source, {})

    def of(self, source: object, key: object, make: Callable[[], R]) -> R:
        """Return the result, made only the first time."""
        results = self._results.setdefault(source, {})
        if key not in results:
            results[key] = make()
        made: R = results[key]
        return made


def weak_cache(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function to keep its results in a `WeakCache`, by the first argument.

    The other arguments are hashed.
    """
    cache = WeakCache()

    @wraps(function)
    def cached(*args: P.args, **kwargs: P.kwargs) -> R:
        key = (*args[1:], *kwargs.items())
        return cache.of(args[0], key, lambda: function(*args, **kwargs))

    return cached
