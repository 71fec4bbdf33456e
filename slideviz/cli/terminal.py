r"""Output to the terminal, in which control characters are escaped, as ``\x1b``.

Names of boundaries and files, and messages of libraries, may have control characters, which would
clear the screen, change its colors or imitate another line.
"""

from __future__ import annotations

import os
import sys
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from contextvars import ContextVar
from typing import Any, TextIO

from slideviz.errors import SlidevizError

DONE = 0
WRONG_INPUT = 1  # the mesh or the case is wrong
INVERTED = 3  # done, but cells are inverted
LIMIT_MISSED = 4  # done, without inverted cells, but a limit of the case is not met
CANCELLED = 130


_SIMPLER = str.maketrans({"█": "#", "▏": "|", "…": "...", "’": "'", "“": '"', "”": '"'})
"""Replacements for characters that the encoding of the terminal does not have."""


class Terminal:
    r"""A stream that escapes control characters, as ``\x1b``, and others that it cannot encode.

    ``stream``: the stream that is written to. ``needed``: whether it is an error if it cannot be
    written to; else the output is dropped.
    """

    def __init__(self, stream: TextIO, needed: bool) -> None:
        self._stream = stream
        self._needed = needed

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text, control characters escaped; return its length."""
        self.control(plain(text))
        return len(text)

    def control(self, text: str) -> None:
        """Write text as it is, with its control characters."""
        with self._reporting_failure():
            self._stream.write(_encodable(text, self._stream.encoding or "utf-8"))

    def flush(self) -> None:
        """Send all text that was written."""
        with self._reporting_failure():
            self._stream.flush()

    @contextmanager
    def _reporting_failure(self) -> Iterator[None]:
        try:
            yield
        except OSError as problem:
            # Else the buffer would be written once more, in vain, when the program ends.
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
            if not self._needed:
                return
            if isinstance(problem, BrokenPipeError):
                raise
            raise SlidevizError(
                f"the standard output cannot be written: {problem.strerror}"
            ) from problem


def plain(text: str) -> str:
    """Return a text with its control characters escaped, but for line breaks and tabs."""
    if text.isprintable():
        return text
    return "".join(sign if _is_plain(sign) else _shown(sign) for sign in text)


def _is_plain(sign: str) -> bool:
    # Other kinds of spaces count as not printable.
    return sign.isprintable() or sign in "\n\t" or unicodedata.category(sign) == "Zs"


def _shown(sign: str) -> str:
    return sign.encode("unicode_escape").decode("ascii")


def _encodable(text: str, encoding: str) -> str:
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        simpler = text.translate(_SIMPLER)
        return simpler.encode(encoding, "backslashreplace").decode(encoding)
    return text


@contextmanager
def terminal_streams() -> Iterator[None]:
    """Context in which stdout and stderr are each a `Terminal`."""
    out = Terminal(sys.stdout, needed=True)
    err = Terminal(sys.stderr, needed=False)
    with redirect_stdout(out), redirect_stderr(err):
        yield


def control(text: str) -> None:
    """Write text with control sequences, such as a progress bar, to stderr."""
    getattr(sys.stderr, "control", sys.stderr.write)(text)
    sys.stderr.flush()


_HELD: ContextVar[list[tuple[str, str]] | None] = ContextVar("held", default=None)
"""What `say` is to print later; None where it prints at once."""


def say(what: str, text: str) -> None:
    """Print a text to stderr as a ``what`` (note or warning); nothing where one is empty."""
    held = _HELD.get()
    if held is not None:
        held.append((what, text))
    elif what and text:
        print(f"slideviz: {what}: {text}", file=sys.stderr, flush=True)


@contextmanager
def holding() -> Iterator[Callable[..., None]]:
    """Context that delays the texts of `say` until its end, or until its function is called.

    If an error ends the context before, only the error is printed.
    """
    held: list[tuple[str, str]] = []
    token = _HELD.set(held)

    def release() -> None:
        if _HELD.get() is held:
            _HELD.reset(token)
            for what, text in held:
                say(what, text)

    try:
        yield release
        release()
    finally:
        if _HELD.get() is held:
            _HELD.reset(token)
