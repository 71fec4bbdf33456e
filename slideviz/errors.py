"""Every error that slideviz raises on purpose.

A message has the wrong value, the rule and the remedy, and for a file its place (``file:line:``).
The command line and the window show it as it is.
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
    """An error that the user can correct; the base of all others."""


class MeshError(SlidevizError):
    """The mesh file, or the mesh, cannot be used."""


class CaseError(SlidevizError):
    """The case is wrong: its file, a role, a motion, a setting or a displacement file."""


class DeformError(SlidevizError):
    """The mesh and the case are sound, but the deformation cannot be computed."""


class NodeError(DeformError):
    """Some nodes make the deformation impossible.

    ``sentence`` is the message with a ``{}`` for the number of each of ``nodes``, so that nodes can
    be renumbered.
    """

    def __init__(self, sentence: str, *nodes: int) -> None:
        super().__init__(sentence.format(*nodes))
        self.sentence, self.nodes = sentence, nodes


class UnsoundError(DeformError):
    """A step was computed, but its result cannot be right."""


class ToleranceWarning(UserWarning):
    """Control nodes chosen for one displacement miss the tolerance for another (`Deformer`)."""


class ConditionWarning(UserWarning):
    """A system is so badly conditioned that derivatives, or points too, have few digits."""


class ArgumentError(SlidevizError, TypeError):
    """An argument is not of the type that the function needs."""


class Cancelled(SlidevizError):
    """The user stopped the work; nothing is wrong."""


class Note(str):
    """A harmless remark on a run, which asks for no change.

    It is a string among the warnings of a step; its type tells it from these.
    """

    __slots__ = ()


def takes(**kinds: type | tuple[type, ...]) -> Callable[[Callable[P, Result]], Callable[P, Result]]:
    """Return a decorator: the function raises ArgumentError for arguments of other types.

    Parameters
    ----------
    **kinds : type or tuple of type
        The types allowed for an argument, by its name; None is allowed where it is the default.
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
    """Return a wrong argument in words: its value if that is short, else its type."""
    is_short = isinstance(value, str | int | float | None) and len(repr(value)) <= 60
    return repr(value) if is_short else f"of type {type(value).__name__}"


def _words(kind: type | tuple[type, ...]) -> str:
    return _NEEDED[(kind if isinstance(kind, type) else kind[0]).__name__]
