"""The one place where the session changes: holds it, and tells those who listen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from slideviz.view.state import Session

Listener = Callable[[Session, Session], None]


class Store:
    """The session of a window.

    Listeners are called with the old and the new session, in the order in which they came.
    A change made by a listener is told after the present one has been told to everybody, so
    that nobody hears of the newer one first.
    """

    def __init__(self, session: Session | None = None) -> None:
        self.session = session or Session()
        self._listeners: list[Listener] = []
        self._waiting: list[tuple[Session, Session]] = []

    def listen(self, listener: Listener) -> None:
        """Call ``listener(old, new)`` after each change from now on."""
        self._listeners.append(listener)

    def change(self, function: Callable[..., Session], *values: Any, **named: Any) -> None:
        """Replace the session by ``function(session, ...)`` and tell the listeners."""
        self.put(function(self.session, *values, **named))

    def put(self, session: Session) -> None:
        """Replace the session and tell the listeners; the same one again is no news."""
        if session is self.session:
            return
        self._waiting.append((self.session, session))
        self.session = session
        if len(self._waiting) > 1:
            return
        try:
            while self._waiting:
                for listener in self._listeners:
                    listener(*self._waiting[0])
                self._waiting.pop(0)
        finally:
            self._waiting.clear()
