"""Every error that slideviz raises on purpose.

A message has the wrong value, the rule and the remedy, and for a file its place (``file:line:``).
The command line and the window show it as it is.
"""

from __future__ import annotations

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


def printable(path: str | Path) -> str:
    """Return a path as text for a message; bytes that are no UTF-8 become escape sequences."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def path_error(path: Path, message: str) -> MeshError:
    """Return the error ``path: message``."""
    return MeshError(f"{printable(path)}: {message}")
