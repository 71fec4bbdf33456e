"""The commands of the window and when they are enabled: for menus, tool bar, help and panels.

`MENUS` has them in the order of the menu bar, `COMMANDS` by name. The toggles of the view are made
from `slideviz.terms.SHOWN`, those that add a section from
`slideviz.case.section_shapes.SECTION_SHAPES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from qtpy.QtGui import QAction, QActionGroup, QKeySequence
from qtpy.QtWidgets import QMenu

from slideviz.case.section_shapes import SECTION_SHAPES, ShapeTerms
from slideviz.gui.widgets.build import wrapped
from slideviz.gui.widgets.theme import NAMES, set_icon
from slideviz.session import changes
from slideviz.session.colors import fit_colors, usual_range
from slideviz.session.motions import box_names, wheel_passages
from slideviz.session.panes import choices, panes, show_in
from slideviz.session.run_messages import to_mend
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.terms import SHOWN, Shown, ShownTerm

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


Keys = str | QKeySequence.StandardKey
WAIT = "Wait for the running job, or cancel it."


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
    live: bool = False
    """Whether the mesh follows the hand."""


def has_mesh(now: CommandState) -> bool:
    """Return whether a mesh is open."""
    return now.session.mesh is not None


def is_2d(now: CommandState) -> bool:
    """Return whether a 2D mesh is open."""
    return now.session.mesh is not None and now.session.mesh.dim == 2


def is_3d(now: CommandState) -> bool:
    """Return whether a 3D mesh is open."""
    return has_mesh(now) and not is_2d(now)


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


def has_file(now: CommandState) -> bool:
    """Return whether there is a mesh in memory whose case is saved."""
    session = now.session
    return has_mesh(now) and session.case_file is not None and not session.lacks_cells


def has_steps_and_is_idle(now: CommandState) -> bool:
    """Return whether the shown run has steps and no job runs."""
    return has_steps(now) and is_idle(now)


def can_continue(now: CommandState) -> bool:
    """Return whether the shown run has steps of all zones in memory, and no job runs."""
    mesh = now.session.mesh
    whole = mesh is not None and len(mesh.parts) == mesh.zones and not now.session.lacks_cells
    return whole and has_steps_and_is_idle(now)


def in_memory(able: Callable[[CommandState], bool]) -> Callable[[CommandState], bool]:
    """Return a condition that holds if ``able`` does and all cells are in memory."""
    return lambda now: able(now) and not now.session.lacks_cells


KEY = QKeySequence.StandardKey


# What they do ------------------------------------------------------------------------------
def call(method: str, *values: Any, **named: Any) -> Callable[[Any], object]:
    """Return what calls a method of the window, or of a part of it such as ``store.undo``."""
    return lambda window: attrgetter(method)(window)(*values, **named)


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


# The tables --------------------------------------------------------------------------------
# fmt: off

_NO_STEPS = "There are no steps yet: run the case first."
_BY_ROLE = "Color the cells by a quantity first, with a range of its own."
_NO_FILE = "Save the case first (Ctrl+Shift+S): a command names its file."
_EXPORT = Menu("export", "&Export", "Export pictures, films, tables and meshes.", (
    Command("save_picture", "&Picture…", "Make a picture (screenshot) of the view.",
            call("exports.picture"), ("Ctrl+P",), "picture", has_mesh),
    Command("copy_picture", "&Copy picture",
            "Copy a picture of the view, with a white background, to the clipboard.",
            call("exports.copy_picture"), ("Ctrl+Shift+C",), enabled=has_mesh),
    Command("export_report", "&Report…",
            "Write a page with picture, histogram, numbers of the runs, limits, case and versions.",
            call("exports.report"), enabled=in_memory(is_idle)),
    Command("export_film", "&Film of the steps…", "Make a film of the steps.",
            call("exports.make_film"),
            enabled=in_memory(has_steps), why_not=_NO_STEPS),
    Command("export_quality", "&Quality as CSV…",
            "Save the quality of every cell of the step that is shown as a CSV table.",
            call("exports.quality"),
            enabled=in_memory(is_idle)),
    Command("export_steps", "&Meshes of all steps…",
            "Save the mesh of every step: each in a file of its own, or all in one .vtkhdf file.",
            call("exports.steps"),
            enabled=in_memory(has_steps_and_is_idle),
            why_not=_NO_STEPS),
), tooltips=True)

_FILE = Menu("file", "&File", entries=(
    Command("open", "&Open…", "Open a mesh, or a case or session with its mesh.",
            call("files.ask_and_open"), (KEY.Open,), "open"),
    Menu("open_recent", "Open &recent", "Open a recent file.", fill=_fill_recent),
    Menu("open_sample", "Open sa&mple", "Open a case that comes with the program.", (
        Command("sample_of_size", "Of another &size…", "Open a sample with fewer or more cells.",
                call("files.ask_and_open_sample")),
    ), fill=_fill_samples),
    None,
    Command("save_mesh", "&Save mesh as…", "Save the mesh of the step that is shown.",
            call("files.save_mesh"), (KEY.Save,), "save", in_memory(is_idle)),
    Command("save_wheel", "Save as &wheel…",
            "Save the step that is shown as a wheel: its passages side by side, in one mesh.",
            call("exports.wheel"),
            enabled=in_memory(lambda now: is_idle(now) and bool(wheel_passages(now.session))),
            why_not="The mesh is not a passage of a wheel: two boundaries of its only zone must be "
            "periodic, by a whole part of a turn."),
    Command("save_case", "Save &case as…",
            "Save roles, motions, method and view as a case (.cfg) that gives the same result.",
            call("files.save_case"), ("Ctrl+Shift+S",), "case", has_mesh),
    Command("save_session", "Save s&ession as…",
            "Save case, view, runs with their steps, and designs in one file, to go on later.",
            call("files.save_session"), ("Ctrl+Alt+S",), enabled=is_idle),
    _EXPORT,
    None,
    Command("quit", "&Quit", "Close the window; unsaved changes are asked about.",
            call("close"), (KEY.Quit,)),
), tooltips=True)

_COPY_AS = Menu("copy_as", "&Copy as", "Copy what makes again what is shown, to be pasted.", tuple(
    Command(f"copy_{what}_{place}", f"Copy {title} {words}",
            f"Copy {about} {words}: what differs from the case file is in it.",
            call("exports.copy_as", what, place), keys, enabled=able, why_not=why)
    for place, words in enumerate(("as a command", "as Python"))
    for what, title, about, keys, able, why in (
        ("picture", "&view", "the picture of the view, with the run it shows,",
         (("Ctrl+Alt+C", "Ctrl+Alt+P")[place],), has_file, _NO_FILE),
        ("section", "&section", "the picture of the selected section", (),
         lambda now: has_file(now) and now.session.view.section is not None,
         "Select a section of a saved case first."),
        ("film", "&film", "the film of the steps", (),
         lambda now: has_file(now) and has_steps(now),
         "Save the case (Ctrl+Shift+S) and run it first."),
        ("run", "&run", "the run", (), has_file, _NO_FILE),
    )
), tooltips=True)

_EDIT = Menu("edit", "&Edit", entries=(
    Command("undo", "Undo", "Undo the last change.",
            lambda w: _undo_or_redo(w, w.store.undo, w.store.can_undo, "Undone"),
            (KEY.Undo,), "undo", lambda now: bool(now.undo),
            title_now=lambda now: f"Undo {now.undo}".rstrip(),
            tip_now=lambda now: now.undo and f"Undo {now.undo}",
            why_not="There is nothing to undo.", synonyms="back revert"),
    Command("redo", "Redo", "Redo the change that was undone.",
            lambda w: _undo_or_redo(w, w.store.redo, w.store.can_redo, "Redone"),
            (KEY.Redo, "Ctrl+Y"), "redo", lambda now: bool(now.redo),
            title_now=lambda now: f"Redo {now.redo}".rstrip(),
            tip_now=lambda now: now.redo and f"Redo {now.redo}",
            why_not="There is nothing to redo."),
    None,
    _COPY_AS,
))

_RUN = Menu("run", "&Run", entries=(
    Command("run", "&Run", "Deform the mesh with these settings.",
            call("start_run"), ("F5",), "run",
            lambda now: now.ready and not now.busy,
            button_tip="Deform the mesh with these settings (Ctrl+R).", button_key="Ctrl+R"),
    Command("cancel", "&Cancel", "Stop the running job; finished steps are kept.",
            call("running.cancel"), image="cancel", enabled=lambda now: now.busy,
            why_not="No job is running.",
            button_tip="Stop within a second (Esc); finished steps are kept.",
            button_key="Esc"),
    Command("repair", "Re&pair",
            "Mend the inverted and poor cells of the last step of the run that is shown, or of the "
            "mesh: by moving nodes near them, never nodes of moving and fixed boundaries.",
            call("running.repair"), ("F7",),
            enabled=lambda now: is_idle(now) and to_mend(now.session) is not None,
            why_not="No cell needs repair: all are proved valid, and their quality is above the "
            "limit in the method panel."),
    Command("continue_run", "C&ontinue from this run…",
            "Save the deformed mesh, and open it with these settings for a further motion: its "
            "cells are relaxed to the shapes of the undeformed mesh, and compared with them.",
            call("files.continue_run"), enabled=can_continue,
            why_not="There are no steps of a whole mesh in memory: run the case first."),
    Command("live", "&Live preview",
            "While a number of a motion changes, let the mesh follow, with its quality; half a "
            "second after the last change the run itself replaces this preview.",
            call("toggle_live"), checked=lambda now: now.live),
    None,
    Command("designs", "&Designs…",
            "Show or hide the panel of designs: a table of runs with other numbers of the motions "
            "or other settings, and their quality.",
            call("dock_manager.toggle", "designs"), ("F6",), enabled=has_mesh),
))

_COLORS = Menu("colors", "&Colors", "The range of values that the colors show.", (
    Command("fit_colors", "Fit to this step",
            "Let the colors range over the values of the step that is shown, and of the other step "
            "in a comparison.",
            call("store.change", fit_colors, every=False),
            ("R",), enabled=colored_by_value, why_not=_BY_ROLE,
            button_tip="From the lowest to the highest value of what is shown now (R); of all "
            "steps: Shift+R."),
    Command("fit_all_colors", "Fit to all steps",
            "Let the colors range over the values of all steps, so that they mean the same in a "
            "whole film.",
            call("store.change", fit_colors, every=True),
            ("Shift+R",), enabled=colored_by_value, why_not=_BY_ROLE),
    Command("usual_colors", "Default range", "Use the default range of the colors.",
            call("store.change", changes.set_view, color_range=None),
            enabled=lambda now: colored_by_value(now) and now.session.view.color_range is not None,
            why_not=_BY_ROLE,
            title_now=lambda now: usual_range(now.session)),
))


def _side_command(side: str, keys: str, short: str = "") -> Command:
    place = "a corner" if side == "iso" else side
    return Command(f"side{side}", "isometric" if side == "iso" else side,
                   f"Look at the mesh from {place}.", call("viewing.look_from", side),
                   (keys,), enabled=is_3d, short=short, why_not="A 2D mesh has one side.")


_SIDES = Menu("look_from", "Look &from", "Look at the mesh from a side.", (
    _side_command("+x", "1", "X"), _side_command("-x", "Shift+1"),
    _side_command("+y", "2", "Y"), _side_command("-y", "Shift+2"),
    _side_command("+z", "3", "Z"), _side_command("-z", "Shift+3"),
    _side_command("iso", "0", "Iso"),
))

# Without steps the commands are disabled, and Space presses the focused button.
STEPS = Menu("steps", "&Steps", "Show another step of the deformation.", (
    Command("step_first", "Undeformed mesh", "Show the mesh before it is deformed.",
            call("player.go", 0), ("Home",), enabled=has_steps, why_not=_NO_STEPS,
            button_tip="Undeformed mesh (Home)"),
    Command("step_previous", "Step back", "Show the step before this one.",
            call("player.step", -1), ("Alt+Left",), enabled=has_steps, why_not=_NO_STEPS,
            button_tip="One step back (Alt+Left)"),
    Command("step_play", "Play or pause", "Play the steps one after the other, or pause.",
            call("player.toggle"), ("Space",), enabled=has_steps, why_not=_NO_STEPS,
            button_tip="Play the steps (Space)"),
    Command("step_next", "Step on", "Show the step after this one.",
            call("player.step", 1), ("Alt+Right",), enabled=has_steps, why_not=_NO_STEPS,
            button_tip="One step on (Alt+Right)"),
    Command("step_last", "Last step", "Show the deformed mesh.",
            call("player.go", 10**9), ("End",), enabled=has_steps, why_not=_NO_STEPS,
            button_tip="Last step (End)"),
))


def _theme_command(theme: str, tip: str) -> Command:
    return Command(f"theme_{theme}", f"&{theme.capitalize()}", tip,
                   call("set_theme", theme), checked=lambda now: now.theme == theme)


_THEMES = Menu("theme", "&Theme", "Light or dark colors.", (
    _theme_command("system", "Use light or dark colors as the desktop does."),
    _theme_command("light", "Use light colors."),
    _theme_command("dark", "Use dark colors."),
), one_of=True)


def _shown_command(name: Shown, term: ShownTerm) -> Command:
    able = {"": has_mesh, "boxes": has_boxes, "3d": is_3d}[term.needs]
    image = name if name in NAMES else ""
    return Command(name, term.name, term.tip, partial(_toggle_shown, name), (term.shortcut,),
                   image, able, checked=lambda now: name in now.session.view.drawn,
                   tip_now=lambda now: term.why_not if has_mesh(now) and not able(now) else "")


def _section_command(kind: str, row: ShapeTerms) -> Command:
    def title(now: CommandState) -> str:
        words = row.words.get(2 if is_2d(now) else 3)
        return "" if words is None else words.action

    return Command(f"add_{kind}", row.words[3].action, row.tip_to_add, partial(_add_section, kind),
                   (row.key,) if row.key else (), enabled=has_mesh, title_now=title,
                   synonyms="slice section clip")


COMPARE = Menu("compare", "Co&mpare with",
               "Show the undeformed mesh or another run beside the run that is shown.",
               enabled=lambda now: now.session.deformed is not None,
               fill=lambda window, menu: fill_compare(menu, window.store))

_VIEW = Menu("view", "&View", entries=(
    *(_shown_command(name, term) for name, term in SHOWN.items()),
    None,
    _COLORS,
    Command("fit", "&Fit all", "Zoom to the whole mesh.",
            call("viewing.fit"), ("F",), "fit", has_mesh),
    Command("fit_boundary", "Fit to &boundary",
            "Zoom to the selected boundaries, or else those that move.",
            lambda w: w.viewing.fit(target_boundaries(w.store.session)),
            ("Shift+F",),
            enabled=lambda now: has_mesh(now) and bool(target_boundaries(now.session)),
            why_not="No boundary is selected, and none moves."),
    _SIDES,
    COMPARE,
    Command("show_all", "Show &all boundaries", "Show the boundaries that were hidden.",
            lambda w: w.store.change(changes.show_boundaries, w.store.session.mesh.marker_names),
            ("Shift+A",), enabled=has_mesh),
    *(_section_command(kind, row) for kind, row in SECTION_SHAPES.items()),
    None,
    STEPS,
    None,
    _THEMES,
    Command("full_screen", "F&ull screen", "Fill the screen with the window, or leave full screen.",
            call("toggle_full_screen"), ("F11",)),
    Menu("panels", "&Panels", "Show and hide the panels around the view.", (
        Command("next_panel", "&Next panel",
                "Go to the next panel, also behind a tab.",
                call("dock_manager.bring_next"), ("Ctrl+PgDown",)),
        Command("previous_panel", "&Previous panel",
                "Go to the previous panel, also behind a tab.",
                call("dock_manager.bring_next", -1), ("Ctrl+PgUp",)),
        Command("hide_panels", "&Hide or show all",
                "Hide every panel, so that the view has all the space, or show them again.",
                call("dock_manager.toggle_all"), ("F9",)),
        Command("restore_layout", "&Restore layout",
                "Move every panel back to its first place.",
                call("dock_manager.restore_layout")),
    ), fill=_fill_panels),
))

_HELP = Menu("help", "&Help", entries=(
    Command("manual", "&Manual", "Read and search the pages of the documentation.",
            call("help.manual"), ("Shift+F1",)),
    Command("palette", "&Find anything…",
            "Find commands, boundaries, runs, keys of the case, pages of the manual, and what keys "
            "and mouse do.",
            call("help.palette"), ("F1", "Ctrl+Shift+P"), short="Find…"),
    Command("case_keys", "Case &keys", "Show and search the keys of a case file.",
            call("help.case_keys")),
    Command("copy_details", "&Copy details for a bug report",
            "Copy versions, graphics, mesh and the last messages, for a bug report.",
            call("help.copy_details")),
    Command("about", "&About slideviz", "Show version and licence.", call("help.about")),
))
# fmt: on

MENUS = (_FILE, _EDIT, _RUN, _VIEW, _HELP)
COMMANDS: dict[str, Command] = {one.name: one for menu in MENUS for one in menu.commands()}
