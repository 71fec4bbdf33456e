"""Every error that slideviz raises on purpose.

A message has the wrong value, the rule and the remedy, and for a file its place (``file:line:``).
The command line and the window show it as it is.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


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
        self.sentence = sentence
        self.nodes = nodes


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


def printable(path: str | Path) -> str:
    """Return a path as text for a message; bytes that are not UTF-8 become escape sequences."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def path_error(path: Path, message: str) -> MeshError:
    """Return the error ``path: message``."""
    return MeshError(f"{printable(path)}: {message}")


def shown(text: str) -> str:
    """Return the text in quotes for a message, cut to 60 characters."""
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def not_one_of(value: object, known: Iterable[str]) -> str:
    """Return the message that a value is not one of the known ones, with the most similar one."""
    words = list(known)
    quoted = shown(value) if isinstance(value, str) else repr(value)
    return f"{quoted} is not one of {' | '.join(words)}{nearest(str(value), words)}"


def nearest(name: str, known: Iterable[str]) -> str:
    """Return ``; did you mean X?`` with the known name most similar to ``name``; "" if none is."""
    by_lower = {other.lower(): other for other in known}
    close = get_close_matches(name.lower(), list(by_lower), n=1, cutoff=0.6)
    return f"; did you mean {by_lower[close[0]]}?" if close else ""
