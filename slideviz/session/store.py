"""The store: has the current session, replaces it on each change, calls listeners, and undoes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field, fields, is_dataclass, replace
from typing import Any

from slideviz.argument_types import frozen, record
from slideviz.case.model import Case
from slideviz.session.changes import (
    motion_words,
    remove_run,
    restore_run,
    set_view,
    show_run,
    undo_words,
)
from slideviz.session.state import Guess, Session, ViewState

Listener = Callable[[Session, Session], None]
Failed = Callable[[Exception], None]

MERGE_S = 1.0  # changes of one kind with less than so many seconds between them are undone as one
UNDO_LIMIT = 200  # most changes that can be undone


def notify(
    functions: Iterable[Callable[..., object]], *values: Any, failed: Failed | None = None
) -> None:
    """Call every function with the values, even after one has raised an error.

    ``failed`` is called with each error; where it is None, the first error is raised after all
    functions were called.
    """
    errors: list[Exception] = []
    for function in tuple(functions):
        try:
            function(*values)
        except Exception as error:
            (failed or errors.append)(error)
    if errors:
        raise errors[0]


@frozen
class UndoState:
    """The state that undo restores: case, guesses, style of the view, removed runs."""

    case: Case
    guesses: Mapping[str, Guess]
    style: ViewState
    removed: frozenset[int] = frozenset()
    """The numbers of the runs that were removed at that time. Undo removes these alone: later runs
    stay."""
    shown: int | None = field(default=None, compare=False)
    """The number of the run that was shown; it is shown again if undo brings it back."""

    @classmethod
    def of(cls, session: Session) -> UndoState:
        """Return the memento of a session."""
        return cls(
            session.case,
            session.guesses,
            session.view.style,
            frozenset(run.number for run in session.removed),
            session.shown,
        )

    def put_into(self, session: Session) -> Session:
        """Return the session with the memento's state; the step that is shown stays."""
        session = self._put_runs(session)
        colored_by = session.view.color_by
        view = session.view.in_style(self.style)
        # File names of the case are not undone: it was saved there, undone or not.
        case = self.case.change(
            source=session.case.source,
            mesh_out=session.case.mesh_out,
            warnings=session.case.warnings,
        )
        session = replace(session, case=case, guesses=self.guesses, view=view)
        # The quantity that the view is colored by is not undone.
        return set_view(session, color_by=colored_by)

    def _put_runs(self, session: Session) -> Session:
        """Return the session with the memento's removed runs removed, and all others back."""
        for number in sorted({run.number for run in session.removed} - self.removed):
            session = restore_run(session, number)
            if number == self.shown:
                session = show_run(session, number)
        for run in session.runs:
            if run.number in self.removed:
                session = remove_run(session, run.number)
        return session


@record
class _OutsideChange:
    """The values before and after a change of something that is not part of the session.

    ``put`` shows one of them, and returns whether it could.
    """

    put: Callable[[Any], bool]
    before: object
    after: object


Place = tuple[str | int, ...]
"""A number of a case: names of fields and places in tuples, as ``("motions", 0, "vector", 1)``."""


def _changed_places(before: object, now: object, place: Place = ()) -> Iterator[Place]:
    """Yield the places in which two values differ."""
    if before == now:
        return
    if is_dataclass(before) and type(before) is type(now):
        for one in fields(before):
            name = one.name
            yield from _changed_places(getattr(before, name), getattr(now, name), (*place, name))
    elif isinstance(before, tuple) and isinstance(now, tuple) and len(before) == len(now):
        for at, (old, new) in enumerate(zip(before, now, strict=True)):
            yield from _changed_places(old, new, (*place, at))
    else:
        yield place


@frozen
class UndoEntry:
    """A change that can be undone."""

    before: UndoState | _OutsideChange
    """The state before the change (in the list for redo: after it)."""
    words: str  # words for the menu
    kind: tuple[object, ...]
    """The function, what it changed, and names of values: changes with the same are undone as
    one."""
    places: frozenset[Place]
    """Where the case was changed: those with no place in common are undone apart."""
    at_s: float
    """When it was made, in seconds: infinity while the mouse drags, so that what follows belongs to
    it; minus infinity where nothing more can."""


class Store:
    """The session of a window, with its listeners and its undo.

    Listeners are called with the old and the new session, in the order in which they were added.
    Where a listener changes the session, all listeners are called for the first change before the
    second. An error in a listener does not keep the others from being called (`notify`): it goes
    to the attribute ``failed`` or, where that is None, is raised afterwards. ``session``: the first
    session. ``clock``: returns the time in seconds, by which changes are undone together.
    """

    def __init__(
        self, session: Session | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.session = session or Session()
        self._clock = clock
        self._listeners: list[Listener] = []
        self._queue: list[tuple[Session, Session]] = []
        self.failed: Failed | None = None
        self._undo: list[UndoEntry] = []
        self._redo: list[UndoEntry] = []
        self._dragging = self._taking_back = False

    def listen(self, listener: Listener) -> None:
        """Call ``listener(old, new)`` after each change from now on."""
        self._listeners.append(listener)

    def change(self, function: Callable[..., Session], *values: Any, **named: Any) -> None:
        """Replace the session by ``function(session, ...)``, and call the listeners.

        It can be undone if the function is `undoable` for these values.
        """
        old = self.session
        new = function(old, *values, **named)
        words = undo_words(function, named)
        if words is not None:
            # The first value is the boundary, motion or run that is changed.
            which = values[0] if values and isinstance(values[0], (int, str, tuple)) else None
            self._remember(old, new, words, (function, which, *sorted(named)))
        self.put(new)

    @property
    def dragging(self) -> bool:
        """Return whether the mouse drags something that changes the session."""
        return self._dragging

    def set_dragging(self, dragging: bool) -> None:
        """Set whether the mouse drags something that changes the session.

        Changes meanwhile are undone as one, however long it takes; none before or after with them.
        """
        self._dragging = dragging
        if self._undo:
            last = self._undo[-1]
            if dragging or last.at_s == float("inf"):
                self._undo[-1] = replace(last, at_s=float("-inf"))

    @contextmanager
    def reverting(self) -> Iterator[None]:
        """Context in which restoring an earlier value counts as undo."""
        self._taking_back = True
        try:
            yield
        finally:
            self._taking_back = False

    def put(self, session: Session) -> None:
        """Replace the session, and call the listeners; nothing if it is the same object.

        With another mesh, all changes before can no longer be undone.
        """
        if session is self.session:
            return
        if session.mesh is not self.session.mesh:
            self._undo.clear()
            self._redo.clear()
        self._queue.append((self.session, session))
        self.session = session
        if len(self._queue) > 1:
            return
        errors: list[Exception] = []
        try:
            while self._queue:
                notify(self._listeners, *self._queue[0], failed=self.failed or errors.append)
                self._queue.pop(0)
        finally:
            self._queue.clear()
        if errors:
            raise errors[0]

    # Undo ------------------------------------------------------------------------------
    @property
    def can_undo(self) -> str:
        """Return the words for the change that `undo` takes back; "" where there is none."""
        return self._undo[-1].words if self._undo else ""

    @property
    def can_redo(self) -> str:
        """Return the words for the change that `redo` makes again; "" where there is none."""
        return self._redo[-1].words if self._redo else ""

    def undo(self) -> bool:
        """Take back the last change, if there was one; return whether it could be."""
        return self._step(self._undo, self._redo)

    def redo(self) -> bool:
        """Repeat the last undone change, unless another one was made since; return as `undo`."""
        return self._step(self._redo, self._undo)

    def _step(self, source: list[UndoEntry], target: list[UndoEntry]) -> bool:
        if not source:
            return False
        done = source.pop()
        if isinstance(done.before, _OutsideChange):
            target.append(done)  # before listeners ask what can be undone
            outside = done.before
            if outside.put(outside.before if source is self._undo else outside.after):
                return True
            source.append(target.pop())
            return False
        target.append(replace(done, before=UndoState.of(self.session), at_s=float("-inf")))
        self.put(done.before.put_into(self.session))
        return True

    def remember(
        self, words: str, put: Callable[[Any], bool], before: object, after: object
    ) -> None:
        """Let undo call ``put(before)``, and redo ``put(after)``; ``words`` are for the menu.

        ``put`` returns False where it must not be done now: it stays to be undone.

        For changes of what is not part of the session, such as a table of designs.
        """
        self._redo.clear()
        self._undo.append(
            UndoEntry(_OutsideChange(put, before, after), words, (put,), frozenset(), float("-inf"))
        )
        del self._undo[:-UNDO_LIMIT]

    def _remember(self, old: Session, new: Session, words: str, kind: tuple[object, ...]) -> None:
        if new is old or new.mesh is not old.mesh or new.mesh is None:
            return
        before = UndoState.of(old)
        if before == UndoState.of(new):
            return
        words += motion_words(old, new)
        self._redo.clear()
        if self._taking_back and self._drop_same_kind(UndoState.of(new), kind):
            return
        now = self._clock()
        last = self._undo[-1] if self._undo else None
        # Infinity: a change during a drag is undone with the others of the drag.
        at_s = float("inf") if self._dragging else now
        places = frozenset(_changed_places(old.case, new.case))
        if last is not None and last.kind == kind and now - last.at_s < MERGE_S:
            apart = places and last.places and not places & last.places
            if last.at_s == float("inf") or not apart:
                self._undo.pop()
                if last.before != UndoState.of(new):
                    places |= last.places
                    self._undo.append(replace(last, words=words, places=places, at_s=at_s))
                return
        self._undo.append(UndoEntry(before, words, kind, places, at_s))
        # The removal of a run that is no longer in `removed` cannot be undone.
        there = {run.number for run in new.removed}
        self._undo = [d for d in self._undo if d.kind[0] is not remove_run or d.kind[1] in there]
        del self._undo[:-UNDO_LIMIT]

    def _drop_same_kind(self, before: UndoState, kind: tuple[object, ...]) -> bool:
        """Forget the last changes since a state; return whether all are of one kind."""
        for at in reversed(range(len(self._undo))):
            if self._undo[at].kind != kind:
                return False
            if self._undo[at].before == before:
                del self._undo[at:]
                return True
        return False
