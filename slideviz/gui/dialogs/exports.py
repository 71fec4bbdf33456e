"""The exports of the window: pictures, films, tables of quality, meshes of all steps."""

from __future__ import annotations

import json
import logging
from collections.abc import Generator
from dataclasses import asdict, replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qtpy.QtCore import QObject, Qt
from qtpy.QtGui import QShowEvent
from qtpy.QtWidgets import QCheckBox, QDialog, QDialogButtonBox, QFormLayout, QLabel, QWidget

from slideviz.errors import SlidevizError
from slideviz.export.flat_section import PageFormat, save_section
from slideviz.export.offscreen import LARGEST, LETTERS, SMALLEST, font_scale
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import BACKGROUNDS, PictureOptions, size_words
from slideviz.export.vector import MOST_CELLS, SUFFIXES, write_vector
from slideviz.formats.table import FORMATS, format_for, own_endings, usual_ending
from slideviz.gui.dialogs.film import FilmDialog, PixelFields
from slideviz.gui.dialogs.wheel import WheelDialog
from slideviz.gui.responsiveness.timers import PREVIEW_MS, single_shot
from slideviz.gui.responsiveness.worker import PieceRunner, reraise
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    Choice,
    as_widget,
    check_box,
    decimal_box,
    dialog_buttons,
    hint_label,
    in_column,
    in_row,
    number_box,
    on_screen,
    set_style,
)
from slideviz.gui.widgets.pixmaps import (
    copy_image,
    drawn_for,
    fitted,
    framed,
    preview_label,
    to_image,
    wait_cursor,
)
from slideviz.gui.widgets.plot_canvas import PLOT_FILTERS
from slideviz.gui.widgets.services import Services
from slideviz.session import changes, jobs
from slideviz.session.motions import shown_case, wheel_passages
from slideviz.session.state import Session
from slideviz.terms import SHOWN

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

    # Pictures --------------------------------------------------------------------------
    def picture(self) -> None:
        """Ask for the options of a picture, then for a file name, and write the picture."""
        if self._session.mesh is None:
            return
        view = self.window.viewing
        settings = self.window.settings
        with self._renderer() as renderer:
            choices = str(settings.value("picture", ""))
            dialog = PictureDialog(self.window, renderer, (view.width(), view.height()), choices)
            accepted = dialog.exec() == PictureDialog.DialogCode.Accepted
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
        width = max(view.width(), 64)
        height = max(view.height(), 64)
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

    def section(self, paper: PageFormat) -> None:
        """Ask for a file name, and write a picture of the selected section."""
        session = self._session
        section = self._session.view.section
        if section is None or session.frame is None or self.window.runner.busy:
            return
        if path := self._ask("Save picture of the section", "_section.png", PLOT_FILTERS):
            call = save_section, path, session, section, paper
            self.window.running.start_job(f"Drawing {path.name}", self._written, *call)

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
            accepted = dialog.exec() == WheelDialog.DialogCode.Accepted
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


def picture_filters(session: Session) -> tuple[str, str]:
    """Return the formats a picture of a session can be saved in, as filters of a file dialog.

    Also a sentence about them, and why others are not possible.
    """
    mesh = session.mesh
    if mesh is None or mesh.dim != 2:
        why = "Saved as PNG; the view of a 3D mesh consists of pixels."
        return questions.PICTURE_FILTERS, why
    if len(mesh.cells) > MOST_CELLS:
        why = f"Saved as PNG; SVG and PDF can have at most {MOST_CELLS:,} cells."
        return questions.PICTURE_FILTERS, why
    return PLOT_FILTERS, (
        "Saved as PNG, or as SVG or PDF with sharp lines at any size; these two show cells and "
        "boundaries, without points, neighbouring passages and axes."
    )


def new_folder(parent: Path, name: str) -> Path:
    """Return the path of a folder that does not exist yet: ``name``, or ``name_2`` and so on."""
    names = chain([name], (f"{name}_{number}" for number in count(2)))
    return next(path for each in names if not (path := parent / each).exists())


PREVIEW = (470, 330)  # largest width and height of the preview, in pixels
SIZES = {
    "view": "as the view",
    "1600x1000": "1600 × 1000, for a report",
    "1920x1080": "1920 × 1080, for slides",
    "3200x2000": "3200 × 2000, for a poster",
    "paper": "on paper, in cm",
    "other": "other",
}
"""Sizes that can be chosen: in pixels, or by a name."""

TEXT = {0.8: "small", 1.0: "normal", 1.4: "large"}  # sizes of letters relative to the normal one
PAPER = (16.0, 10.0, 300.0)
"""Initial width and height on paper in cm, as wide as a page's text; pixels per inch."""

PAPER_POINTS = 8.5  # size of normal letters on paper in points; journals ask for 8 at least
OPTIONS = {
    "legend": ("Legend or color bar", "What the colors mean, at the right."),
    "edges": (SHOWN["edges"].name, SHOWN["edges"].tip),
    "triad": ("Directions of the axes", "Small arrows in the lower left corner."),
    "title": ("Title with the quality", "Run and step, with minimum, mean and inverted cells."),
    "fill": (
        "Fill the picture with the mesh",
        "Without it, it shows the same part of the mesh as the view.",
    ),
    "marked": ("Marked cell", "Its outline, with its number and its value."),
    "both": ("Both runs side by side", "Like the two views, with one legend."),
}
"""Text and tip of the check box for each field of `PictureOptions` that is a bool."""


class PictureDialog(PixelFields, QDialog):
    """The dialog for the options of a picture, with a preview.

    ``renderer``: draws the picture. ``view_size`` (int, int): width and height of the view in
    pixels. ``kept``: the `choices` of the last time; empty for none.
    """

    def __init__(
        self,
        parent: QWidget,
        renderer: OffscreenRenderer,
        view_size: tuple[int, int] = (1280, 800),
        kept: str = "",
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export picture")
        self.renderer = renderer
        lengths = (min(max(length, SMALLEST), LARGEST) for length in view_size)
        self._view_size = "x".join(map(str, lengths))
        self._make_preview()
        self._make_size()
        self._make_options()
        left = in_column(self.preview, self.words, self.kinds, None)
        parts = in_row(left, in_column(self._form, None), spacing=16)
        self.setLayout(in_column(on_screen(as_widget(parts), self), self._make_buttons()))
        self._timer = single_shot(self, lambda: self._runner.start(self._drawing()), PREVIEW_MS)
        self._runner = PieceRunner(self)
        self._runner.failed.connect(reraise)
        self._restore_choices(kept)
        self._changed()

    # Parts -----------------------------------------------------------------------------
    def _make_preview(self) -> None:
        self.preview = preview_label("Preview of the picture", PREVIEW)
        self.preview.setObjectName("preview")
        self.words = QLabel()
        self.words.setTextFormat(Qt.TextFormat.PlainText)  # it has the name of a file
        self.kinds = hint_label(picture_filters(self.renderer.session)[1])
        self.kinds.setFixedWidth(PREVIEW[0])

    def _make_size(self) -> None:
        self._make_pixels(SIZES)
        self.width_cm = decimal_box(1.0, 200.0, PAPER[0], self._changed, unit=" cm")
        self.height_cm = decimal_box(1.0, 200.0, PAPER[1], self._changed, unit=" cm")
        tip = "Pixels per inch on paper; journals ask for 300 or more."
        self.dpi = number_box(50, 1200, round(PAPER[2]), self._changed, unit=" dpi", tip=tip)
        self._form = QFormLayout()
        self._form.addRow("Size", self.size_choice)
        self._pixels = as_widget(in_row(self.width_px, QLabel("×"), self.height_px, None))
        paper = (self.width_cm, QLabel("×"), self.height_cm, self.dpi)
        self._paper = as_widget(in_row(*paper, None))
        self._form.addRow("", self._pixels)
        self._form.addRow("", self._paper)
        self.text = Choice(TEXT, "How large letters are; on paper, normal is 8.5 points.")
        self.text.chosen.connect(self._changed)
        self._form.addRow("Letters", self.text)

    def _make_options(self) -> None:
        self.background = Choice(BACKGROUNDS, "What is behind the mesh.")
        self.background.chosen.connect(self._changed)
        self._form.addRow("Background", self.background)
        self.options: dict[str, QCheckBox] = {}
        for name, (text, tip) in OPTIONS.items():
            self.options[name] = check_box(text, tip, self._changed)
            self._form.addRow("", self.options[name])
        self._form.setRowVisible(self.options["both"], self.renderer.beside is not None)
        marked = self.renderer.session.view.marked_cell is not None
        self._form.setRowVisible(self.options["marked"], marked)

    def _make_buttons(self) -> QDialogButtonBox:
        kinds = QDialogButtonBox.StandardButton
        buttons = dialog_buttons(self, kinds.Save, kinds.Cancel)
        self.save = buttons.button(kinds.Save)
        self.save.setText("Save…")
        self.copy = buttons.addButton("Copy", QDialogButtonBox.ButtonRole.ActionRole)
        self.copy.setToolTip("Copy this picture to the clipboard.")
        self.copy.clicked.connect(self._copy)
        return buttons

    # What was chosen -------------------------------------------------------------------
    @property
    def picture_options(self) -> PictureOptions:
        picked: dict[str, Any] = {name: box.isChecked() for name, box in self.options.items()}
        background = self.background.currentData()
        text = float(self.text.currentData())
        if self.size_choice.currentData() != "paper":
            return PictureOptions(self.pixels, background, **picked, letters=text * LETTERS)
        dpi = float(self.dpi.value())
        wide = round(self.width_cm.value() / 2.54 * dpi)
        size = (wide, round(self.height_cm.value() / 2.54 * dpi))
        letters = text * PAPER_POINTS / 72.0 * dpi / 13.0 / font_scale(size)
        return PictureOptions(size, background, **picked, letters=letters, dpi=dpi)

    @property
    def choices(self) -> str:
        """Return the chosen options as JSON, to be the initial ones of the next dialog."""
        choices = asdict(self.picture_options)
        numbers = (self.width_cm.value(), self.height_cm.value(), self.dpi.value())
        choices.update(
            preset=self.size_choice.currentData(), text=self.text.currentData(), paper=numbers
        )
        # These depend on the present view.
        del choices["fill"], choices["both"]
        if not self.renderer.session.marked_here:
            del choices["marked"]
        return json.dumps(choices)

    def _restore_choices(self, kept: str) -> None:
        """Fill the fields from the `choices` of the last time; from defaults if there are none."""
        usual = replace(PictureOptions(), fill=self.renderer.fills)
        known = asdict(usual)
        try:
            known.update(json.loads(kept) if kept else {})
            width, height = map(int, known["size"])
            across, high, dpi = map(float, known.get("paper", PAPER))
        except (TypeError, ValueError, KeyError):
            known = asdict(usual)
            width, height = usual.size
            across, high, dpi = PAPER
        self.width_px.setValue(width)
        self.height_px.setValue(height)
        self.width_cm.setValue(across)
        self.height_cm.setValue(high)
        self.dpi.setValue(round(dpi))
        for name, option in self.options.items():
            option.setChecked(bool(known.get(name, getattr(usual, name))))
        # A cell that was marked in another run is of no interest here, unless it is asked for.
        if not self.renderer.session.marked_here:
            self.options["marked"].setChecked(False)
        self.background.show_value(known.get("background", usual.background))
        self.text.setCurrentIndex(1)
        self.text.show_value(known.get("text", 1.0))
        self.size_choice.show_value("1600x1000")
        self.size_choice.show_value(known.get("preset", "1600x1000"))
        self._size_chosen(self.size_choice.currentData())

    def _size_chosen(self, name: str) -> None:
        self._form.setRowVisible(self._paper, name == "paper")
        self._form.setRowVisible(self._pixels, name != "paper")
        super()._size_chosen(self._view_size if name == "view" else name)

    def _changed(self, _: object = None) -> None:
        options = self.picture_options
        too_large = max(options.size) > LARGEST or min(options.size) < SMALLEST
        words = size_words(options)
        if too_large:
            words += f": width and height can be {SMALLEST} to {LARGEST} pixels"
        self.words.setText(words)
        set_style(self.words, "bad", too_large)
        for button in (self.save, self.copy):
            button.setEnabled(not too_large)
        if not too_large and self.isVisible():
            self._timer.start()

    # Picture ---------------------------------------------------------------------------
    def _drawing(self) -> Generator[object, Any, None]:
        """Yield pieces of the work that draws the preview: of a large mesh it takes a second."""
        options = self.picture_options.within(drawn_for(self.renderer, PREVIEW))
        pixels = yield from self.renderer.render_steps(options)
        self.preview.setPixmap(framed(fitted(to_image(pixels), PREVIEW)))

    def _copy(self) -> None:
        if self._runner.busy:  # the renderer draws one picture at a time: stop the preview
            self._runner.stop()
            self._timer.start()
        with wait_cursor():
            copy_image(to_image(self.renderer.image(self.picture_options)))
        self.words.setText("Copied to the clipboard.")

    def showEvent(self, event: QShowEvent) -> None:
        """Draw the first preview, now that the dialog is visible."""
        super().showEvent(event)
        self._changed()

    def done(self, result: int) -> None:
        self._timer.stop()
        self._runner.stop()
        super().done(result)
