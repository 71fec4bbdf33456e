"""Every error that slideviz raises on purpose.

A message has the wrong value, the rule and the remedy, and for a file its place (``file:line:``).
The command line and the window show it as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

Level = Literal["warning", "note"]


@dataclass(frozen=True)
class Message:
    """A sentence for the user, printed as ``place: value rule; remedy``."""

    rule: str
    remedy: str = ""
    place: tuple[str | Path, ...] = ()  # from the outermost: a file, a zone, a motion, a key
    line: int = 0  # of the file, from 1; 0 for none
    value: str = ""  # in quotes; empty where the rule has it
    keys: tuple[str, ...] = ()  # of the case file, that it is about
    level: Level = "warning"  # a note is harmless and asks for no change

    def __str__(self) -> str:
        return self.printed(printable)

    def printed(self, file: Callable[[Path], str]) -> str:
        """Return the message with the names that ``file`` gives to files."""
        line = f":{self.line}" if self.line else ""
        places = (f"{file(one)}{line}" if isinstance(one, Path) else one for one in self.place)
        return ": ".join((*places, self.text))

    @property
    def text(self) -> str:
        """Return the message without its place."""
        sentence = f"{self.value} {self.rule}" if self.value else self.rule
        return f"{sentence}; {self.remedy}" if self.remedy else sentence


@dataclass(frozen=True)
class Doubt(Message):
    """A message that a motion hardly does what is meant: the likely cause of whatever else fails.

    Errors begin with it, and its remedy comes before others.
    """


Remark = str | Message  # a text is a message without a place


def note(text: str) -> Message:
    """Return a harmless message, which asks for no change."""
    return Message(text, level="note")


def doubts_of(remarks: Iterable[Remark]) -> tuple[Doubt, ...]:
    """Return those of some remarks that are doubts."""
    return tuple(one for one in remarks if isinstance(one, Doubt))


def messages_of(remarks: Iterable[Remark]) -> tuple[Message, ...]:
    """Return remarks as messages."""
    return tuple(Message(one) if isinstance(one, str) else one for one in remarks)


class SlidevizError(Exception):
    """An error that the user can correct, with a line for each message; the base of all others."""

    def __str__(self) -> str:
        return "\n".join(map(str, self.args))

    @property
    def messages(self) -> tuple[Message, ...]:
        """Return the messages, one for each mistake."""
        return messages_of(self.args)

    def within(self, *places: str | Path, line: int = 0) -> tuple[Message, ...]:
        """Return the messages with places around their own, and a line if it is not 0."""
        return tuple(
            replace(message, place=(*places, *message.place), line=line or message.line)
            for message in self.messages
        )


OUT_OF_MEMORY = "out of memory; use a coarser mesh or close other programs"


class MeshError(SlidevizError):
    """The mesh file, or the mesh, cannot be used."""


class CaseError(SlidevizError):
    """The case is wrong: its file, a role, a motion, a setting or a displacement file."""


def raise_all(problems: Iterable[Remark]) -> None:
    """Raise a CaseError of the problems, if there are any; equal ones count once."""
    if each := dict.fromkeys(problems):
        raise CaseError(*each)


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


def why_failed(problem: Exception, remedy: str) -> str:
    """Return why one of many runs has no result; ``remedy`` is one against too little memory."""
    if isinstance(problem, SlidevizError):
        return "; ".join(map(str, problem.messages))
    if isinstance(problem, MemoryError):
        return f"out of memory; a coarser mesh or {remedy}"
    return f"internal error ({type(problem).__name__}: {problem})"


def printable(path: str | Path) -> str:
    """Return a path as text for a message; bytes that are not UTF-8 become escape sequences."""
    return str(path).encode("utf-8", "backslashreplace").decode()


def path_error(path: Path, message: str) -> MeshError:
    """Return the error ``path: message``."""
    return MeshError(Message(message, place=(path,)))


ROUNDING = 1e-10  # ratio of a number to a scale below which it is a rounding error of zero


def point_words(point: Iterable[float], extent: float = 0.0, digits: int = 6) -> str:
    """Return coordinates as text, with ``digits`` significant digits.

    Those that are only rounding beside ``extent``, that of the mesh, or beside the largest of them,
    are 0.
    """
    values = tuple(point)
    least = ROUNDING * max(extent, *map(abs, values), 0.0)
    return ", ".join(f"{0.0 if abs(v) <= least else v:.{digits}g}" for v in values)


def shown(text: str) -> str:
    """Return the text in quotes for a message, cut to 60 characters."""
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


_SWITCHES = (
    ("yes", "on", "true", "keep", "slide"),
    ("no", "off", "false", "none", "free"),
)
"""Words that switch something on, and off."""


def not_one_of(value: object, known: Iterable[str]) -> str:
    """Return the message that a value is not one of the known ones, with the most similar one."""
    words = list(known)
    text = str(value)
    quoted = shown(value) if isinstance(value, str) else repr(value)
    meant = [
        word for alike in _SWITCHES if text.lower() in alike for word in words if word in alike
    ]
    close = f"; did you mean {meant[0]}?" if meant else nearest(text, words)
    return f"{quoted} is not one of {' | '.join(words)}{close}"


def most_similar(name: str, known: Iterable[str]) -> str:
    """Return the known name most similar to ``name``; "" if none is."""
    by_lower = {other.lower(): other for other in known}
    close = get_close_matches(name.lower(), list(by_lower), n=1, cutoff=0.6)
    return by_lower[close[0]] if close else ""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return ``; did you mean X?`` with the known name most similar to ``name``; "" if none is."""
    close = most_similar(name, known)
    return f"; did you mean {close}?" if close else ""
