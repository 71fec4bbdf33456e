"""The exports of the window: pictures, films, tables of quality, meshes of all steps."""

from __future__ import annotations

import logging
from functools import partial
from pathlib import Path

from qtpy.QtCore import QObject

from slideviz.errors import SlidevizError
from slideviz.export.offscreen import LETTERS
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.export.vector import MOST_CELLS, SUFFIXES, write_vector
from slideviz.formats.table import format_for, own_endings, usual_ending
from slideviz.gui.dialogs.film import FilmDialog
from slideviz.gui.dialogs.picture import PictureDialog
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.pixmaps import copy_image, to_image, wait_cursor
from slideviz.gui.widgets.services import Services
from slideviz.session import changes, jobs
from slideviz.session.state import Session

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

    def _renderer(self) -> OffscreenRenderer:
        viewing = self.window.viewing
        return OffscreenRenderer(self._session, viewing.surfaces, viewing.scene)

    # Pictures --------------------------------------------------------------------------

    def picture(self) -> None:
        """Ask for the options of a picture, then for a file name, and write the picture."""
        if self._session.mesh is None:
            return
        view, settings = self.window.viewing, self.window.settings
        with self._renderer() as renderer:
            choices = str(settings.value("picture", ""))
            dialog = PictureDialog(self.window, renderer, (view.width(), view.height()), choices)
            accepted = dialog.exec() == PictureDialog.DialogCode.Accepted
            options, choices = dialog.picture_options, dialog.choices
            dialog.deleteLater()
            if not accepted:
                return
            settings.setValue("picture", choices)
            default = self.window.files.folder() / f"{self.window.files.stem()}.png"
            filters = picture_filters(self._session)
            path = questions.ask_save(self.window, "Export picture", default, filters)
            if path is not None:
                self._write_picture(renderer, options, path)

    def _write_picture(
        self, renderer: OffscreenRenderer, options: PictureOptions, path: Path
    ) -> None:
        try:
            with wait_cursor():
                if path.suffix.lower() in SUFFIXES:
                    write_vector(renderer, options, path)
                else:
                    renderer.write(options, path)
        except (OSError, SlidevizError) as error:
            self.window.banner.show_error(error)
            return
        self._written(path)

    def copy_picture(self) -> None:
        """Copy a picture of the view to the clipboard, with a white background."""
        if self._session.mesh is None:
            return
        view = self.window.viewing
        width, height = max(view.width(), 64), max(view.height(), 64)
        larger = max(COPIED_WIDTH / width, 1.0)
        size = round(larger * width), round(larger * height)
        shown = self._session.view
        with self._renderer() as renderer, wait_cursor():
            options = PictureOptions(
                size,
                legend="legend" in shown.drawn,
                edges="edges" in shown.drawn,
                fill=renderer.fills,
                letters=LETTERS * size[0] / size[1] / 1.6,
                marked=renderer.session.marked_here,
            )
            copy_image(to_image(renderer.image(options)))
        self.window.show_status(f"Copied a picture of {size[0]} × {size[1]} pixels")

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
        dialog.stopped.connect(
            lambda: self.window.show_status("The film was stopped; no file is left")
        )
        dialog.finished.connect(self._film_closed)
        dialog.show()

    def _ask_film(self, kind: str) -> Path | None:
        files, parent = self.window.files, self.film or self.window
        stem = f"{files.stem()}_steps"
        if kind:
            filters = {".mp4": "MP4 film (*.mp4)", ".gif": "GIF film (*.gif)"}[kind]
            path = questions.ask_save(
                parent, "Export film", files.folder() / f"{stem}{kind}", filters
            )
            return path.with_suffix(kind) if path is not None else None
        folder = questions.ask_folder(parent, "Folder for the pictures", files.folder())
        return new_folder(folder, stem.replace(".", "_")) if folder is not None else None

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
        frame, files = self._session.frame, self.window.files
        if frame is None or self.window.runner.busy:
            return
        default = files.folder() / f"{files.stem()}_quality.csv"
        path = questions.ask_save(self.window, "Export quality", default, "CSV table (*.csv)")
        if path is not None:
            self.window.running.start_job(
                f"Saving {path.name}", self._written, jobs.save_quality, path, frame
            )

    def steps(self) -> None:
        """Ask for a file name and write the mesh of every step: numbered files, or one .vtkhdf."""
        session, files = self._session, self.window.files
        run, mesh = session.run_shown, session.mesh
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

    def _steps_written(self, paths: list[Path], number: int) -> None:
        run = self._session.run_shown
        whole = bool(format_for(paths[-1]).series)
        if run is not None and run.number == number and (whole or len(run.frames) == len(paths)):
            self.window.store.change(changes.saved_mesh)
        self._written(paths[-1])
        if not whole:
            self.window.show_status(
                f"Saved {len(paths)} meshes, {paths[0].name} to {paths[-1].name}"
            )

    def _written(self, path: Path) -> None:
        self.window.settings.setValue("folder", str(path.parent))
        log.info("wrote %s", path)
        self.window.show_status(f"Saved {path}")


def picture_filters(session: Session) -> str:
    """Return the formats a picture of a session can be saved in, as filters of a file dialog."""
    mesh = session.mesh
    if mesh is None or mesh.dim != 2 or len(mesh.cells) > MOST_CELLS:
        return questions.PICTURE_FILTERS
    return f"{questions.PICTURE_FILTERS};;SVG drawing (*.svg);;PDF drawing (*.pdf)"


def new_folder(parent: Path, name: str) -> Path:
    """Return the path of a folder that does not exist yet: ``name``, or ``name_2`` and so on."""
    path, number = parent / name, 1
    while path.exists():
        number += 1
        path = parent / f"{name}_{number}"
    return path
