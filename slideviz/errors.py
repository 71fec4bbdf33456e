"""Every error that slideviz raises on purpose.

A message has the value, the rule and the remedy, and where there is one the place
(``file:line:``), so that the command line and the window can show it as it is.
"""

from __future__ import annotations


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


class Cancelled(SlidevizError):
    """The one who pulls the work asked it to stop; nothing is wrong."""


class Note(str):
    """A sentence about a run that is worth knowing but harmless: nothing need be changed.

    It stands among the warnings of a step; a window can put it where it is in nobody's way.
    """

    __slots__ = ()
