"""Records of actions, toggles and menus, and the conditions under which an action can be done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qtpy.QtGui import QAction, QKeySequence
from qtpy.QtWidgets import QMenu

from slideviz.gui.widgets.icons import set_icon
from slideviz.gui.widgets.labels import wrapped
from slideviz.session.motions import box_names
from slideviz.session.state import IN_FILE, Session

if TYPE_CHECKING:
    from slideviz.gui.widgets.services import Services

Keys = str | QKeySequence.StandardKey


def always(_: Any) -> bool:
    """Return True."""
    return True


@dataclass(frozen=True)
class Command:
    """A command: function, words, keys, icon, and when it can be done.

    Attributes
    ----------
    name : str
    title : str
        In a menu, with the letter marked that chooses it there.
    tip : str
        What it does, in a sentence.
    do : callable
        Does it, given the window.
    keys : tuple of str or standard keys
    image : str
        The name of its icon.
    enabled, checked : callable
        Whether it can be done and, of a toggle, whether it is on, given the `Now` of the window.
    title_now : callable, optional
        Its title where that changes; an empty one takes it out of the menu.
    tip_now : callable, optional
        What its tooltip says instead, if anything; where it cannot be done, why.
    button_tip, button_key : str
        What the tooltip of its button in a panel says, and the key of that.
    short : str
        Its word on the tool bar, if it has no icon.
    """

    name: str
    title: str
    tip: str
    do: Callable[..., object]
    keys: tuple[Keys, ...] = ()
    image: str = ""
    enabled: Callable[[Any], bool] = always
    checked: Callable[[Now], bool] | None = None
    title_now: Callable[[Now], str] | None = None
    tip_now: Callable[[Now], str] | None = None
    button_tip: str = ""
    button_key: str = ""
    short: str = ""

    def called(self, now: Now) -> str:
        """Return the present title of the command."""
        return (self.title_now(now) if self.title_now else "") or self.title

    def action(self, window: Services) -> QAction:
        """Return an action for the command, which `show` keeps up to date."""
        act = QAction(self.title, window)
        act.setObjectName(self.name)
        act.setShortcuts([QKeySequence(keys) for keys in self.keys])
        act.setCheckable(self.checked is not None)
        act.triggered.connect(lambda _=False: self.do(window))
        if self.short:
            act.setIconText(self.short)
        if self.image:
            set_icon(act, self.image)
        self._explain(act, self.tip, self.tip)
        return act

    def _explain(self, act: QAction, status: str, tip: str) -> None:
        act.setStatusTip(status)
        keys = act.shortcut().toString()
        act.setToolTip(wrapped(f"{tip} ({keys})" if keys else tip))

    def show(self, act: QAction, now: Now) -> None:
        """Show in its action whether the command can be done now, and under which title."""
        able = self.enabled(now)
        if self.title_now is not None:
            title = self.title_now(now)
            act.setVisible(bool(title))
            able = able and bool(title)
            act.setText(title or act.text())
        act.setEnabled(able)
        if self.checked is not None:
            act.setChecked(self.checked(now))
        if self.tip_now is not None:
            tip = self.tip_now(now) or self.tip
            self._explain(act, self.tip if able else tip, tip)


@dataclass(frozen=True)
class Menu:
    """A menu: its commands, lines and submenus.

    Attributes
    ----------
    fill : callable, optional
        Puts in what no table knows, given the window and the menu: once, above the entries, or,
        where there are none, each time that it opens.
    one_of : bool
        Whether one of its commands is on at a time.
    tooltips : bool
        Whether it shows tooltips: they say why something cannot be done.
    """

    name: str
    title: str
    tip: str = ""
    entries: tuple[Command | Menu | None, ...] = ()
    enabled: Callable[[Now], bool] = always
    fill: Callable[[Any, QMenu], object] | None = None
    one_of: bool = False
    tooltips: bool = False

    def commands(self) -> Iterator[Command]:
        """Yield the commands of the menu and of its submenus."""
        for entry in self.entries:
            if isinstance(entry, Menu):
                yield from entry.commands()
            elif entry is not None:
                yield entry


@dataclass(frozen=True)
class Now:
    """The state of the window by which commands can be done or not.

    Attributes
    ----------
    busy : bool
        Whether a job runs.
    ready : bool
        Whether a run could start if none did.
    undo, redo : str
        What would be undone or done again, in words.
    theme : str
    """

    session: Session
    busy: bool = False
    ready: bool = False
    undo: str = ""
    redo: str = ""
    theme: str = ""


def opened(now: Now) -> bool:
    """Tell whether a mesh is open."""
    return now.session.mesh is not None


def flat(now: Now) -> bool:
    """Tell whether a mesh of two dimensions is open."""
    return now.session.mesh is not None and now.session.mesh.dim == 2


def solid(now: Now) -> bool:
    """Tell whether a mesh of three dimensions is open."""
    return opened(now) and not flat(now)


def bounded(now: Now) -> bool:
    """Tell whether there are boundaries that are selected, or move."""
    return opened(now) and bool(meant(now.session))


def meant(session: Session) -> tuple[str, ...]:
    """Return the selected boundaries, or else those that move."""
    return session.view.selected or session.case.markers_with("moving")


def boxed(now: Now) -> bool:
    """Tell whether there are boxes for free-form deformation, or they are to be drawn."""
    return opened(now) and ("ffd" in now.session.view.drawn or bool(box_names(now.session)))


def valued(now: Now) -> bool:
    """Tell whether cells are coloured by a value."""
    return opened(now) and now.session.view.colour_by != "role"


def stepped(now: Now) -> bool:
    """Tell whether there are steps."""
    return len(now.session.frames) > 1


def idle(now: Now) -> bool:
    """Tell whether a mesh is open and no job runs."""
    return opened(now) and not now.busy


def stepped_and_idle(now: Now) -> bool:
    """Tell whether there are steps and no job runs."""
    return stepped(now) and idle(now)


def whole(able: Callable[[Now], bool]) -> Callable[[Now], bool]:
    """Return a condition that holds only where all cells are in memory, too."""
    return lambda now: able(now) and not now.session.in_file


def why_not(able: Callable[[Now], bool], why: str) -> Callable[[Now], str]:
    """Return a function that returns why a command cannot be done, or an empty text."""
    wait = "Wait for the end of what runs, or cancel it."

    def words(now: Now) -> str:
        if able(now):
            return ""
        if now.session.in_file:
            return IN_FILE
        return wait if opened(now) and now.busy else why

    return words
