"""Output to the terminal, with control characters shown as text.

Names of boundaries and files, and what libraries say, may hold control characters, which would
clear the screen, change its colours or pretend to be another line.
"""

from __future__ import annotations

import os
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any, TextIO

from slideviz.errors import SlidevizError

_SIMPLER = str.maketrans({"█": "#", "▏": "|", "…": "...", "’": "'", "“": '"', "”": '"'})
"""What is shown where the encoding of the terminal has no such character."""


class Terminal:
    r"""A stream that shows control characters as ``\x1b``, and others it cannot encode likewise.

    Parameters
    ----------
    stream : file of text
        Where it goes.
    needed : bool
        Whether it is an error that it cannot be written to.
    """

    def __init__(self, stream: TextIO, needed: bool) -> None:
        self._stream = stream
        self._needed = needed

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write text; returns its length."""
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
            # What is left in it would be written again, in vain, when the program ends.
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
    """Return a text with its control characters shown; line breaks and tabs stay."""
    if text.isprintable():
        return text
    return "".join(sign if _is_plain(sign) else _shown(sign) for sign in text)


def _is_plain(sign: str) -> bool:
    # Spaces of other widths count as not printable.
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
def terminal() -> Iterator[None]:
    """Return a context in which all that is printed goes through `Terminal`."""
    out, err = Terminal(sys.stdout, needed=True), Terminal(sys.stderr, needed=False)
    with redirect_stdout(out), redirect_stderr(err):
        yield


def control(text: str) -> None:
    """Write text with control sequences, such as a progress bar, to stderr."""
    getattr(sys.stderr, "control", sys.stderr.write)(text)
    sys.stderr.flush()


def say(what: str, text: str) -> None:
    """Print a note or warning where errors go; nothing where the text is empty."""
    if text:
        print(f"slideviz: {what}: {text}", file=sys.stderr, flush=True)
