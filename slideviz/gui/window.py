"""The main window: the views in the middle, the panels around them, menus and tool bar."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from qtpy.QtCore import QSettings, QSize, Qt, QTimer
from qtpy.QtGui import QAction, QActionGroup, QCloseEvent, QDragEnterEvent, QDropEvent
from qtpy.QtWidgets import (
    QGridLayout,
    QLabel,
    QLineEdit,
    QMenu,
    QMenuBar,
    QSpinBox,
    QToolBar,
    QWidget,
)

from slideviz.case.motion_words import mesh_words
from slideviz.color_scheme import ColorScheme
from slideviz.formats.openfoam_paths import shown_name
from slideviz.gui.autosave import Autosave, SessionRecovery
from slideviz.gui.background import (
    READING,
    IntersectionCheck,
    LimitCheck,
    LivePreview,
    SectionReader,
)
from slideviz.gui.commands import COMMANDS, MENUS, CommandState, Menu, holds
from slideviz.gui.dialogs.exports import Exports
from slideviz.gui.dialogs.help import Help
from slideviz.gui.docks import Docks, available_area
from slideviz.gui.files import Files
from slideviz.gui.panels.boundaries import BoundariesPanel
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.panels.log import LogPanel
from slideviz.gui.panels.method import MethodPanel
from slideviz.gui.panels.motions import MotionPanel
from slideviz.gui.panels.run import RunPanel
from slideviz.gui.responsiveness.threads import WarmupThread
from slideviz.gui.running import Running
from slideviz.gui.start import StartPage
from slideviz.gui.viewport.flat_views import SectionViews
from slideviz.gui.viewport.player import Player
from slideviz.gui.viewport.viewing import Viewing
from slideviz.gui.widgets import theme
from slideviz.gui.widgets.banner import Banner
from slideviz.gui.widgets.build import (
    ALIGN_LEFT,
    Choice,
    ElidedLabel,
    in_column,
    plain_labels,
    reveal,
    set_policy,
    tool_button,
    wrapped,
)
from slideviz.gui.widgets.error_reporter import ErrorReporter
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.services import Services
from slideviz.gui.widgets.theme import redraw_icons
from slideviz.mesh.model import Mesh
from slideviz.session import changes, jobs
from slideviz.session.colors import not_drawable
from slideviz.session.measure import measure_words
from slideviz.session.motions import boxes_hint, support_case, support_key, support_words
from slideviz.session.run_messages import Requirement, run_requirements
from slideviz.session.saving import title_of
from slideviz.session.state import Session
from slideviz.session.store import Store
from slideviz.system.file_checks import protected
from slideviz.terms import COLOR_BY, SHOWN, labels


class Actions:
    """The actions of the main window."""

    def __init__(self, window: MainWindow) -> None:
        self.window = window
        self.by_name: dict[str, QAction] = {}
        self.menus: dict[str, QMenu] = {}
        self._tables: dict[str, Menu] = {}
        for menu in MENUS:
            self._make(window.menuBar(), menu)
        self.bar = ToolBar(window, self)
        window.addToolBar(self.bar)
        window.store.listen(self._explain_colors)
        window.store.listen(self._explain_support)
        window.store.listen(self._explain_measure)

    def _make(self, above: QMenu | QMenuBar, table: Menu) -> None:
        menu = self.menus[table.name] = above.addMenu(table.title)
        self._tables[table.name] = table
        menu.menuAction().setStatusTip(table.tip)
        menu.setToolTipsVisible(table.tooltips)
        if table.fill is not None and table.entries:
            table.fill(self.window, menu)
        elif table.fill is not None:
            menu.aboutToShow.connect(partial(table.fill, self.window, menu))
        group = QActionGroup(menu) if table.one_of else None
        for entry in table.entries:
            if entry is None:
                menu.addSeparator()
            elif isinstance(entry, Menu):
                self._make(menu, entry)
            else:
                act = self.by_name[entry.name] = entry.action(self.window)
                menu.addAction(act)
                if group is not None:
                    group.addAction(act)

    def _explain_colors(self, old: Session, new: Session) -> None:
        why = not_drawable(new)
        if why and why != not_drawable(old):
            self.window.show_status(why)

    def _explain_support(self, old: Session, new: Session) -> None:
        """Say the support radius when it is switched on, and when it changes while it is drawn."""
        if new.mesh is None or new.mesh is not old.mesh or "support" not in new.view.drawn:
            return
        before = support_case(old)
        now = support_case(new)
        changed = before is not now and support_key(before, new.mesh) != support_key(now, new.mesh)
        if changed or "support" not in old.view.drawn:
            self.window.show_status(support_words(new))

    def _explain_measure(self, old: Session, new: Session) -> None:
        if new.view.picks is None and old.view.picks is None:
            return
        before = old.view.picks, old.frame, old.frame_beside
        if before != (new.view.picks, new.frame, new.frame_beside):
            self.window.statusBar().showMessage(measure_words(new))

    def sync(self, now: CommandState) -> None:
        for name, command in COMMANDS.items():
            command.show(self.by_name[name], now)
        for name, table in self._tables.items():
            self.menus[name].setEnabled(holds(table.needs, now))
        self.bar.sync(now)


class ToolBar(QToolBar):
    """The tool bar: the commands used most, the quantity to color by, and the zone."""

    def __init__(self, window: MainWindow, actions: Actions) -> None:
        super().__init__("Tools")
        self.setObjectName("tools")
        self.setMovable(False)
        self.setIconSize(QSize(20, 20))
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self._actions = actions
        self._add("open", "save_mesh", "save_case", "save_picture")
        self.addSeparator()
        self._add("undo", "redo")
        self.addSeparator()
        self.addWidget(QLabel(" Color by "))
        tip = "What the colors of the view show; the panel Display has their range."
        self.color = Choice(labels(COLOR_BY), tip, "color_by")
        self.color.chosen.connect(
            lambda value: window.store.change(changes.set_view, color_by=value)
        )
        self.color.setFixedWidth(self.color.fontMetrics().horizontalAdvance("m" * 16))
        self.addWidget(self.color)
        menu = actions.menus["colors"]
        self.range = tool_button(
            menu.menuAction().statusTip(), image="colors", menu=menu, name="color_range"
        )
        self.addWidget(self.range)
        self.addSeparator()
        self._add(*(name for name, term in SHOWN.items() if term.in_bar))
        self.addSeparator()
        self._add("fit", *(name for name, command in COMMANDS.items() if command.short))
        space = QWidget()
        set_policy(space, "Expanding", "Preferred")
        self.addWidget(space)
        self.zone = Choice({}, "Which zones of the file are open: all, or one.", "zone")
        self.zone.chosen.connect(window.files.open_zone)
        self.zone_label = self.addWidget(QLabel(" Zone "))
        self.zone_shown = self.addWidget(self.zone)

    def _add(self, *names: str) -> None:
        self.addActions([self._actions.by_name[name] for name in names])

    def sync(self, now: CommandState) -> None:
        session: Session = now.session
        mesh = session.mesh
        self.color.setEnabled(mesh is not None)
        self.range.setEnabled(COMMANDS["fit_colors"].enabled(now))
        self.color.show_value(session.view.color_by)
        zones = mesh.zones if mesh is not None else 1
        one_by_one = {zone: f"{zone} of {zones}" for zone in range(1, zones + 1)}
        self.zone.offer({0: f"all {zones}"} | one_by_one)
        self.zone.show_value((mesh.zone or 0) if mesh is not None else 0)
        for shown in (self.zone_label, self.zone_shown):
            shown.setVisible(zones > 1)


log = logging.getLogger("slideviz")


class MainWindow(Services):
    """The main window of slideviz.

    ``settings`` keep recent files, theme and layout; by default those of the user.
    ``multi_samples``: samples per pixel for antialiasing in the views; 0 for none, which is the
    fastest. ``kept``: the folder for autosaved sessions; without it nothing is autosaved.
    """

    def __init__(
        self, settings: QSettings | None = None, multi_samples: int = 4, kept: Path | None = None
    ) -> None:
        super().__init__()
        self.settings = settings or QSettings("slideviz", "slideviz")
        self.setObjectName("slideviz")
        room = available_area(self).size()
        self.setMinimumSize(QSize(900, 620).boundedTo(room))
        self.resize(QSize(1280, 800).boundedTo(room))
        self.setAcceptDrops(True)
        # Before there are widgets: a later style sheet would polish each of them again.
        scheme = self._choose_theme(str(self.settings.value("theme", "system")))
        self.store = Store()
        self.banner = Banner()
        self.recovery_banner = Banner()
        self.error_reporter = ErrorReporter(self.banner, self)
        self.store.failed = self.error_reporter.show
        self.running = Running(self.store, self.banner, self)
        self.runner = self.running.runner
        self.live = LivePreview(self.store, self.running, self)
        self.files = Files(self, self.settings)
        self.exports = Exports(self)
        self.help = Help(self)
        self._closed = False
        self.left_behind = False
        self._kept = ExitStack()
        self._kept.enter_context(protected(self._inputs))
        self._make_centre(multi_samples)
        self.dock_manager = Docks(self)
        self.docks = self.dock_manager.by_name
        panel = self.dock_manager.panel
        self.boundaries = panel(BoundariesPanel)
        self.motions = panel(MotionPanel)
        self.method = panel(MethodPanel)
        self.run_panel = panel(RunPanel)
        self.centre.insertWidget(0, self.run_panel.strip)
        self._make_status()
        self.actions_table = Actions(self)
        self._connect()
        self._take_scheme(scheme)
        self.dock_manager.restore(self.settings)
        self.store.listen(self.viewing.sync)
        self.store.listen(lambda *_: self.sync_actions())
        self.intersection_check = IntersectionCheck(self.store, self)
        self.limit_check = LimitCheck(self.store, self)
        self.section_reader = SectionReader(self.store, self)
        self.section_reader.finished.connect(self.section_views.redraw)
        self.section_reader.progressed.connect(self._say_reading)
        self.warmup = WarmupThread(self)
        self.warmup.compiling.connect(self.preparing.setVisible)
        self.warmup.compiling.connect(self.run_panel.set_compiling)
        self._keep_session(kept)
        plain_labels(self)
        self.sync_actions()

    # Parts -----------------------------------------------------------------------------
    def _make_centre(self, multi_samples: int) -> None:
        centre = QWidget()
        stack = QWidget()
        grid = QGridLayout(stack)
        grid.setContentsMargins(0, 0, 0, 0)
        # The start page covers the view, which must be shown to have a size.
        self.viewing = Viewing(self.store, multi_samples, stack)
        self.view = self.viewing.view
        self.scene = self.viewing.scene
        self.section_views = SectionViews(self.viewing, multi_samples, stack)
        self.start = StartPage(self.files.samples, stack)
        self.start.setAutoFillBackground(True)
        grid.addWidget(self.section_views, 0, 0)
        grid.addWidget(self.start, 0, 0)
        self.start.raise_()
        self.start.show_recent(self.files.recent())
        self.player = Player(self.store)
        parts = (self.banner, self.recovery_banner, stack, self.player)
        self.centre = in_column(*parts, wide=[stack], spacing=0, on=centre)
        self.setCentralWidget(centre)

    def _inputs(self) -> Mapping[Path, str]:
        return self.store.session.inputs()

    def _make_status(self) -> None:
        self.mesh_text = QLabel()
        self._measured: Mesh | None = None
        self.preparing = QLabel("Compiling, once… ")
        self.preparing.setToolTip(
            wrapped(
                "slideviz compiles its numerics, once after each installation. Jobs that need "
                "them wait."
            )
        )
        self.preparing.hide()
        self.said = ElidedLabel(mode=Qt.TextElideMode.ElideMiddle)
        self.said.setAlignment(ALIGN_LEFT)
        self.statusBar().messageChanged.connect(self._say)
        self.statusBar().addPermanentWidget(self.said, 1)  # no room is left for Qt's, which is cut
        self.statusBar().addPermanentWidget(self.preparing)
        self.statusBar().addPermanentWidget(self.mesh_text)
        self.statusBar().setSizeGripEnabled(False)

    def _connect(self) -> None:
        running = self.running
        panel = self.run_panel
        for shows in (panel, self.start):
            running.began.connect(shows.set_busy)
            running.progressed.connect(shows.show_progress)
            running.ended.connect(partial(shows.set_busy, ""))
        running.cancelling.connect(panel.show_cancelling)
        # The deformed mesh may be out of view.
        running.ended.connect(self.viewing.refit)
        for change in (running.began, running.ended):
            change.connect(lambda *_: self.sync_actions())
        running.status_changed.connect(self.show_status)
        self.viewing.status_changed.connect(self.show_status)
        panel.requirement_clicked.connect(self.focus_requirement)
        self.dock_manager.panel(DesignsPanel).changed.connect(self.sync_actions)
        self.start.file_wanted.connect(self.files.open_path)
        self.start.sample_wanted.connect(self.files.open_sample)
        self.start.try_wanted.connect(self.files.try_sample)

    def toggle_full_screen(self) -> None:
        self.setWindowState(self.windowState() ^ Qt.WindowState.WindowFullScreen)

    def _keep_session(self, folder: Path | None) -> None:
        self.autosave: Autosave | None = None
        self.recovery: SessionRecovery | None = None
        if folder is not None:
            designs = self.dock_manager.panel(DesignsPanel)
            self.autosave = Autosave(
                self.store,
                folder,
                lambda: self.scene.camera.view,
                lambda: (designs.table, designs.case),
                self,
            )
            designs.changed.connect(self.autosave.schedule)
            self.recovery = SessionRecovery(self, self.recovery_banner, self.autosave)

    # The session -----------------------------------------------------------------------
    def sync_actions(self) -> None:
        """Update menus, tool bar, window title, and the facts of the mesh in the status bar."""
        session = self.store.session
        self.actions_table.sync(
            CommandState(
                session,
                busy=self.runner.busy,
                ready=self.run_panel.run.isEnabled(),
                undo=self.store.can_undo,
                redo=self.store.can_redo,
                theme=str(self.settings.value("theme")),
                live=self.live.is_on,
            )
        )
        self.setWindowTitle(title_of(session))
        if session.mesh is not None and session.mesh is not self._measured:
            self._measured = session.mesh
            words, about = mesh_words(session.mesh)
            self.mesh_text.setText(f"{words} ")
            self.mesh_text.setToolTip(about)

    def show_opened(self, opened: jobs.Opened) -> None:
        """Show a mesh or case that was just opened, in place of the present one."""
        session = opened.session
        if not opened.has_view:
            session = changes.inherit_view(session, self.store.session.view)
        self.banner.hide()
        self.start.hide()
        self.exports.end()
        self.player.stop()
        self.viewing.open(opened, session)
        self.store.put(session)
        if opened.content is not None:
            content = opened.content
            self.dock_manager.panel(DesignsPanel).restore(content.designs, content.designs_case)
        if opened.remark:
            self.banner.show_message(opened.remark, calm=False)
        remarks = () if session.mesh is None else session.mesh.remarks
        for remark in remarks:
            log.warning("%s", remark)
        notes = [*remarks, boxes_hint(session)]
        if session.lacks_cells:
            self.banner.show_message("\n".join(remarks))
            notes = [boxes_hint(session)]
        file = session.case.source or session.path
        assert file is not None
        words = "".join(f". {text}" for text in notes if text)
        self.show_status(f"Opened {shown_name(file)}{words}")

    # Jobs ------------------------------------------------------------------------------
    def start_run(self) -> None:
        """Start a run; if the mesh stays in its file, ask for the deformed mesh's file first."""
        session = self.store.session
        if isinstance(self.focusWidget(), QLineEdit | QSpinBox):
            self.view.setFocus()  # a field would keep Home, End and Space from the player
        if not session.lacks_cells or self.runner.busy or run_requirements(session):
            self.running.start_run()
            return
        # The deformed mesh would not fit into memory either.
        output = self.files.ask_output()
        if output is not None:
            self.running.start_run(output)

    def toggle_live(self) -> None:
        """Let the mesh follow the hand, or no longer."""
        self.live.switch(not self.live.is_on)
        self.settings.setValue("live", self.live.is_on)
        self.sync_actions()

    def show_status(self, text: str) -> None:
        """Show a short message in the status bar for 8 s; an empty text clears it."""
        self.statusBar().showMessage(text, 8000)

    def _say(self, text: str) -> None:
        self.said.setText(text)
        self.said.setToolTip(wrapped(text))

    def _say_reading(self, text: str) -> None:
        """Show the progress of reading a section; an empty text clears only such a message."""
        if text or self.statusBar().currentMessage().startswith(READING):
            self.show_status(text)

    # The view --------------------------------------------------------------------------
    def focus_requirement(self, missing: Requirement) -> None:
        """Bring the panel to the front where a missing requirement is met, and focus the field."""
        if missing.place == "open":
            self.files.ask_and_open()
            return
        self.dock_manager.bring_to_front(missing.place)
        panel = self.dock_manager.panels[missing.place]
        if isinstance(panel, Panel):
            panel.focus_requirement(missing)

    def set_theme(self, name: str) -> None:
        """Change to a theme: ``light``, ``dark``, or ``system`` for that of the desktop."""
        self._take_scheme(self._choose_theme(name))

    def _choose_theme(self, name: str) -> ColorScheme:
        name = name if name in theme.THEMES else "system"
        self.settings.setValue("theme", name)
        return theme.apply(name)

    def _take_scheme(self, scheme: ColorScheme) -> None:
        redraw_icons(self)
        self.sync_actions()
        # Texts about inverted cells have the theme's red.
        self.player.sync(self.store.session)
        for panel in self.findChildren(Panel):
            panel.take_theme(scheme)
        self.section_views.set_scheme(scheme)
        self.viewing.set_scheme(scheme)

    # Qt --------------------------------------------------------------------------------
    def focusNextPrevChild(self, forwards: bool) -> bool:
        moved = super().focusNextPrevChild(forwards)
        first = self.focusWidget()
        # For Qt a field behind a tab is visible: what is typed would change it unseen.
        while moved and self.dock_manager.is_behind(self.focusWidget()):
            moved = super().focusNextPrevChild(forwards) and self.focusWidget() is not first
        reveal(self.focusWidget())
        return moved

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        paths = [Path(url.toLocalFile()) for url in event.mimeData().urls() if url.isLocalFile()]
        if paths:
            event.acceptProposedAction()
            # After the drop: a modal question now would block the program it came from.
            QTimer.singleShot(0, lambda: self.files.open_path(paths[0]))

    def closeEvent(self, event: QCloseEvent) -> None:
        # What counts as unsaved, and the question: `Files.ask_about_unsaved`.
        if not self._closed:
            if self.files.saving:
                self.show_status("The window closes when the file is saved")
                self.files.after_save = self.close
                event.ignore()
                return
            if not self.files.ask_about_unsaved(self.close, "closing"):
                event.ignore()
                return
            self._closed = True
            self.dock_manager.save(self.settings)
            self.hide()
            # The jobs before the views: a job may still add a step, which is drawn.
            self.player.stop()
            self.exports.end()
            self.dock_manager.panel(DesignsPanel).runner.close()
            self.warmup.close()
            self.intersection_check.close()
            self.limit_check.close()
            self.live.close()
            self.section_reader.close()
            self.left_behind = not self.running.close()
            if self.autosave is not None:
                self.autosave.close()
            self.dock_manager.panel(LogPanel).detach()
            self.section_views.close_views()
            self.viewing.close_views()
            self._kept.close()
        super().closeEvent(event)
