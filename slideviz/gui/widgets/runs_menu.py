"""Menus of runs: which one a view shows, and which one the shown run is compared with."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtGui import QActionGroup
from qtpy.QtWidgets import QMenu

from slideviz.session import changes
from slideviz.session.panes import choices, panes, show_in
from slideviz.session.store import Store


def fill_pane(menu: QMenu, store: Store, pane: int) -> None:
    """Fill the menu of view 0 or 1 of a comparison: the undeformed mesh and the runs."""
    _fill(menu, store, panes(store.session)[pane], lambda n: store.change(show_in, pane, n))


def fill_compare(menu: QMenu, store: Store) -> None:
    """Fill the menu with what the shown run can be compared with, and the end of comparison."""
    beside, shown = store.session.view.beside, store.session.shown
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
