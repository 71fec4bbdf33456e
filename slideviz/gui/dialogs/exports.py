"""The exports of the window: pictures, films, tables of quality, meshes of all steps."""

from __future__ import annotations

import logging
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING

from qtpy.QtCore import QObject
from qtpy.QtWidgets import QApplication, QWidget

from slideviz.export.flat_section import save_section
from slideviz.export.html_report import write_html_report
from slideviz.export.offscreen import LETTERS, WEB_PAGE
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.export.vector import SUFFIXES, write_vector
from slideviz.formats.table import FORMATS, format_for, own_endings, usual_ending
from slideviz.gui.dialogs.pictures import (
    FilmDialog,
    PictureDialog,
    WheelDialog,
    copy_image,
    picture_filters,
    to_image,
    wait_cursor,
)
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.plot_canvas import PLOT_FILTERS
from slideviz.gui.widgets.services import Services
from slideviz.plots.section_picture import SectionStyle
from slideviz.session import changes, jobs
from slideviz.session.measure import measure_words
from slideviz.session.motions import shown_case, wheel_passages
from slideviz.session.scripts import SCRIPTS
from slideviz.session.state import Session

if TYPE_CHECKING:
    from slideviz.design.deformed_wheel import WheelQuality

log = logging.getLogger("slideviz")
COPIED_WIDTH = 1600  # least width of a picture on the clipboard, in pixels


class Exports(QObject):
    """The exports of a window: each method asks for options and file name, then writes."""

    def __init__(self, window: Services) -> None:
        super().__init__(window)
        self.window = window
        self.film: FilmDialog | None = None

    @property
    def _session(self) -> Session:
        return self.window.store.session

    def _ask(
        self, title: str, end: str, filters: str, parent: QWidget | None = None
    ) -> Path | None:
        """Ask for a file, by default that of the case or mesh with another end; or None."""
        files = self.window.files
        default = files.folder() / f"{files.stem()}{end}"
        return questions.ask_save(parent or self.window, title, default, filters)

    def _renderer(self) -> OffscreenRenderer:
        viewing = self.window.viewing
        return OffscreenRenderer(self._session, viewing.surfaces, viewing.scene)

    def _size(self) -> tuple[int, int]:
        """Return the size in pixels of a picture of the view."""
        view = self.window.viewing
        width = max(view.width(), 64)
        larger = max(COPIED_WIDTH / width, 1.0)
        return round(larger * width), round(larger * max(view.height(), 64))

    # Pictures --------------------------------------------------------------------------
    def picture(self) -> None:
        """Ask for the options of a picture, then for a file name, and write the picture."""
        view = self.window.viewing
        settings = self.window.settings
        with self._renderer() as renderer:
            choices = str(settings.value("picture", ""))
            dialog = PictureDialog(self.window, renderer, (view.width(), view.height()), choices)
            accepted = dialog.exec()
            options = dialog.picture_options
            choices = dialog.choices
            dialog.deleteLater()
            if not accepted:
                return
            settings.setValue("picture", choices)
            if path := self._ask("Export picture", ".png", picture_filters(self._session)[0]):
                self._write_picture(renderer, options, path)

    def _write_picture(
        self, renderer: OffscreenRenderer, options: PictureOptions, path: Path
    ) -> None:
        with self.window.banner.showing_errors():
            with wait_cursor():
                if path.suffix.lower() in SUFFIXES:
                    write_vector(renderer, options, path)
                else:
                    renderer.write(options, path)
            self._written(path)

    def copy_picture(self) -> None:
        """Copy a picture of the view to the clipboard, with a white background."""
        size = self._size()
        with self._renderer() as renderer, wait_cursor():
            options = PictureOptions(
                size,
                fill=renderer.fills,
                letters=LETTERS * size[0] / size[1] / 1.6,
                marked=renderer.session.marked_here,
            ).like(self._session.view)
            copy_image(to_image(renderer.image(options)))
        self.window.show_status(f"Copied a picture of {size[0]} × {size[1]} pixels")

    def copy_as(self, what: str, place: int) -> None:
        """Copy the command (``place`` 0) or the program (1) that makes again what is shown."""
        camera = self.window.viewing.scene.camera.view
        with self.window.banner.showing_errors():
            made = SCRIPTS[what](self._session, camera, self._size())
            QApplication.clipboard().setText(made[place])
            line = made[place].splitlines()[-place]  # a command's first line, a program's last
            self.window.show_status("Copied: " + line.removesuffix(" \\"))

    def copy_measure(self) -> None:
        """Copy the numbers of the measured points as text."""
        words = measure_words(self._session)
        QApplication.clipboard().setText(words)
        self.window.show_status(f"Copied: {words}")

    def section(self, paper: SectionStyle) -> None:
        """Ask for a file name, and write a picture of the selected section."""
        session = self._session
        section = self._session.view.section
        if section is None or session.frame is None or self.window.runner.busy:
            return
        if path := self._ask("Save picture of the section", "_section.png", PLOT_FILTERS):
            call = save_section, path, session, section, paper
            self.window.running.start_job(f"Drawing {path.name}", self._written, *call)

    def report(self) -> None:
        """Ask for a file name, and write a report of the runs as one HTML file."""
        if path := self._ask("Save report", "_report.html", "HTML page (*.html)"):
            with self.window.banner.showing_errors():
                with self._renderer() as renderer, wait_cursor():
                    write_html_report(path, renderer)
                self._written(path)

    def web_page(self) -> None:
        """Ask for a file name, and write the view as a web page that can be turned."""
        if path := self._ask("Save web page", WEB_PAGE, "HTML page (*.html)"):
            with self._renderer() as renderer:
                options = PictureOptions(title=True, fill=False).like(self._session.view)
                self._write_picture(renderer, options, path)

    # Films -----------------------------------------------------------------------------
    def make_film(self) -> None:
        """Open the dialog that makes a film of the steps; if it is open, bring it to the front.

        It is not modal: the window can be used while the film is made.
        """
        if self.film is not None:
            self.film.raise_()
            self.film.activateWindow()
            return
        if len(self._session.frames) < 2:
            return
        dialog = FilmDialog(self.window, self._renderer(), self._ask_film)
        self.film = dialog
        dialog.made.connect(self._written)
        dialog.failed.connect(self.window.banner.show_error)
        stopped = partial(self.window.show_status, "The film was stopped; no file is left")
        dialog.stopped.connect(stopped)
        dialog.finished.connect(self._film_closed)
        dialog.show()

    def _ask_film(self, kind: str) -> Path | None:
        files = self.window.files
        parent = self.film or self.window
        if kind:
            filters = {".mp4": "MP4 film (*.mp4)", ".gif": "GIF film (*.gif)"}[kind]
            path = self._ask("Export film", f"_steps{kind}", filters, parent)
            return path.with_suffix(kind) if path is not None else None
        folder = questions.ask_folder(parent, "Folder for the pictures", files.folder())
        name = f"{files.stem()}_steps".replace(".", "_")
        return new_folder(folder, name) if folder is not None else None

    def _film_closed(self) -> None:
        if self.film is not None:
            self.film.deleteLater()
            self.film = None

    def end(self) -> None:
        """Close the film dialog, which stops its film; called when another mesh is opened."""
        if self.film is not None:
            self.film.reject()

    # Tables and meshes -----------------------------------------------------------------
    def quality(self) -> None:
        """Ask for a file name and write the quality of every cell of the shown step as CSV."""
        frame = self._session.frame
        if frame is None or self.window.runner.busy:
            return
        if path := self._ask("Export quality", "_quality.csv", "CSV table (*.csv)"):
            call = self._written, jobs.save_quality, path, frame
            self.window.running.start_job(f"Saving {path.name}", *call)

    def steps(self) -> None:
        """Ask for a file name and write the mesh of every step: numbered files, or one .vtkhdf."""
        session = self._session
        files = self.window.files
        run = session.run_shown
        mesh = session.mesh
        if run is None or mesh is None or not run.frames or self.window.runner.busy:
            return
        ending = usual_ending(mesh)
        default = files.folder() / f"{files.stem()}_step{ending}"
        one = own_endings("series")
        title = f"Save {len(run.frames)} steps: NAME_1{ending} and so on, or one {one} file"
        filters = questions.mesh_filters(mesh)
        path = questions.ask_numbered(self.window, title, default, filters)
        if path is None:
            return
        there = [one for one in jobs.step_paths(path, len(run.frames)) if one.exists()]
        if there and not questions.ask_replace(self.window, there):
            return
        self.window.running.start_job(
            "Saving the steps",
            lambda paths: self._steps_written(paths, run.number),
            partial(jobs.save_steps, first=session.frames[0]),
            path,
            run.frames,
        )

    def wheel(self) -> None:
        """Ask for passages and a file name, and write the wheel of the shown step."""
        session = self._session
        frame = session.frame
        mesh = session.mesh
        around = wheel_passages(session)
        if frame is None or mesh is None or not around or self.window.runner.busy:
            return
        with self._renderer() as renderer:
            dialog = WheelDialog(self.window, renderer, around)
            accepted = dialog.exec()
            several = dialog.count
            numbered = dialog.numbered.isChecked()
            dialog.deleteLater()
        if not accepted:
            return
        filters = ";;".join(questions.mesh_filter(FORMATS[end]) for end in (".su2", ".su2b"))
        if path := self._ask("Save as wheel", "_wheel.su2", filters):
            case = session.case if frame.step is None else shown_case(session)
            values = path, case, mesh, frame, several, numbered
            name = f"Saving {path.name}"
            self.window.running.start_job(name, self._wheel_written, jobs.save_wheel, *values)

    def _wheel_written(self, made: WheelQuality) -> None:
        self._written(made.path)
        self.window.show_status(
            f"Saved {made.path}: {made.passages} passages, {made.cells:,} cells, "
            f"min {made.min:.4f}, {made.inverted:,} inverted"
        )

    def _steps_written(self, paths: list[Path], number: int) -> None:
        run = self._session.run_shown
        whole = bool(format_for(paths[-1]).series)
        if run is not None and run.number == number and (whole or len(run.frames) == len(paths)):
            self.window.store.change(changes.saved_mesh)
        self._written(paths[-1])
        if not whole:
            ends = f"{paths[0].name} to {paths[-1].name}"
            self.window.show_status(f"Saved {len(paths)} meshes, {ends}")

    def _written(self, path: Path) -> None:
        self.window.settings.setValue("folder", str(path.parent))
        log.info("wrote %s", path)
        self.window.show_status(f"Saved {path}")


def new_folder(parent: Path, name: str) -> Path:
    """Return the path of a folder that does not exist yet: ``name``, or ``name_2`` and so on."""
    names = chain([name], (f"{name}_{number}" for number in count(2)))
    return next(path for each in names if not (path := parent / each).exists())
