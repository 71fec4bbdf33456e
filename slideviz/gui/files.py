"""Opening and saving of files, with the questions to the user before."""

from __future__ import annotations

import logging
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qtpy.QtCore import QObject, QSettings, QStandardPaths, QTimer

from slideviz.errors import SlidevizError
from slideviz.formats.files import is_source
from slideviz.formats.losses import left_out
from slideviz.formats.openfoam_paths import folder_of, mesh_path, shown_name, stem_of
from slideviz.formats.table import FORMATS, format_for, usual_ending
from slideviz.gui.panels.designs import DesignsPanel
from slideviz.gui.widgets import questions
from slideviz.mesh.interfaces import torn_interfaces
from slideviz.samples.table import SAMPLES
from slideviz.session import changes, jobs
from slideviz.session.design_table import DesignTable
from slideviz.session.run_messages import stopped_words
from slideviz.session.saving import Unsaved, continued_case, files_beside, files_of, view_to_case
from slideviz.session.session_file import ENDING, MissingMeshError
from slideviz.session.state import Session
from slideviz.system.atomic import write_whole

if TYPE_CHECKING:
    from slideviz.gui.window import MainWindow

log = logging.getLogger("slideviz")
RECENT = 10  # number of recent files that are remembered


class Files(QObject):
    """Opens and saves the files of a window, and remembers recent ones.

    Closing the window with unsaved work: `MainWindow.closeEvent` calls `ask_about_unsaved`, which
    takes the text and what can be saved from `slideviz.session.saving.Unsaved`, and the answer
    from `slideviz.gui.widgets.questions.ask_unsaved`. Opening another file asks the same way.
    """

    def __init__(self, window: MainWindow, settings: QSettings) -> None:
        super().__init__(window)
        self.window = window
        self.settings = settings
        self.sizes = {name: jobs.SIZES.get(name, row.size) for name, row in SAMPLES.items()}
        self.samples = {name: row.words(self.sizes[name]) for name, row in SAMPLES.items()}
        self._saved_to: Path | None = None
        self.saving = False
        self._answered = False
        self.after_save: Callable[[], object] | None = None
        self._again: Callable[[Path], object] = lambda _: None
        window.running.ended.connect(lambda: setattr(self, "saving", False))
        window.runner.failed.connect(self._failed)

    # Open ------------------------------------------------------------------------------
    def recent(self) -> list[Path]:
        """Return the files used last, the latest first."""
        listed: Any = self.settings.value("recent", [], type=list)
        return [Path(text) for text in listed]

    def remember(self, path: Path) -> None:
        """Put a file at the top of the recent ones."""
        every = [path, *(other for other in self.recent() if other != path)][:RECENT]
        self.settings.setValue("recent", [str(each) for each in every])
        self.settings.setValue("folder", str(folder_of(path)))

    def folder(self) -> Path:
        """Return the folder in which file dialogs start: that of the last file, if it exists.

        Else the working directory, or the home folder if that is the root or not writable.
        """
        path = Path(str(self.settings.value("folder", "")))
        if self.settings.value("folder", "") and path.is_dir():
            return path
        here = Path.cwd()
        return here if here != Path(here.anchor) and os.access(here, os.W_OK) else Path.home()

    def ask_and_open(self) -> None:
        """Ask for a mesh or case, first in the folder of the open one, and open it."""
        session = self.window.store.session
        folder = self.folder()
        here = session.case.source or session.path
        if here is not None and here.parent.is_dir() and sample_folder() not in here.parents:
            folder = folder_of(here)
        if path := questions.ask_open(self.window, folder):
            self.open_path(path)

    def open_path(self, path: Path, zone: int | None = None) -> None:
        """Ask about unsaved work, then start the job that opens a mesh or case.

        What is not a file at all is told without a question.
        """
        path = mesh_path(Path(path))
        try:
            jobs.require_openable(path)
        except SlidevizError as error:
            self.window.banner.show_error(error)
            log.error("%s", error)
            return
        if self.ask_about_unsaved(lambda: self.open_path(path, zone)):
            self.start_opening(path.absolute(), zone, self._opened)

    def start_opening(
        self,
        path: Path,
        zone: int | None,
        done: Callable[[jobs.Opened], object],
        mesh: Path | None = None,
    ) -> None:
        """Start the job that opens a file; ``mesh``: where the user says that its mesh is."""
        self._again = partial(self.start_opening, path, zone, done)
        job = partial(jobs.open_file, mesh_file=mesh, unpacked=sample_folder())
        self.window.running.start_job(f"Opening {shown_name(path)}", done, job, path, zone)

    def _failed(self, error: Exception) -> None:
        if isinstance(error, MissingMeshError):
            find = {"Find the mesh…": self._find_mesh}
            self.window.banner.show_message(str(error), calm=False, answers=find)

    def _find_mesh(self) -> None:
        if mesh := questions.ask_open(self.window, self.folder()):
            self._again(mesh)

    def open_zone(self, zone: int) -> None:
        """Open a zone of the file, from 1; or with 0 all of them."""
        session = self.window.store.session
        if session.mesh is None or session.path is None or zone == (session.mesh.zone or 0):
            return
        self.open_path(session.path, zone or None)
        self.window.sync_actions()

    def ask_and_open_sample(self) -> None:
        """Ask for a sample and its size, and open it."""
        if found := questions.ask_sample(self.window, self.samples, self.sizes):
            self.open_sample(found[0], size=found[1])

    def open_sample(self, name: str, run: bool = False, size: int | None = None) -> None:
        """Start the job that writes a sample case to `sample_folder` and opens (and runs) it."""
        if not self.ask_about_unsaved(lambda: self.open_sample(name, run, size)):
            return
        self.window.running.start_job(
            f"Opening the sample {name}",
            self._opened_to_run if run else self._opened,
            partial(jobs.open_sample, size=size),
            name,
            sample_folder(),
        )

    def try_sample(self, name: str) -> None:
        """Open a sample case and deform it at once."""
        self.open_sample(name, run=True)

    def _opened_to_run(self, opened: jobs.Opened) -> None:
        self._opened(opened)
        self.window.start_run()

    def _opened(self, opened: jobs.Opened) -> None:
        session = opened.session
        self._saved_to = None
        path = session.case.source or session.path
        if path is not None and sample_folder() not in path.parents:
            self.remember(path)
        self.window.show_opened(opened)
        self._designs.written = self._designs.table
        mesh = session.mesh
        counts = *reversed(mesh.file_counts), len(mesh.markers)
        words = "opened %s: %dD, %d cells, %d points, %d boundaries"
        log.info(words, session.path, mesh.dim, *counts)

    def ask_about_unsaved(
        self, again: Callable[[], object], before: str = "opening another mesh"
    ) -> bool:
        """Ask about unsaved work; return whether it may be dropped or was saved.

        ``again``: repeats the action; called after a job has saved the mesh, for which False is
        returned. ``before``: what the user wants to do that would lose the changes, in words.
        """
        window = self.window
        unsaved = self._unsaved()
        if self._answered or not unsaved.lost:
            return True
        can_save = unsaved.can_save

        def now() -> str:
            """Return the question as it is now; "" where it is another one, as a run has ended."""
            present = self._unsaved()
            return present.question(before) if present.can_save == can_save else ""

        answer = questions.ask_unsaved(window, unsaved.question(before), can_save, now)
        if answer == "again":
            return self.ask_about_unsaved(again, before)
        if answer == "run":  # what its end leaves unsaved is asked about then
            window.running.cancel(lambda: QTimer.singleShot(0, again))
            return False
        # The question named everything unsaved: nothing is asked about again.
        if answer in ("mesh", "session"):
            save = partial(self.save_mesh, last=True) if answer == "mesh" else self.save_session
            save(then=lambda: self._confirmed(again))
            return False
        savers = {"case": self.save_case, "table": self._designs.save_table}
        return savers[answer]() if answer in savers else answer != "cancel"

    def _unsaved(self) -> Unsaved:
        window = self.window
        return Unsaved.of(window.store.session, window.runner.busy, self._designs.unsaved)

    @property
    def _designs(self) -> DesignsPanel:
        return self.window.dock_manager.panel(DesignsPanel)

    def _confirmed(self, again: Callable[[], object]) -> None:
        """Call ``again`` with `ask_about_unsaved` returning True."""
        self._answered = True
        try:
            again()
        finally:
            self._answered = False

    # Save ------------------------------------------------------------------------------
    def stem(self) -> str:
        """Return the stem of file names that dialogs suggest: that of the case or the mesh."""
        session = self.window.store.session
        path = session.case.source or session.path
        return stem_of(path) if path is not None else "mesh"

    def save_mesh(self, last: bool = False, then: Callable[[], object] | None = None) -> None:
        """Ask for a file name and start the job that writes the mesh of the shown (or last) step.

        ``then`` is called when it is written.
        """
        session = changes.end_preview(self.window.store.session)
        frame = session.frames[-1] if last and session.frames else session.frame
        if frame is None or self.window.runner.busy:
            return
        run = session.run_shown
        whole = frame is session.frames[-1]
        stopped = stopped_words(run) if whole else ""
        step = f"_step{session.view.frame}"
        if whole:
            step = f"_step{len(run.frames)}of{run.planned}" if stopped else "_deformed"
        default = self.folder() / f"{self.stem()}{step}{usual_ending(session.opened_mesh)}"
        filters = questions.mesh_filters(session.opened_mesh)
        title = f"Save mesh: {run.progress_words}" if stopped else "Save mesh"
        path = questions.ask_save(self.window, title, default, filters)
        if path is None:
            return
        overwrite = is_source(path, session.opened_mesh)
        if overwrite and not questions.ask_overwrite_input(self.window, path):
            return
        self.settings.setValue("folder", str(path.parent))
        torn = torn_interfaces(session.opened_mesh, frame.mesh.points)
        said = (stopped, *(f"{each[0].upper()}{each[1:]}." for each in torn))
        self.saving = True
        self.after_save = then
        self.window.running.start_job(
            f"Saving {path.name}",
            lambda saved: self._mesh_saved(saved, whole, said),
            partial(jobs.save_mesh, base=session.opened_mesh),
            path,
            frame,
            overwrite,
        )

    def continue_run(self) -> None:
        """Save the mesh of the last step, and open it with the case, for a further motion."""
        self.save_mesh(last=True, then=self._open_saved)

    def _open_saved(self) -> None:
        path = self._saved_to
        assert path is not None
        session = self.window.store.session
        if self.ask_about_unsaved(self._open_saved, "opening the deformed mesh"):
            job = partial(jobs.open_file, case=continued_case(session, path))
            self.window.running.start_job(
                f"Opening {shown_name(path)}", self._opened, job, path, None
            )

    def ask_output(self) -> Path | None:
        """Ask for the deformed mesh's file, not that of a mesh that stays in its file; or None."""
        session = self.window.store.session
        default = session.case.mesh_out or self.folder() / f"{self.stem()}_deformed.su2b"
        path = questions.ask_save(
            self.window, "Deformed mesh", default, questions.mesh_filter(FORMATS[".su2b"])
        )
        if path is None or not is_source(path, session.opened_mesh):
            return path
        self.window.banner.show_error(
            SlidevizError(
                f"{path} is the mesh itself, which is still being read; give another name"
            )
        )
        return None

    def _mesh_saved(self, path: Path, last: bool, remarks: tuple[str, ...]) -> None:
        if last:
            self._saved_to = path
            self.window.store.change(changes.saved_mesh)
        self.window.show_status(f"Saved {path}")
        mesh = self.window.store.session.mesh
        said = [left_out(path, mesh)] if mesh is not None else []
        said += remarks
        if any(said):
            self.window.banner.show_message(" ".join(["Saved.", *filter(None, said)]))
        if self.after_save is not None:
            QTimer.singleShot(0, self.after_save)

    def _beside(self, ending: str) -> Path:
        """Return the name of the open case or session, with another ending."""
        source = self.window.store.session.case.source
        folder = self.folder()
        if source is not None and sample_folder() not in source.parents:
            folder = source.parent
        return folder / f"{self.stem()}{ending}"

    def save_session(self, then: Callable[[], object] | None = None) -> None:
        """Ask for a file name and start the job that writes the session: case, runs, designs.

        ``then`` is called when it is written.
        """
        session = self.window.store.session
        if session.mesh is None or self.window.runner.busy:
            return
        path, with_mesh = questions.ask_session(self.window, self._beside(ENDING))
        if path is None:
            return
        # Those of samples are in a cache.
        files = files_of(session.case)
        copied = [one for one in files if with_mesh or sample_folder() in one.parents]
        designs = self._designs.table, self._designs.case
        self.saving = True
        self.after_save = then
        self.window.running.start_job(
            f"Saving {path.name}",
            partial(self._session_saved, session, designs[0]),
            jobs.save_session,
            path,
            session,
            designs,
            self.window.scene.camera.view,
            copied,
        )

    def _session_saved(self, session: Session, designs: DesignTable, path: Path) -> None:
        self.window.store.change(changes.saved_session, session, path)
        self._designs.written = designs
        self.remember(path)
        self.window.show_status(f"Saved {path}")
        if self.after_save is not None:
            QTimer.singleShot(0, self.after_save)

    def save_case(self) -> bool:
        """Ask for a file name and write the case; return whether it was written."""
        session = self.window.store.session
        if session.mesh is None:
            return False
        default = self._beside(".cfg")
        path = questions.ask_save(self.window, "Save case", default, questions.CASE_FILTERS)
        if path is None:
            return False
        if not self._copy_sample_files(path):
            return False
        session = self.window.store.session
        case = session.case
        if self._saved_to is not None and format_for(self._saved_to).solver:
            case = case.change(mesh_out=self._saved_to)
        with self.window.banner.showing_errors():
            view_to_case(replace(session, case=case), self.window.scene.camera.view).write(path)
            self.window.store.change(changes.saved_case, replace(case, source=path))
            self.remember(path)
            self.window.show_status(f"Saved {path}")
            if case.mesh_file is not None and not case.mesh_file.is_file():
                self.window.banner.show_message(
                    f"Saved. But its mesh {case.mesh_file} no longer exists: the case cannot be "
                    f"opened without it. Put it back, or save the mesh under that name (step 0)."
                )
            return True
        return False

    def _copy_sample_files(self, path: Path) -> bool:
        """Copy the files of a sample, which are in a cache, beside the case that is being saved.

        Return False if the user declines to replace a file, or a copy fails.
        """
        moved = files_beside(self.window.store.session.case, path, sample_folder())
        there = [target for target in moved.values() if target.exists()]
        if there and not questions.ask_replace(self.window, there):
            return False
        with self.window.banner.showing_errors():
            for file, target in moved.items():
                write_whole(target, file.read_bytes())
            if moved:
                self.window.store.change(changes.moved_files, moved)
            return True
        return False


def sample_folder() -> Path:
    """Return the folder in the user's cache into which sample cases are written."""
    places = QStandardPaths.standardLocations(QStandardPaths.StandardLocation.CacheLocation)
    return Path(places[0] if places else tempfile.gettempdir()) / "slideviz-samples"
