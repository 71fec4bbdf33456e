"""The dialog for films: options, preview of the first and last image, and progress."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from pathlib import Path
from typing import Any

from qtpy.QtCore import QSignalBlocker, Qt, Signal
from qtpy.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QHBoxLayout, QLabel, QWidget

from slideviz.errors import SlidevizError
from slideviz.export.film import (
    FPS,
    SIZES,
    FilmOptions,
    FilmProgress,
    aim_at_largest,
    check_film,
    film_steps,
)
from slideviz.export.offscreen import LARGEST, SMALLEST
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.gui.responsiveness.timers import PREVIEW_MS, single_shot
from slideviz.gui.responsiveness.worker import PieceRunner, reraise
from slideviz.gui.widgets.build import (
    Choice,
    QuietBar,
    as_widget,
    check_box,
    decimal_box,
    hint_label,
    in_column,
    in_row,
    number_box,
    on_screen,
    set_style,
)
from slideviz.gui.widgets.pixmaps import drawn_for, fitted, framed, preview_label, to_image

KINDS = {
    ".mp4": "MP4, small and plays everywhere",
    ".gif": "GIF, for slides and web pages",
    "": "one PNG picture for each image",
}
"""Kinds of films by the suffix of their file; empty: a folder of pictures."""

SIZE_WORDS = {
    "800x500": "800 × 500",
    "1280x800": "1280 × 800",
    "1920x1080": "1920 × 1080",
    "other": "other",
}


class PixelFields:
    """The choice of a size in pixels, with fields for width and height: a part of a form."""

    def _make_pixels(self, words: Mapping[str, str]) -> None:
        self.size_choice = Choice(words)
        self.size_choice.chosen.connect(self._size_chosen)
        typed = self._pixels_typed
        self.width_px = number_box(SMALLEST, LARGEST, SMALLEST, typed, unit=" px")
        self.height_px = number_box(SMALLEST, LARGEST, SMALLEST, typed, unit=" px")

    @property
    def pixels(self) -> tuple[int, int]:
        """Return width and height."""
        return self.width_px.value(), self.height_px.value()

    def _size_chosen(self, name: str) -> None:
        if "x" in name:
            for box, length in zip((self.width_px, self.height_px), name.split("x"), strict=True):
                with QSignalBlocker(box):
                    box.setValue(int(length))
        self._changed()

    def _pixels_typed(self) -> None:
        self.size_choice.show_value("other")
        self._changed()

    def _changed(self, _: object = None) -> None:
        raise NotImplementedError


class FilmForm(PixelFields, QWidget):
    """The fields for the options of a film.

    ``renderer``: holds the session whose steps are filmed.
    """

    changed = Signal()
    """An option has changed."""

    def __init__(self, renderer: OffscreenRenderer) -> None:
        super().__init__()
        self.renderer = renderer
        self.frames = len(renderer.session.frames)
        self.kind = Choice(KINDS)
        self.kind.chosen.connect(self._kind_chosen)
        self._make_pixels(SIZE_WORDS)
        self._make_pace()
        self.white = check_box("White background", "Without it, the background of the view.")
        self.white.setChecked(True)
        self.fill = check_box(
            "Fill the images with the mesh",
            "Without it, they show the same part of the mesh as the view.",
        )
        self.fill.setChecked(renderer.fills)
        self.mark = check_box("Marked cell", "Its outline, with its number and its value.")
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow("Kind", self.kind)
        form.addRow("Size", self.size_choice)
        form.addRow("", in_row(self.width_px, self.height_px))
        form.addRow("Frames per second", self.fps)
        form.addRow("Interpolated frames between steps", self.between)
        form.addRow("Last frame stays", self.hold)
        for option in (self.white, self.fill, self.mark):
            option.toggled.connect(self._changed)
            form.addRow("", option)
        form.setRowVisible(self.mark, renderer.session.view.marked_cell is not None)
        self._kind_chosen(self.kind.currentData())

    def _make_pace(self) -> None:
        self.fps = decimal_box(0.5, 50.0, FPS, self._changed, tip="Images shown in a second.")
        self.hold = decimal_box(
            0.0,
            60.0,
            FilmOptions().hold,
            self._changed,
            unit=" s",
            tip="How long the last image stays before the film ends or begins again.",
        )
        self.between = number_box(
            0,
            100,
            # With few steps, a film of about three seconds needs images in between.
            0 if self.frames > 15 else round(3 * FPS / self.frames) - 1,
            self._changed,
            tip="Images between two steps, with the nodes on straight lines from one to the next.",
        )

    # What was chosen -------------------------------------------------------------------
    @property
    def film_options(self) -> FilmOptions:
        """Return size, frame rate, duration of the last image, and images between steps."""
        return FilmOptions(self.pixels, self.fps.value(), self.hold.value(), self.between.value())

    @property
    def picture_options(self) -> PictureOptions:
        view = self.renderer.session.view
        return PictureOptions(
            self.pixels,
            "white" if self.white.isChecked() else "shown",
            legend="legend" in view.drawn,
            edges="edges" in view.drawn,
            triad="triad" in view.drawn,
            title=True,
            fill=self.fill.isChecked(),
            both=False,
            letters=1.25,
            film=True,
            marked=self.mark.isChecked(),
        )

    def _kind_chosen(self, kind: str) -> None:
        width, height = SIZES[kind or ".png"]
        name = f"{width}x{height}"
        self.size_choice.show_value(name if name in SIZE_WORDS else "1280x800")
        self.fps.setEnabled(bool(kind))
        self.hold.setEnabled(bool(kind))
        self._size_chosen(self.size_choice.currentData())

    def problem(self) -> str:
        """Return why no film can be made with these options; empty if one can."""
        kind = self.kind.currentData()
        try:
            # A placeholder: the real file name is asked for later.
            check_film(Path(f"film{kind}").absolute(), self.film_options, overwrite=True)
        except SlidevizError as error:
            return str(error)
        return ""

    @property
    def words(self) -> str:
        """Return a sentence with the film's number of images and its duration."""
        return length_words(self.film_options, self.frames, self.kind.currentData())

    def _changed(self, _: object = None) -> None:
        self.changed.emit()


def length_words(film_options: FilmOptions, frames: int, kind: str) -> str:
    """Return a sentence with a film's number of images and its duration.

    ``frames`` is the number of steps with the undeformed mesh; ``kind`` a key of `KINDS`.
    """
    count = film_options.count(frames)
    steps = f"{frames - 1} step{'s' if frames > 2 else ''}"
    between = f", {film_options.between} image{'s' if film_options.between > 1 else ''} between two"
    text = (
        f"{count} images: the undeformed mesh and {steps}{between if film_options.between else ''}"
    )
    if not kind:
        return f"{text}; each in a file of its own."
    pace = film_options.pace(frames)
    seconds = (count - 1) / pace + max(film_options.hold, 1.0 / pace)
    return f"{text}. The film lasts {seconds:.1f} s."


PREVIEW = (360, 225)  # largest width and height of a preview, in pixels


class FilmDialog(QDialog):
    """The dialog that makes a film, one image per turn of the event loop, so that nothing freezes.

    ``renderer``: draws the steps of its session, whatever the window shows meanwhile. ``ask``: asks
    the user for the file, given a kind of `slideviz.gui.dialogs.film.KINDS`; returns None if there
    is none.
    """

    made = Signal(object)  # Path
    failed = Signal(object)  # Exception
    stopped = Signal()
    """`made`, `failed`, `stopped`: a film was written; failed; was stopped by the user."""

    def __init__(
        self, parent: QWidget, renderer: OffscreenRenderer, ask: Callable[[str], Path | None]
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export film")
        self.renderer = renderer
        self._ask = ask
        self._file: Path | None = None
        self._runner = PieceRunner(self)
        self._previewing = PieceRunner(self)
        self._runner.yielded.connect(self._progressed)
        self._runner.done.connect(self._done)
        self._runner.failed.connect(self._failed)
        self._previewing.failed.connect(reraise)
        self.form = FilmForm(renderer)
        self.form.changed.connect(self._changed)
        self.words = QLabel()
        self.words.setTextFormat(Qt.TextFormat.PlainText)  # it has the name of a file
        self.words.setWordWrap(True)
        self.bar = QuietBar()
        parts = as_widget(in_column(self._make_previews(), self.form, self.words, self.bar))
        self.setLayout(in_column(on_screen(parts, self), self._make_buttons()))
        self._soon = single_shot(self, self._draw, PREVIEW_MS)
        self._changed()
        self._show_filming(False)

    # Parts -----------------------------------------------------------------------------
    def _make_previews(self) -> QHBoxLayout:
        words = ("First image", "Last image")
        self.previews = [preview_label(word, PREVIEW) for word in words]
        pairs = zip(words, self.previews, strict=True)
        return in_row(*(in_column(hint_label(word), picture) for word, picture in pairs))

    def _make_buttons(self) -> QDialogButtonBox:
        buttons = QDialogButtonBox()
        self.make = buttons.addButton("Make film…", QDialogButtonBox.ButtonRole.AcceptRole)
        self.stop = buttons.addButton("Stop", QDialogButtonBox.ButtonRole.ActionRole)
        self.close_button = buttons.addButton(QDialogButtonBox.StandardButton.Close)
        self.make.clicked.connect(self._start)
        self.stop.clicked.connect(self.cancel)
        self.stop.setToolTip("Stop filming; no file is left.")
        buttons.rejected.connect(self.reject)
        return buttons

    def _changed(self) -> None:
        problem = self.form.problem()
        self.words.setText(problem or self.form.words)
        set_style(self.words, "bad", bool(problem))
        self.make.setEnabled(not problem)
        self._soon.start()

    def _draw(self) -> None:
        if not self.filming:
            self._previewing.start(self._drawing())

    def _drawing(self) -> Generator[object, Any, None]:
        """Yield pieces of the work that draws both previews, with one camera."""
        options = self.form.picture_options.within(drawn_for(self.renderer, PREVIEW))
        yield from aim_at_largest(self.renderer, options)
        for label, frame in zip(self.previews, (0, self.form.frames - 1), strict=True):
            pixels = yield from self.renderer.render_steps(options, aim=False, frame=frame)
            label.setPixmap(framed(fitted(to_image(pixels), PREVIEW)))

    # Filming ---------------------------------------------------------------------------
    @property
    def filming(self) -> bool:
        return self._runner.busy

    def _start(self) -> None:
        file = self._ask(self.form.kind.currentData())
        if file is None:
            return
        self._previewing.stop()
        self._file = file
        options = self.form.picture_options
        film_options = self.form.film_options
        self._runner.start(film_steps(self.renderer, options, file, film_options, overwrite=True))
        self._show_filming(True)

    def _progressed(self, drawn: FilmProgress) -> None:
        self.bar.setRange(0, drawn.total)
        self.bar.setValue(drawn.done)
        self.words.setText(f"Image {drawn.done} of {drawn.total} of {self._file.name}")

    def _done(self, _: object) -> None:
        self._end()
        self.made.emit(self._file)
        self.accept()

    def _failed(self, error: Exception) -> None:
        self._end()
        self.failed.emit(error)

    def cancel(self) -> None:
        """Stop the film, if one is being made; no file is left."""
        if self.filming:
            self._runner.stop()
            self._end()
            self.stopped.emit()

    def _end(self) -> None:
        self._show_filming(False)
        self._changed()

    def _show_filming(self, filming: bool) -> None:
        self.bar.setRange(0, 0)
        self.bar.setVisible(filming)
        self.stop.setVisible(filming)
        self.make.setVisible(not filming)
        self.form.setEnabled(not filming)

    def done(self, result: int) -> None:
        self.cancel()
        self._soon.stop()
        self._previewing.stop()
        super().done(result)
        self.renderer.close()
