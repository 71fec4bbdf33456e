"""Every error that slideviz raises on purpose.

A message has the value, the rule and the remedy, and where there is one the place
(``file:line:``), so that the command line and the window can show it as it is.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from os import PathLike
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
Result = TypeVar("Result")
FILE = (str, PathLike)
"""The types of the name of a file."""
_NEEDED = {
    "Case": "a Case, as slideviz.Case.read returns it",
    "Mesh": "a Mesh, as slideviz.read returns it",
    "str": "the name of a file",
    "Executor": "an executor of concurrent.futures",
}


class SlidevizError(Exception):
    """Something that the user can put right: the message says what and how."""


class MeshError(SlidevizError):
    """The mesh file, or the mesh, cannot be used."""


class CaseError(SlidevizError):
    """What is asked of the mesh is wrong: case file, role, motion or displacement file."""


class DeformError(SlidevizError):
    """The mesh and the case are sound, but the deformation cannot be computed."""


class NodeError(DeformError):
    """Some nodes stand in the way; ``sentence`` has a ``{}`` for the number of each."""

    def __init__(self, sentence: str, *nodes: int) -> None:
        super().__init__(sentence.format(*nodes))
        self.sentence, self.nodes = sentence, nodes


class UnsoundError(DeformError):
    """A step was computed, but its result cannot be right."""


class ToleranceWarning(UserWarning):
    """What was chosen for one displacement does not suffice for another."""


class ConditionWarning(UserWarning):
    """A system is so badly conditioned that derivatives, or points too, have few digits."""


class ArgumentError(SlidevizError, TypeError):
    """An argument is of another type than the function takes."""


class Cancelled(SlidevizError):
    """The one who pulls the work asked it to stop; nothing is wrong."""


class Note(str):
    """A sentence about a run that is worth knowing but harmless: nothing need be changed.

    It stands among the warnings of a step; a window can put it where it is in nobody's way.
    """

    __slots__ = ()


def takes(**kinds: type | tuple[type, ...]) -> Callable[[Callable[P, Result]], Callable[P, Result]]:
    """Return what makes a function raise ArgumentError where arguments are of other types.

    None may be given where it is the default.
    """

    def checked(function: Callable[P, Result]) -> Callable[P, Result]:
        wanted = inspect.signature(function).parameters
        called = f"{function.__qualname__.removesuffix('.__init__')}({', '.join(kinds)})"

        @wraps(function)
        def call(*given: P.args, **named: P.kwargs) -> Result:
            for name, value in (*zip(wanted, given, strict=False), *named.items()):
                kind = kinds.get(name, object)
                if isinstance(value, kind) or (value is None and wanted[name].default is None):
                    continue
                raise ArgumentError(f"{called}: {name} is {_said(value)}; needed is {_words(kind)}")
            return function(*given, **named)

        return call

    return checked


def _said(value: object) -> str:
    """Return in words what was given: short things themselves, others by their type."""
    is_short = isinstance(value, str | int | float | None) and len(repr(value)) <= 60
    return repr(value) if is_short else f"of type {type(value).__name__}"


def _words(kind: type | tuple[type, ...]) -> str:
    return _NEEDED[(kind if isinstance(kind, type) else kind[0]).__name__]
