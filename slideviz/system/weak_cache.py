"""Results that are kept as long as what they were computed from."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

P = ParamSpec("P")
R = TypeVar("R")


def weak_cache(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function to keep its results as long as the first argument lives.

    The other arguments are hashed. Neither they nor the result may keep the first one alive: it
    would never be freed.
    """
    results: WeakKeyDictionary[Any, dict[tuple[Any, ...], R]] = WeakKeyDictionary()

    @wraps(function)
    def cached(*args: P.args, **kwargs: P.kwargs) -> R:
        of_first = results.setdefault(args[0], {})
        key = (*args[1:], *kwargs.items())
        if key not in of_first:
            of_first[key] = function(*args, **kwargs)
        return of_first[key]

    return cached
