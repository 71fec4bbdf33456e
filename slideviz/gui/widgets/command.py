"""Records of commands and menus, and the conditions under which a command is enabled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qtpy.QtGui import QAction, QActionGroup, QKeySequence
from qtpy.QtWidgets import QMenu

from slideviz.gui.widgets.build import wrapped
from slideviz.gui.widgets.icons import set_icon
from slideviz.session import changes
from slideviz.session.motions import box_names, wheel_passages
from slideviz.session.panes import choices, panes, show_in
from slideviz.session.run_messages import to_mend
from slideviz.session.state import Session
from slideviz.session.store import Store

if TYPE_CHECKING:
    from slideviz.gui.widgets.services import Services


def fill_pane(menu: QMenu, store: Store, pane: int) -> None:
    """Fill the menu of view 0 or 1 of a comparison: the undeformed mesh and the runs."""
    _fill(menu, store, panes(store.session)[pane], lambda n: store.change(show_in, pane, n))


def fill_compare(menu: QMenu, store: Store) -> None:
    """Fill the menu with what the shown run can be compared with, and the end of comparison."""
    beside = store.session.view.beside
    shown = store.session.shown
    _fill(menu, store, beside, lambda n: store.change(changes.show_beside, n), leave=shown)
    menu.addSeparator()
    end = menu.addAction("End the comparison")
    end.setEnabled(beside is not None)
    end.triggered.connect(lambda: store.change(changes.show_beside, None))


def _fill(
    menu: QMenu,
    store: Store,
    now: int | None,
    choose: Callable[[int], None],
    leave: int | None = None,
) -> None:
    menu.clear()
    group = QActionGroup(menu)
    for number, text in choices(store.session).items():
        if number == leave:
            continue
        act = menu.addAction(text)
        act.setCheckable(True)
        act.setChecked(number == now)
        act.setData(number)
        group.addAction(act)
        act.triggered.connect(lambda _=False, number=number: choose(number))


Keys = str | QKeySequence.StandardKey


def always(_: Any) -> bool:
    """Return True."""
    return True


@dataclass(frozen=True)
class Command:
    """A command of the window (an action or a toggle): function, texts, keys, icon, conditions."""

    name: str
    title: str
    """Its text in a menu, with ``&`` before its mnemonic."""
    tip: str
    """What it does, in a sentence."""
    do: Callable[..., object]
    """Called with the window to do it."""
    keys: tuple[Keys, ...] = ()
    image: str = ""
    """The name of its icon."""
    enabled: Callable[[Any], bool] = always
    checked: Callable[[CommandState], bool] | None = None
    """`enabled`, `checked`: return whether it is enabled and, of a toggle, whether it is on."""
    title_now: Callable[[CommandState], str] | None = None
    """Returns its present title, given the `CommandState`; an empty one hides it in the menu."""
    tip_now: Callable[[CommandState], str] | None = None
    """Returns a tooltip to be shown instead of ``tip``, or an empty text; for a disabled command,
    why it is disabled."""
    button_tip: str = ""
    button_key: str = ""
    """`button_tip`, `button_key`: tooltip and shortcut of its button in a panel."""
    short: str = ""
    """Its text on the tool bar, if it has no icon."""

    def called(self, now: CommandState) -> str:
        return (self.title_now(now) if self.title_now else "") or self.title

    def action(self, window: Services) -> QAction:
        """Return a new action of a window for the command; `show` brings it up to date."""
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

    def show(self, act: QAction, now: CommandState) -> None:
        """Update the command's action: enabled, checked, title and tooltip."""
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
    """A menu: its commands, submenus and separators (None)."""

    name: str
    title: str
    tip: str = ""
    entries: tuple[Command | Menu | None, ...] = ()
    enabled: Callable[[CommandState], bool] = always
    fill: Callable[[Any, QMenu], object] | None = None
    """Adds entries that are not known beforehand, given the window and the menu: once, above
    ``entries``; or, if there are no ``entries``, each time the menu opens."""
    one_of: bool = False
    """Whether its toggles exclude each other."""
    tooltips: bool = False
    """Whether it shows tooltips, which say why a command is disabled."""

    def commands(self) -> Iterator[Command]:
        for entry in self.entries:
            if isinstance(entry, Menu):
                yield from entry.commands()
            elif entry is not None:
                yield entry


@dataclass(frozen=True)
class CommandState:
    """The state of the window on which the commands' conditions depend."""

    session: Session
    busy: bool = False
    """Whether a job runs."""
    ready: bool = False
    """Whether all requirements of a run are met."""
    undo: str = ""
    redo: str = ""
    """`undo`, `redo`: the change that would be undone or redone, in words; empty if there is
    none."""
    theme: str = ""
    """The chosen theme: one of `slideviz.gui.widgets.theme.THEMES`."""


def has_mesh(now: CommandState) -> bool:
    """Return whether a mesh is open."""
    return now.session.mesh is not None


def is_2d(now: CommandState) -> bool:
    """Return whether a 2D mesh is open."""
    return now.session.mesh is not None and now.session.mesh.dim == 2


def is_3d(now: CommandState) -> bool:
    """Return whether a 3D mesh is open."""
    return has_mesh(now) and not is_2d(now)


def has_boundary_target(now: CommandState) -> bool:
    """Return whether there are selected or moving boundaries."""
    return has_mesh(now) and bool(target_boundaries(now.session))


def target_boundaries(session: Session) -> tuple[str, ...]:
    """Return the boundaries a command acts on: the selected ones, or else those that move."""
    return session.view.selected or session.case.markers_with("moving")


def has_boxes(now: CommandState) -> bool:
    """Return whether there are boxes for free-form deformation, or their toggle is on."""
    return has_mesh(now) and ("ffd" in now.session.view.drawn or bool(box_names(now.session)))


def colored_by_value(now: CommandState) -> bool:
    """Return whether cells are colored by a value."""
    return has_mesh(now) and now.session.view.color_by != "role"


def has_steps(now: CommandState) -> bool:
    """Return whether the shown run has steps."""
    return len(now.session.frames) > 1


def is_idle(now: CommandState) -> bool:
    """Return whether a mesh is open and no job runs."""
    return has_mesh(now) and not now.busy


def needs_repair(now: CommandState) -> bool:
    """Return whether a mesh in memory has cells to mend, and no job runs."""
    return is_idle(now) and to_mend(now.session) is not None


def has_steps_and_is_idle(now: CommandState) -> bool:
    """Return whether the shown run has steps and no job runs."""
    return has_steps(now) and is_idle(now)


def has_wheel(now: CommandState) -> bool:
    """Return whether periodic boundaries make the mesh a passage of a wheel, and no job runs."""
    return is_idle(now) and bool(wheel_passages(now.session))


def in_memory(able: Callable[[CommandState], bool]) -> Callable[[CommandState], bool]:
    """Return a condition that holds if ``able`` does and all cells are in memory."""
    return lambda now: able(now) and not now.session.lacks_cells


def why_not(able: Callable[[CommandState], bool], why: str) -> Callable[[CommandState], str]:
    """Return a ``tip_now``: it returns why a command is disabled, empty if ``able`` holds.

    The reason is ``why``, unless the mesh stays in its file or a job runs.
    """
    wait = "Wait for the running job, or cancel it."

    def words(now: CommandState) -> str:
        if able(now):
            return ""
        reason = wait if has_mesh(now) and now.busy else why
        return now.session.lacks_cells or reason

    return words
