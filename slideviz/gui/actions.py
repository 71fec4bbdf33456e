"""Menus and shortcuts: the actions by name, and which of them can be done."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from qtpy.QtGui import QAction, QActionGroup, QKeySequence
from qtpy.QtWidgets import QMainWindow, QMenu

from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.gui.tool_bar import ToolBar
from slideviz.gui.widgets.icons import icon
from slideviz.gui.widgets.runs_menu import fill_compare
from slideviz.gui.widgets.theme import THEMES
from slideviz.gui.widgets.tips import tip_of, wrapped
from slideviz.session import changes
from slideviz.session.colors import usual_range
from slideviz.session.state import Session
from slideviz.terms import SHOWN, Shown

TOGGLES: dict[Shown, str] = {
    "edges": "E",
    "undeformed": "U",
    "motion_ghost": "G",
    "legend": "L",
    "triad": "T",
    "perspective": "P",
}
"""Keys of what is shown or not."""
SIDE_KEYS = {"+x": "1", "-x": "Shift+1", "+y": "2", "-y": "Shift+2", "+z": "3", "-z": "Shift+3"}
STEPS = ("step_first", "step_previous", "step_play", "step_next", "step_last")
_ICONS = {"motion_ghost": "ghost"}


class Actions:
    """The actions of the main window, by name in ``self.by_name``."""

    def __init__(self, window: QMainWindow) -> None:
        self.window = window
        self.by_name: dict[str, QAction] = {}
        self._icons: dict[str, str] = {}
        self._make_file()
        self._make_view()
        self._make_help()
        self.bar = ToolBar(window, self.by_name, self.colours)
        window.addToolBar(self.bar)

    def _add(self, name: str, text: str, function=None, keys="", image: str = "") -> QAction:
        act = QAction(text, self.window)
        act.setObjectName(name)
        if keys:
            act.setShortcut(QKeySequence(keys))
        if function is not None:
            act.triggered.connect(lambda _=False: function())
        if image:
            self._icons[name] = image
        tip = tip_of(name, text)
        act.setStatusTip(tip)
        act.setToolTip(wrapped(f"{tip} ({act.shortcut().toString()})" if keys else tip))
        self.by_name[name] = act
        return act

    def _make_file(self) -> None:
        files, window = self.window.files, self.window
        menu = window.menuBar().addMenu("&File")
        standard = QKeySequence.StandardKey
        menu.addAction(self._add("open", "&Open…", files.ask_and_open, standard.Open, "open"))
        self.recent = self._menu(menu, "open_recent", "Open &recent")
        self.recent.aboutToShow.connect(self._fill_recent)
        self.samples = self._menu(menu, "open_sample", "Open sa&mple")
        for name, text in files.samples.items():
            act = self.samples.addAction(f"{name}: {text}")
            act.setStatusTip(tip_of("open_sample", name))
            act.triggered.connect(partial(lambda name, _=False: files.open_sample(name), name))
        self.samples.addSeparator()
        self.samples.addAction(
            self._add("sample_of_size", "Of another &size…", files.ask_and_open_sample)
        )
        self.samples.setEnabled(bool(files.samples))
        menu.addSeparator()
        for name, text, function, keys, image in (
            ("save_mesh", "&Save mesh as…", files.save_mesh, standard.Save, "save"),
            ("save_case", "Save &case as…", files.save_case, "Ctrl+Shift+S", "case"),
        ):
            menu.addAction(self._add(name, text, function, keys, image))
        self._make_export(menu)
        menu.addSeparator()
        menu.addAction(self._add("quit", "&Quit", window.close, standard.Quit))
        self._make_edit()
        run = window.menuBar().addMenu("&Run")
        run.addAction(self._add("run", "&Run", window.start_run, "F5", "run"))
        run.addAction(self._add("cancel", "&Cancel", window.cancel, "", "cancel"))

    def _make_export(self, menu: QMenu) -> None:
        exports = self.window.exports
        self.export = self._menu(menu, "export", "&Export")
        self.export.setToolTipsVisible(True)  # they say why something cannot be done
        for name, text, function, keys, image in (
            ("save_picture", "&Picture…", exports.picture, "Ctrl+P", "picture"),
            ("copy_picture", "&Copy picture", exports.copy_picture, "Ctrl+Shift+C", ""),
            ("export_film", "&Film of the steps…", exports.make_film, "", ""),
            ("export_quality", "&Quality as CSV…", exports.quality, "", ""),
            ("export_steps", "&Meshes of all steps…", exports.steps, "", ""),
        ):
            self.export.addAction(self._add(name, text, function, keys, image))

    def _menu(self, menu: QMenu, name: str, text: str) -> QMenu:
        """Return a new menu in a menu, with what it is for in the status bar."""
        made = menu.addMenu(text)
        made.menuAction().setStatusTip(tip_of(name, text))
        return made

    def _make_help(self) -> None:
        window = self.window
        menu = window.menuBar().addMenu("&Help")
        for name, text, function, keys in (
            ("shortcuts", "&Keyboard and mouse", window.help.shortcuts, "F1"),
            ("case_keys", "Case &keys", window.help.case_keys, ""),
            ("copy_details", "&Copy details for a bug report", window.help.copy_details, ""),
            ("about", "&About slideviz", window.help.about, ""),
        ):
            menu.addAction(self._add(name, text, function, keys))

    def _fill_recent(self) -> None:
        self.recent.clear()
        for path in self.window.files.recent():
            act = self.recent.addAction(str(path))
            act.triggered.connect(lambda _=False, path=path: self.window.files.open_path(path))
        if self.recent.isEmpty():
            self.recent.addAction("(none yet)").setEnabled(False)

    def _make_edit(self) -> None:
        store, standard = self.window.store, QKeySequence.StandardKey
        menu = self.window.menuBar().addMenu("&Edit")
        undo = partial(self._again, store.undo, "Undone")
        redo = partial(self._again, store.redo, "Done again")
        menu.addAction(self._add("undo", "&Undo", undo, standard.Undo, "undo"))
        menu.addAction(self._add("redo", "&Redo", redo, standard.Redo, "redo"))
        again = self.by_name["redo"]
        again.setShortcuts([*again.shortcuts(), QKeySequence("Ctrl+Y")])
        self.edit = menu

    def _again(self, step: Callable[[], None], done: str) -> None:
        """Undo or redo, and say in the status bar what that was."""
        store = self.window.store
        words = store.can_undo if step == store.undo else store.can_redo
        step()
        if words:
            self.window.say(f"{done}: {words}")

    def _make_view(self) -> None:
        window = self.window
        menu = window.menuBar().addMenu("&View")
        for name, keys in TOGGLES.items():
            term = SHOWN[name]
            act = self._add(name, term.name, None, keys, _ICONS.get(name, name))
            act.setCheckable(True)
            act.setToolTip(wrapped(f"{term.tip} ({keys})"))
            act.setStatusTip(term.tip)
            act.toggled.connect(partial(self._toggle, name))
            menu.addAction(act)
        menu.addSeparator()
        self.colours = self._menu(menu, "colours", "&Colours")
        change = window.store.change
        for name, text, function, keys in (
            (
                "fit_colours",
                "Fit to this step",
                partial(change, changes.fit_colours, every=False),
                "R",
            ),
            (
                "fit_all_colours",
                "Fit to all steps",
                partial(change, changes.fit_colours, every=True),
                "Shift+R",
            ),
            ("usual_colours", "As ever", partial(change, changes.set_view, colour_range=None), ""),
        ):
            self.colours.addAction(self._add(name, text, function, keys))
        menu.addAction(self._add("fit", "&Fit all", window.fit, "F", "fit"))
        sides = self._menu(menu, "look_from", "Look &from")
        for side, keys in {**SIDE_KEYS, "iso": "0"}.items():
            text = "isometric" if side == "iso" else side
            sides.addAction(self._add(f"side{side}", text, partial(window.look_from, side), keys))
        self.compare = self._menu(menu, "compare", "Co&mpare with")
        self.compare.aboutToShow.connect(lambda: fill_compare(self.compare, window.store))
        menu.addAction(self._add("show_all", "Show &all boundaries", window.show_all, "Shift+A"))
        for kind, row in SECTION_SHAPES.items():
            add = partial(self._add_section, kind)
            menu.addAction(self._add(f"add_{kind}", row.words[3].action, add, row.key))
        menu.addSeparator()
        steps = self._menu(menu, "steps", "&Steps")
        player = window.player
        for name, text, function, keys in (
            ("step_first", "Undeformed mesh", lambda: player.go(0), "Home"),
            ("step_previous", "Step back", lambda: player.step(-1), "Alt+Left"),
            ("step_play", "Play or pause", player.toggle, "Space"),
            ("step_next", "Step on", lambda: player.step(1), "Alt+Right"),
            ("step_last", "Last step", lambda: player.go(10**9), "End"),
        ):
            steps.addAction(self._add(name, text, function, keys))
        menu.addSeparator()
        themes = self._menu(menu, "theme", "&Theme")
        group = QActionGroup(window)
        for theme in THEMES:
            act = self._add(f"theme_{theme}", theme.capitalize())
            act.setCheckable(True)
            group.addAction(act)
            act.triggered.connect(lambda _=False, theme=theme: window.set_theme(theme))
            themes.addAction(act)
        menu.addAction(self._add("full_screen", "F&ull screen", window.toggle_full_screen, "F11"))
        self.panels = self._menu(menu, "panels", "&Panels")

    def _add_section(self, kind: str) -> None:
        self.window.docks_.lead_to("sections")
        self.window.docks_.panels["sections"].add[kind].click()

    def add_panels(self, docks) -> None:
        """Offer to show and hide the docks, and to put them back."""
        for dock in docks:
            act = dock.toggleViewAction()
            act.setStatusTip(f"Show or hide the panel {dock.windowTitle()}.")
            self.panels.addAction(act)
        self.panels.addSeparator()
        toggle = self.window.docks_.toggle_all
        self.panels.addAction(self._add("hide_panels", "&Hide or show all", toggle, "F9"))
        restore = self._add("restore_layout", "&Restore layout", self.window.restore_layout)
        self.panels.addAction(restore)

    def _toggle(self, name: str, checked: bool) -> None:
        if (name in self.window.store.session.view.drawn) != checked:
            self.window.store.change(changes.set_view, **{name: checked})

    def _sync_colours(self, session: Session) -> None:
        view = session.view
        valued = session.mesh is not None and view.colour_by != "role"
        for name in ("fit_colours", "fit_all_colours"):
            self.by_name[name].setEnabled(valued)
        usual = self.by_name["usual_colours"]
        usual.setText(usual_range(session))
        usual.setEnabled(valued and view.colour_range is not None)

    def _sync_export(self, session: Session, busy: bool) -> None:
        """Show which exports there can be, and say why not."""
        stepped, opened = len(session.frames) > 1, session.mesh is not None
        for name, able, why in (
            ("export_film", stepped, "There are no steps yet: run the case first."),
            ("export_steps", stepped and not busy, "There are no steps yet: run the case first."),
            ("export_quality", opened and not busy, "There is no mesh yet: open one first."),
        ):
            act = self.by_name[name]
            act.setEnabled(able)
            waits = "Wait for the end of what runs, or cancel it." if opened and busy else why
            tip = tip_of(name, act.text()) if able else waits
            act.setStatusTip(tip)
            act.setToolTip(wrapped(tip))
        # Where there is nothing to play, Space belongs to the button that has the focus.
        for name in STEPS:
            self.by_name[name].setEnabled(stepped)

    def set_icon_colour(self, colour: str) -> None:
        """Redraw the icons in another colour."""
        for name, image in self._icons.items():
            self.by_name[name].setIcon(icon(image, colour))
        self.bar.take_theme(colour)

    def sync(self, session: Session, busy: bool, ready: bool) -> None:
        """Show the session: what is checked, what can be done."""
        opened = session.mesh is not None
        for name in TOGGLES:
            act = self.by_name[name]
            act.blockSignals(True)
            act.setChecked(name in session.view.drawn)
            act.blockSignals(False)
            act.setEnabled(opened)
        flat = opened and session.mesh.dim == 2
        self.by_name["perspective"].setEnabled(opened and not flat)
        for side in (*SIDE_KEYS, "iso"):
            self.by_name[f"side{side}"].setEnabled(opened and not flat)
        for kind, row in SECTION_SHAPES.items():
            act, words = self.by_name[f"add_{kind}"], row.words.get(2 if flat else 3)
            act.setVisible(words is not None)
            act.setEnabled(opened and words is not None)
            if words is not None:
                act.setText(words.action)
        store = self.window.store
        for name, what in (("undo", store.can_undo), ("redo", store.can_redo)):
            act = self.by_name[name]
            act.setEnabled(bool(what))
            act.setText(f"{name.capitalize()} {what}".rstrip())
            said = act.text() if what else tip_of(name, "")
            act.setToolTip(f"{said} ({act.shortcut().toString()})")
        for name in ("save_case", "save_picture", "copy_picture", "fit", "show_all"):
            self.by_name[name].setEnabled(opened)
        self._sync_colours(session)
        self._sync_export(session, busy)
        self.compare.setEnabled(session.deformed is not None)
        self.by_name["save_mesh"].setEnabled(opened and not busy)
        self.by_name["run"].setEnabled(ready and not busy)
        self.by_name["cancel"].setEnabled(busy)
        self.bar.sync(session)
