"""The types of arguments, checked by their annotations where a program calls slideviz.

``check_types`` is a decorator for functions, ``check_fields`` the ``__post_init__`` of dataclasses.
A check takes microseconds: neither belongs into inner loops. ``frozen`` is the decorator of values,
``record`` that of values with arrays.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set, Sized
from contextlib import suppress
from dataclasses import dataclass, field
from dataclasses import fields as dataclass_fields
from functools import cache, wraps
from inspect import get_annotations
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NamedTuple,
    ParamSpec,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
)

import numpy as np
from numpy.typing import ArrayLike

from slideviz.errors import ArgumentError, CaseError, not_one_of

P = ParamSpec("P")
Result = TypeVar("Result")

_WORDS = {
    "Any": "value",
    "Callable": "a function",
    "Case": "a Case from slideviz.Case.read",
    "Executor": "an executor of concurrent.futures",
    "Mesh": "a Mesh from slideviz.read",
    "Motion": "a motion, e.g. Translate(...)",
    "NoneType": "None",
    "Path": "the name of a file",
    "bool": "True or False",
    "float": "a number",
    "int": "a whole number",
    "str": "a text",
}
_SEVERAL = {
    "a number": "numbers",
    "a text": "texts",
    "a whole number": "whole numbers",
    "an array of numbers": "arrays of numbers",
    "value": "values",
}
_SHORT = 60  # largest length of a value that a message shows


class _Misfit(NamedTuple):
    """A value, its place, e.g. ``vector[1]``, and the type that it should have."""

    place: str
    value: object
    needed: Any


def origin_of(hint: Any) -> Any:
    """Return the class of a type with arguments, such as tuple or np.ndarray; None of others.

    From NumPy 2.5 on, ``NDArray`` is an alias, whose value is an array's type.
    """
    origin = get_origin(hint)
    return get_origin(getattr(origin or hint, "__value__", None)) or origin


def check_types(function: Callable[P, Result]) -> Callable[P, Result]:
    """Return a function with a check of its arguments by their annotations.

    NumPy's numbers are numbers, whole ones fit where others are needed, and any sequence or array
    fits a tuple. The function raises ArgumentError for arguments of other types. It checks neither
    arguments without annotation, nor which text it is of several in a ``Literal``.
    """
    code = function.__code__
    defaults = function.__defaults__ or ()
    names = code.co_varnames[: code.co_argcount]
    needed = [name for name in names[: len(names) - len(defaults)] if name not in ("self", "cls")]
    called = f"{function.__qualname__.removesuffix('.__init__')}({', '.join(needed)})"

    @wraps(function)
    def call(*given: P.args, **named: P.kwargs) -> Result:
        _require(called, function, (*zip(names, given, strict=False), *named.items()))
        return function(*given, **named)

    return call


def check_fields(value: Any) -> None:
    """Raise ArgumentError if a field of a dataclass does not fit its annotation; see `check_types`.

    Lists and arrays are converted to tuples if the annotation is a tuple. A field with metadata is
    an enumeration with these terms; its default is always allowed. Raises CaseError if an
    enumeration has another value.
    """
    kind: Any = type(value)
    fields = {field.name: field for field in dataclass_fields(value)}
    hints = annotations_of(kind)
    given = [
        (name, field)
        for name in fields
        if (field := getattr(value, name)) is not fields[name].default and not fields[name].metadata
    ]
    _require(kind.__name__, kind, given)
    for name, field in given:
        if isinstance(field, list | np.ndarray) and origin_of(hints[name]) is not np.ndarray:
            object.__setattr__(value, name, _plain(field))
    for name, field in fields.items():
        chosen = getattr(value, name)
        known = field.metadata
        if known and chosen not in (*known, field.default):
            raise CaseError(f"{name}: {not_one_of(chosen, known)}")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(kind: type[Result]) -> type[Result]:
    """Return a class as a frozen dataclass whose values are equal where their fields are."""
    return dataclass(frozen=True)(kind)


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def record(kind: type[Result]) -> type[Result]:
    """Return a class as a frozen dataclass whose values are equal only to themselves.

    Values with arrays are such: arrays have no single answer to ``==``, and a value is a key of the
    caches of what was computed from it (`slideviz.system.weak_cache`).
    """
    return dataclass(frozen=True, eq=False)(kind)


class CheckedFields:
    """A dataclass that checks its fields when it is made (`check_fields`)."""

    def __post_init__(self) -> None:
        check_fields(self)


def _plain(value: Any) -> Any:
    """Return a list or an array as a tuple of Python values, and what else is in it unchanged."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    return tuple(_plain(each) for each in value) if isinstance(value, list | tuple) else value


def _require(called: str, owner: object, given: Iterable[tuple[str, object]]) -> None:
    needed = annotations_of(owner)
    for name, value in given:
        wrong = _misfit(value, needed.get(name, Any), name)
        if wrong is not None:
            value_words = _value_words(wrong.value)
            type_words = _type_words(wrong.needed)
            raise ArgumentError(f"{called}: {wrong.place} is {value_words}; expected {type_words}")


@cache
def annotations_of(owner: Any) -> dict[str, Any]:
    """Return the annotations of a function or class, without those that only mypy can know."""
    hints = {}
    for each in reversed(getattr(owner, "__mro__", (owner,))):
        scope = vars(sys.modules[each.__module__])
        for name, text in get_annotations(each).items():
            with suppress(NameError):
                hints[name] = eval(text, scope)
    return hints


def _members(hint: Any) -> tuple[Any, ...]:
    is_union = origin_of(hint) in (Union, UnionType) and hint != ArrayLike
    return get_args(hint) if is_union else (hint,)


def _misfit(value: object, hint: Any, place: str) -> _Misfit | None:
    """Return what is not of a type: the value, or a value in it; None where it fits."""
    if hint is Any or hint is type(value):
        return None
    inner = get_args(hint)
    if origin_of(hint) is Annotated:
        wrong = _misfit(value, inner[0], place)
        return wrong and (wrong._replace(needed=hint) if wrong.place == place else wrong)
    members = _members(hint)
    if len(members) > 1:
        misfits = [_misfit(value, member, place) for member in members]
        if None in misfits:
            return None
        within = [wrong for wrong in misfits if wrong is not None and wrong.place != place]
        return within[0] if len(within) == 1 else _Misfit(place, value, hint)
    if not _fits(value, hint, origin_of(hint) or hint, inner):
        return _Misfit(place, value, hint)
    return next((wrong for part in _parts(value, hint, place) if (wrong := _misfit(*part))), None)


def _fits(value: Any, hint: Any, kind: Any, inner: tuple[Any, ...]) -> bool:
    """Return whether a value is of a type that is not a union, whatever is in it."""
    if hint is ArrayLike or kind is np.ndarray:
        return _is_numeric(value, whole=kind is np.ndarray and "int" in str(hint))
    if kind is Literal:
        # Which of several texts it is has better words where the text is used.
        return isinstance(value, str) and (value in inner or len(inner) > 1)
    if kind in (int, float):
        number = Integral if kind is int else Real
        is_array = getattr(value, "ndim", None) == 0 and _is_numeric(value, whole=kind is int)
        return (isinstance(value, number) and not isinstance(value, bool)) or is_array
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind is Path:
        return isinstance(value, str | PathLike)
    if kind is tuple:
        has_length = _is_series(value) and isinstance(value, Sized)
        return has_length and (Ellipsis in inner or len(value) == len(inner))
    return _is_series(value) if kind is Sequence else isinstance(value, kind)


def _is_series(value: object) -> bool:
    unordered = str | bytes | Mapping | Set
    has_items = isinstance(value, Iterable) and getattr(value, "ndim", 1) != 0
    return has_items and not isinstance(value, unordered)


def _is_numeric(value: object, *, whole: bool) -> bool:
    """Return whether NumPy converts a value to numbers; ``whole`` requires integers."""
    try:
        array = np.asarray(value)
        array = np.asarray(array, np.float64) if array.dtype == object else array
    except (TypeError, ValueError):
        return False
    return not array.size or array.dtype.kind in ("iu" if whole else "biuf")


def _parts(value: Any, hint: Any, place: str) -> Iterator[tuple[object, Any, str]]:
    """Yield keys and values of a mapping, or values of a sequence, with their types and places."""
    kind = origin_of(hint)
    inner = get_args(hint)
    if kind is Mapping:
        yield from ((key, inner[0], f"a key of {place}") for key in value)
        yield from ((each, inner[1], f"{place}[{key!r}]") for key, each in value.items())
    elif kind in (tuple, Sequence) and hasattr(value, "__len__"):
        fixed = kind is tuple and Ellipsis not in inner
        for at, each in enumerate(value):
            yield each, inner[at if fixed else 0], f"{place}[{at}]"


def _value_words(value: object) -> str:
    plain = isinstance(value, str | int | float | list | tuple | dict | None)
    is_short = plain and len(repr(value)) <= _SHORT
    return repr(value) if is_short else f"of type {type(value).__name__}"


def _type_words(hint: Any) -> str:
    kind = origin_of(hint) or hint
    inner = get_args(hint)
    if kind is Annotated:
        return str(inner[1])
    if hint is ArrayLike or kind is np.ndarray:
        return "an array of whole numbers" if "int" in str(hint) else "an array of numbers"
    if kind is Literal:
        return " or ".join(map(repr, inner))
    if len(members := _members(hint)) > 1:
        named = [one for one in members if one is not str or Path not in members]
        *rest, last = map(_type_words, named)
        return f"{', '.join(rest)}, or {last}" if rest else last
    if kind not in (tuple, Sequence, Mapping):
        return _WORDS.get(kind.__name__, kind.__name__)
    fixed = kind is tuple and Ellipsis not in inner
    number = f"{len(inner)} " if fixed else f"a {kind.__name__.lower()} of "
    each = _type_words(inner[kind is Mapping])
    to = "names to " if kind is Mapping else ""
    return number + to + _SEVERAL.get(each, f"values, each {each}")
