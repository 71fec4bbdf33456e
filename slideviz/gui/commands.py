"""The commands of ``commands.toml`` and when they are enabled: for menus, tool bar, help, panels.

`MENUS` has them in the order of the menu bar, `COMMANDS` by name. The toggles of the view are made
from `slideviz.terms.SHOWN`, those that add a section from
`slideviz.case.section_shapes.SECTION_SHAPES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import starmap
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from qtpy.QtGui import QAction, QActionGroup, QKeySequence
from qtpy.QtWidgets import QMenu

from slideviz.argument_types import frozen
from slideviz.case.section_shapes import SECTION_SHAPES, ShapeTerms
from slideviz.gui.widgets.build import wrapped
from slideviz.gui.widgets.theme import NAMES, set_icon
from slideviz.session import changes
from slideviz.session.colors import fit_colors, usual_range
from slideviz.session.measure import toggle_measure
from slideviz.session.motions import box_names, wheel_passages
from slideviz.session.panes import choices, panes, show_in
from slideviz.session.run_messages import to_mend
from slideviz.session.state import Run, Session
from slideviz.session.store import Store
from slideviz.system.tables import table_beside
from slideviz.terms import SHOWN, Shown, ShownTerm, Texts

if TYPE_CHECKING:
    from slideviz.gui.widgets.services import Services
    from slideviz.gui.window import MainWindow


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


WAIT = "Wait for the running job, or cancel it."
NO_FILE = "Save the case first (Ctrl+Shift+S): a command names its file."


@frozen
class Command:
    """A command of the window (an action or a toggle): function, texts, keys, icon, conditions."""

    name: str
    title: str
    """Its text in a menu, with ``&`` before its mnemonic."""
    tip: str
    """What it does, in a sentence."""
    do: Callable[..., object]
    """Called with the window to do it."""
    keys: Sequence[str] = ()
    """Its keys, or names of Qt's standard keys."""
    image: str = ""
    """The name of its icon."""
    needs: Sequence[str] = ()
    """The conditions under which it is enabled (see `holds`)."""
    checked: Callable[[CommandState], bool] | None = None
    """Returns whether it is on, of a toggle."""
    title_now: Callable[[CommandState], str] | None = None
    """Returns its present title, given the `CommandState`; an empty one hides it in the menu."""
    tip_now: Callable[[CommandState], str] | None = None
    """Returns a tooltip to be shown instead of ``tip``, or an empty text; for a disabled command,
    why it is disabled."""
    why_not: str = ""
    """Why it is disabled, in a sentence; for its tooltip."""
    button_tip: str = ""
    button_key: str = ""
    """`button_tip`, `button_key`: tooltip and shortcut of its button in a panel."""
    short: str = ""
    """Its text on the tool bar, if it has no icon."""
    synonyms: str = ""
    """What other programs call it, for the palette."""

    def called(self, now: CommandState) -> str:
        return (self.title_now(now) if self.title_now else "") or self.title

    def enabled(self, now: CommandState | Run) -> bool:
        """Return whether it is enabled: of the commands of a run, for this run."""
        return holds(self.needs, now)

    def action(self, window: Services) -> QAction:
        """Return a new action of a window for the command; `show` brings it up to date."""
        act = QAction(self.title, window)
        act.setObjectName(self.name)
        act.setShortcuts([QKeySequence(getattr(KEY, keys, keys)) for keys in self.keys])
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
        tip = self.tip_now(now) if self.tip_now else ""
        if not able:
            tip = self.reason(now) if self.why_not or not tip else tip
            act.setWhatsThis(tip)
        tip = tip or self.tip
        self._explain(act, self.tip if able else tip, tip)

    def reason(self, now: CommandState) -> str:
        """Return why the command is disabled."""
        if not has_mesh(now):
            return self.why_not or "There is no mesh yet: open one first."
        return now.session.lacks_cells or (
            WAIT if now.busy else self.why_not or "Not possible with this mesh."
        )


@frozen
class Menu:
    """A menu: its commands, submenus and separators (None)."""

    name: str
    title: str
    tip: str = ""
    entries: tuple[Command | Menu | None, ...] = ()
    needs: Sequence[str] = ()
    """The conditions under which it is enabled."""
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


@frozen
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
    live: bool = False
    """Whether the mesh follows the hand."""

    @property
    def measures(self) -> bool:
        """Return whether clicks pick points to be measured."""
        return self.session.view.picks is not None


def has_mesh(now: CommandState) -> bool:
    """Return whether a mesh is open."""
    return now.session.mesh is not None


def is_2d(now: CommandState) -> bool:
    """Return whether a 2D mesh is open."""
    return now.session.mesh is not None and now.session.mesh.dim == 2


def target_boundaries(session: Session) -> Texts:
    """Return the boundaries a command acts on: the selected ones, or else those that move."""
    return session.view.selected or session.case.markers_with("moving")


def has_boxes(now: CommandState) -> bool:
    """Return whether there are boxes for free-form deformation, or their toggle is on."""
    return "ffd" in now.session.view.drawn or bool(box_names(now.session))


CONDITIONS: Mapping[str, Callable[[Any], object]] = {
    "mesh": has_mesh,
    "3d": lambda now: not is_2d(now),
    "idle": lambda now: not now.busy,
    "cells": lambda now: not now.session.lacks_cells,
    "all_zones": lambda now: len(now.session.mesh.parts) == now.session.mesh.zones,
    "steps": lambda now: len(now.session.frames) > 1,
    "boxes": has_boxes,
    "boundaries": lambda now: target_boundaries(now.session),
    "colored": lambda now: now.session.view.color_by != "role",
    "to_mend": lambda now: to_mend(now.session),
    "wheel": lambda now: wheel_passages(now.session),
}
"""What commands need, by name; most suppose that there is a mesh."""


def holds(needs: Sequence[str], now: CommandState | Run) -> bool:
    """Return whether all conditions hold: those of `CONDITIONS`, or what ``now`` has is true."""
    return all((CONDITIONS.get(name) or attrgetter(name))(now) for name in needs)


KEY = QKeySequence.StandardKey


# What they do ------------------------------------------------------------------------------
def _call(method: str, values: Sequence[Any], window: Any, *more: Any) -> object:
    """Call a method of the window, or of a part of it such as ``store.undo``."""
    return attrgetter(method)(window)(*values, *more)


def _undo_or_redo(window: MainWindow, step: Callable[[], bool], words: str, done: str) -> None:
    """Call ``step`` (undo or redo), and show in the status bar which change that was."""
    if step():
        window.show_status(f"{done}: {words}")


def _toggle_shown(name: Shown, window: MainWindow) -> None:
    drawn = window.store.session.view.drawn
    window.store.change(changes.set_view, **{name: name not in drawn})


def _add_section(kind: str, window: MainWindow) -> None:
    window.dock_manager.bring_to_front("sections")
    panel: Any = window.dock_manager.panels["sections"]  # this module cannot import the panels
    panel.add[kind].click()


def _measure(window: MainWindow) -> None:
    window.store.change(toggle_measure)
    window.view.setFocus()  # where Esc takes points back


def _fill_recent(window: MainWindow, menu: QMenu) -> None:
    menu.clear()
    for path in window.files.recent():
        act = menu.addAction(str(path))
        act.triggered.connect(lambda _=False, path=path: window.files.open_path(path))
    if menu.isEmpty():
        menu.addAction("(none yet)").setEnabled(False)


def _fill_samples(window: MainWindow, menu: QMenu) -> None:
    for name, text in window.files.samples.items():
        act = menu.addAction(f"{name}: {text}")
        act.setStatusTip(menu.menuAction().statusTip())
        act.triggered.connect(lambda _=False, name=name: window.files.open_sample(name))
    menu.addSeparator()


def _fill_panels(window: MainWindow, menu: QMenu) -> None:
    for name, dock in window.docks.items():
        act = dock.toggleViewAction()
        if name == "designs":  # of its command, which does the same
            act.setText(f"{dock.windowTitle()}\t{COMMANDS[name].keys[0]}")
        act.setStatusTip(f"Show or hide the panel {dock.windowTitle()}.")
        menu.addAction(act)
    menu.addSeparator()


ACTS: Mapping[str, Callable[[MainWindow], object]] = {
    "undo": lambda w: _undo_or_redo(w, w.store.undo, w.store.can_undo, "Undone"),
    "redo": lambda w: _undo_or_redo(w, w.store.redo, w.store.can_redo, "Redone"),
    "fit_colors": lambda w: w.store.change(fit_colors, every=False),
    "fit_all_colors": lambda w: w.store.change(fit_colors, every=True),
    "usual_colors": lambda w: w.store.change(changes.set_view, color_range=None),
    "fit_boundary": lambda w: w.viewing.fit(target_boundaries(w.store.session)),
    "show_all": lambda w: w.store.change(
        changes.show_boundaries, w.store.session.mesh.marker_names
    ),
    "measure": _measure,
}
"""What commands do that call no method with fixed values, by the names of these in the table."""

FILLS: Mapping[str, Callable[[MainWindow, QMenu], object]] = {
    "open_recent": _fill_recent,
    "open_sample": _fill_samples,
    "compare": lambda window, menu: fill_compare(menu, window.store),
    "panels": _fill_panels,
}
"""What fills menus with entries that are not known beforehand."""

TITLES: Mapping[str, Callable[[CommandState], str]] = {
    "undo": lambda now: f"Undo {now.undo}".rstrip(),
    "redo": lambda now: f"Redo {now.redo}".rstrip(),
    "usual_colors": lambda now: usual_range(now.session),
}
"""Titles that change."""


# The table ---------------------------------------------------------------------------------
def _entries(rows: Iterable[Any], shared: Any) -> Iterator[Command | Menu | None]:
    for row in rows:
        if isinstance(row, str):
            yield from SERIES[row]()
        elif "do" in row:
            yield _command(**(dict(shared) | row))
        else:
            yield _menu(**row)


def _menu(name: str, entries: Iterable[Any] = (), shared: Any = (), **facts: Any) -> Menu:
    inner = tuple(_entries(entries, shared))
    BY_NAME[name] = menu = Menu(name, entries=inner, fill=FILLS.get(name), **facts)
    return menu


def _command(name: str, do: Sequence[Any], on: Sequence[Any] = (), **facts: Any) -> Command:
    method, *values = do
    act = ACTS.get(method) or partial(_call, method, values)
    checked = (lambda now: getattr(now, on[0]) == on[1]) if on else None
    title = TITLES.get(name)
    tip = title if name in ("undo", "redo") else None
    return Command(name, do=act, checked=checked, title_now=title, tip_now=tip, **facts)


def _copies() -> Iterator[Command]:
    for place, words in enumerate(("as a command", "as Python")):
        for what, row in _COPIES.items():
            yield _command(
                f"copy_{what}_{place}",
                ["exports.copy_as", what, place],
                title=f"Copy {row['title']} {words}",
                tip=f"Copy {row['about']} {words}: what differs from the case file is in it.",
                keys=row.get("keys", ())[place : place + 1],
                needs=["mesh", "cells", "session.case_file", *row.get("needs", ())],
                why_not=row.get("why_not", NO_FILE),
            )


def _toggle(name: Shown, term: ShownTerm) -> Command:
    needs = "mesh", term.needs
    image = name if name in NAMES else ""
    return Command(
        name,
        term.name,
        term.tip,
        partial(_toggle_shown, name),
        [term.shortcut],
        image,
        needs,
        lambda now: name in now.session.view.drawn,
        tip_now=lambda now: term.why_not if has_mesh(now) and not holds(needs, now) else "",
    )


def _section(kind: str, row: ShapeTerms) -> Command:
    def title(now: CommandState) -> str:
        words = row.words.get(2 if is_2d(now) else 3)
        return "" if words is None else words.action

    return Command(
        f"add_{kind}",
        row.words[3].action,
        row.tip_to_add,
        partial(_add_section, kind),
        [row.key] if row.key else (),
        needs=["mesh"],
        title_now=title,
        synonyms="slice section clip",
    )


SERIES: Mapping[str, Callable[[], Iterable[Command | None]]] = {
    "": lambda: [None],
    "copies": _copies,
    "toggles": lambda: starmap(_toggle, SHOWN.items()),
    "sections": lambda: starmap(_section, SECTION_SHAPES.items()),
}
"""What the texts among the entries of a menu stand for."""

_TABLE = table_beside(__file__)
_COPIES = _TABLE.pop("copies")
PANEL_KEYS: Mapping[str, list[str]] = _TABLE.pop("panel_keys")
MOUSE: Mapping[str, str] = _TABLE.pop("mouse")
"""`PANEL_KEYS`, `MOUSE`: what keys and mouse do besides, for the palette."""
BY_NAME: dict[str, Menu] = {}
"""All menus, also those in others."""
RUN_MENU = _menu("of_run", **_TABLE.pop("of_run"))
MENUS = [_menu(name, **row) for name, row in _TABLE.items()]
COMMANDS: dict[str, Command] = {one.name: one for menu in MENUS for one in menu.commands()}
