"""The dialogs of pictures, films and wheels, each with a preview of what it makes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from qtpy.QtCore import QSignalBlocker, QSize, Qt, Signal
from qtpy.QtGui import QColor, QImage, QPainter, QPixmap, QShowEvent
from qtpy.QtWidgets import (
    QApplication,
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QWidget,
)

from slideviz.errors import SlidevizError
from slideviz.export.film import (
    FPS,
    SIZES,
    FilmOptions,
    FilmProgress,
    aim_at_largest,
    check_film,
    film_steps,
    require_pair_width,
)
from slideviz.export.offscreen import LARGEST, LETTERS, SMALLEST, font_scale
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import BACKGROUNDS, PictureOptions, size_words
from slideviz.export.vector import MOST_CELLS
from slideviz.gui.responsiveness.timers import PREVIEW_MS, single_shot
from slideviz.gui.responsiveness.worker import PieceRunner, reraise
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.build import (
    Choice,
    QuietBar,
    as_widget,
    check_box,
    dialog_buttons,
    hint_label,
    in_column,
    in_row,
    number_box,
    on_screen,
    set_style,
)
from slideviz.gui.widgets.plot_canvas import PLOT_FILTERS
from slideviz.mesh.zones import zones_of
from slideviz.session import changes
from slideviz.session.pieces import Pieces
from slideviz.session.state import UNDEFORMED, Session
from slideviz.terms import SHOWN

LARGE = 50_000
"""Number of cells above which a preview is drawn at the size it is shown, not twice as large."""


def to_image(pixels: np.ndarray) -> QImage:
    """Return an image of pixels (height, width, 3 or 4) uint8, copied."""
    height, width, depth = pixels.shape
    kind = QImage.Format.Format_RGBA8888 if depth == 4 else QImage.Format.Format_RGB888
    return QImage(pixels.tobytes(), width, height, depth * width, kind).copy()


def drawn_for(renderer: OffscreenRenderer, box: tuple[int, int]) -> tuple[int, int]:
    """Return the size in pixels at which a preview is drawn, given its box.

    It is twice the box, as lines are at least a pixel wide; of a large mesh, which is slow to
    draw, the box itself.
    """
    mesh = renderer.session.mesh
    times = 1 if mesh is not None and len(mesh.cells) > LARGE else 2
    return times * box[0], times * box[1]


def fitted(image: QImage, box: tuple[int, int]) -> QImage:
    """Return an image scaled to fit into a box (width, height), its aspect ratio kept."""
    keep = Qt.AspectRatioMode.KeepAspectRatio
    smooth = Qt.TransformationMode.SmoothTransformation
    return image.scaled(QSize(*box), keep, smooth)


def framed(image: QImage) -> QPixmap:
    """Return a pixmap of an image in a thin frame, its transparent parts on a chequerboard."""
    out = QPixmap(image.width() + 2, image.height() + 2)
    out.fill(QColor("#ffffff"))
    painter = QPainter(out)
    if image.hasAlphaChannel():
        for x in range(0, out.width(), 10):
            for y in range((x // 10) % 2 * 10, out.height(), 20):
                painter.fillRect(x, y, 10, 10, QColor("#d5d9de"))
    painter.drawImage(1, 1, image)
    painter.setPen(QColor("#9aa3ad"))
    painter.drawRect(0, 0, out.width() - 1, out.height() - 1)
    painter.end()
    return out


@contextmanager
def wait_cursor() -> Iterator[None]:
    """Show the wait cursor within the context."""
    QApplication.setOverrideCursor(Qt.CursorShape.WaitCursor)
    try:
        yield
    finally:
        QApplication.restoreOverrideCursor()


def copy_image(image: QImage) -> None:
    """Put an image on the clipboard."""
    QApplication.clipboard().setImage(image)


class PreviewDialog(QDialog):
    """The base of dialogs with pictures that are drawn when it is shown, and after each change.

    ``renderer``: draws them. ``box``: their largest width and height, in pixels.
    """

    def __init__(
        self, parent: QWidget | None, title: str, renderer: OffscreenRenderer, box: tuple[int, int]
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle(title)
        self.renderer = renderer
        self.box = box
        self.drawer = PieceRunner(self)
        self.drawer.failed.connect(reraise)
        self.soon = single_shot(self, self.draw, PREVIEW_MS)

    def draw(self) -> None:
        """Begin to draw the previews."""
        self.drawer.start(self.drawing())

    def drawing(self) -> Pieces:
        """Yield pieces of the work that draws the previews: of a large mesh it takes a second."""
        raise NotImplementedError

    def preview(self, name: str) -> QLabel:
        """Return a label of fixed size for one of the pictures."""
        label = QLabel()
        label.setFixedSize(self.box[0] + 2, self.box[1] + 2)
        label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        label.setAccessibleName(name)
        return label

    def preview_options(self, options: PictureOptions) -> PictureOptions:
        """Return the options of a picture, scaled down to the size in which it is drawn here."""
        return options.within(drawn_for(self.renderer, self.box))

    def put(self, pixels: np.ndarray, label: QLabel) -> None:
        """Show a picture that was drawn (height, width, 3 or 4) in its label."""
        label.setPixmap(framed(fitted(to_image(pixels), self.box)))

    def changed(self) -> None:
        """Draw the previews soon."""
        self.soon.start()

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.changed()

    def done(self, result: int) -> None:
        self.soon.stop()
        self.drawer.stop()
        super().done(result)


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


PICTURE_SIZES = {
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
    "case": (
        "Case and view in the PNG file",
        "slideviz opens the picture like a case: with this view, and the mesh beside it.",
    ),
}
"""Text and tip of the check box for each field of `PictureOptions` that is a bool."""


class PictureDialog(PixelFields, PreviewDialog):
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
        super().__init__(parent, "Export picture", renderer, (470, 330))
        lengths = (min(max(length, SMALLEST), LARGEST) for length in view_size)
        self._view_size = "x".join(map(str, lengths))
        self.picture = self.preview("Preview of the picture")
        self.picture.setObjectName("preview")
        self.words = QLabel()
        self.words.setTextFormat(Qt.TextFormat.PlainText)  # it has the name of a file
        self.kinds = hint_label(picture_filters(self.renderer.session)[1])
        self.kinds.setFixedWidth(self.box[0])
        self._make_size()
        self._make_options()
        left = in_column(self.picture, self.words, self.kinds, None)
        parts = in_row(left, in_column(self._form, None), spacing=16)
        self.setLayout(in_column(on_screen(as_widget(parts), self), self._make_buttons()))
        self._numbers: dict[str, Any] = {
            "width": self.width_px,
            "height": self.height_px,
            "width_cm": self.width_cm,
            "height_cm": self.height_cm,
            "dpi": self.dpi,
        }
        self._words = {
            "preset": self.size_choice,
            "text": self.text,
            "background": self.background,
        }
        marked = renderer.session.marked_here
        usual = replace(PictureOptions(), fill=renderer.fills, marked=marked)
        known = {name: getattr(usual, name) for name in OPTIONS}
        self._restore_choices({"preset": "1600x1000", "text": 1.0, **known})
        with suppress(TypeError, ValueError):  # none, or of another version
            known = dict(json.loads(kept))
            self._restore_choices({name: known[name] for name in known.keys() - self._passing})

    # Parts -----------------------------------------------------------------------------
    def _make_size(self) -> None:
        self._make_pixels(PICTURE_SIZES)
        self.width_cm = number_box(1.0, 200.0, PAPER[0], self._changed, unit=" cm")
        self.height_cm = number_box(1.0, 200.0, PAPER[1], self._changed, unit=" cm")
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
        session = self.renderer.session
        self._form.setRowVisible(self.options["both"], self.renderer.beside is not None)
        self._form.setRowVisible(self.options["marked"], session.view.marked_cell is not None)
        self._passing = {"fill", "both", *(() if session.marked_here else ("marked",))}
        """The options that depend on the present view, and are not kept."""

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
        """Return what is chosen as JSON, to be the first choice of the next dialog."""
        chosen: dict[str, object] = {name: box.value() for name, box in self._numbers.items()}
        chosen |= {name: choice.currentData() for name, choice in self._words.items()}
        chosen |= {name: box.isChecked() for name, box in self.options.items()}
        return json.dumps({name: chosen[name] for name in chosen.keys() - self._passing})

    def _restore_choices(self, known: Mapping[str, Any]) -> None:
        """Fill those fields that are named among the `choices` of the last time."""
        for name, number in self._numbers.items():
            number.setValue(known.get(name, number.value()))
        for name, choice in self._words.items():
            choice.show_value(known.get(name))
        for name, option in self.options.items():
            option.setChecked(known.get(name, option.isChecked()))
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
            self.soon.start()

    # Picture ---------------------------------------------------------------------------
    def drawing(self) -> Pieces:
        options = self.preview_options(self.picture_options)
        pixels = yield from self.renderer.render_steps(options)
        self.put(pixels, self.picture)

    def _copy(self) -> None:
        if self.drawer.busy:  # the renderer draws one picture at a time: stop the preview
            self.drawer.stop()
            self.soon.start()
        with wait_cursor():
            copy_image(to_image(self.renderer.image(self.picture_options)))
        self.words.setText("Copied to the clipboard.")


FILM_KINDS = {
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


class FilmForm(PixelFields, QWidget):
    """The fields for the options of a film.

    ``renderer``: holds the session whose steps are filmed.
    """

    changed = Signal()
    """An option has changed."""

    def __init__(self, renderer: OffscreenRenderer) -> None:
        super().__init__()
        self.renderer = renderer
        steps = len(renderer.session.frames)
        self.kind = Choice(FILM_KINDS)
        self.kind.chosen.connect(self._kind_chosen)
        self._make_pixels(SIZE_WORDS)
        self.fps = number_box(0.5, 50.0, FPS, self._changed, tip="Images shown in a second.")
        self.hold = number_box(
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
            0 if steps > 15 else round(3 * FPS / steps) - 1,
            self._changed,
            tip="Images between two steps, with the nodes on straight lines from one to the next.",
        )
        self.white = check_box("White background", "Without it, the background of the view.")
        self.white.setChecked(True)
        self.fill = check_box(
            "Fill the images with the mesh",
            "Without it, they show the same part of the mesh as the view.",
        )
        self.fill.setChecked(renderer.fills)
        self.mark = check_box("Marked cell", "Its outline, with its number and its value.")
        self.both = check_box(*OPTIONS["both"])
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow("Kind", self.kind)
        form.addRow("Size", self.size_choice)
        form.addRow("", in_row(self.width_px, self.height_px))
        form.addRow("Frames per second", self.fps)
        form.addRow("Interpolated frames between steps", self.between)
        form.addRow("Last frame stays", self.hold)
        for option in (self.white, self.fill, self.mark, self.both):
            option.toggled.connect(self._changed)
            form.addRow("", option)
        compared = renderer.beside is not None and renderer.session.view.beside != UNDEFORMED
        form.setRowVisible(self.both, compared)
        form.setRowVisible(self.mark, renderer.session.view.marked_cell is not None)
        self._kind_chosen(self.kind.currentData())

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
            title=True,
            fill=self.fill.isChecked(),
            both=self.both.isChecked(),
            letters=1.25,
            film=True,
            marked=self.mark.isChecked(),
            lines=1 + self.both.isChecked(),
        ).like(view)

    @property
    def frames(self) -> int:
        """Return the number of steps with the undeformed mesh, of the run with more of them."""
        shown = self.renderer.shown(self.renderer.session, self.picture_options)
        return max(len(one.frames) for one in shown)

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
            if self.both.isChecked():
                require_pair_width(self.pixels)
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

    ``frames`` is the number of steps with the undeformed mesh; ``kind`` a key of `FILM_KINDS`.
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


class FilmDialog(PreviewDialog):
    """The dialog that makes a film, one image per turn of the event loop, so that nothing freezes.

    ``renderer``: draws the steps of its session, whatever the window shows meanwhile. ``ask``: asks
    the user for the file, given a kind of `FILM_KINDS`; returns None if there
    is none.
    """

    made = Signal(object)  # Path
    failed = Signal(object)  # Exception
    stopped = Signal()
    """`made`, `failed`, `stopped`: a film was written; failed; was stopped by the user."""

    def __init__(
        self, parent: QWidget, renderer: OffscreenRenderer, ask: Callable[[str], Path | None]
    ) -> None:
        super().__init__(parent, "Export film", renderer, (360, 225))
        self._ask = ask
        self._file: Path | None = None
        self._runner = PieceRunner(self)
        self._runner.yielded.connect(self._progressed)
        self._runner.done.connect(self._done)
        self._runner.failed.connect(self._failed)
        self.form = FilmForm(renderer)
        self.form.changed.connect(self.changed)
        self.words = QLabel()
        self.words.setTextFormat(Qt.TextFormat.PlainText)  # it has the name of a file
        self.words.setWordWrap(True)
        self.bar = QuietBar()
        parts = as_widget(in_column(self._make_previews(), self.form, self.words, self.bar))
        self.setLayout(in_column(on_screen(parts, self), self._make_buttons()))
        self.changed()
        self._show_filming(False)

    # Parts -----------------------------------------------------------------------------
    def _make_previews(self) -> QHBoxLayout:
        words = ("First image", "Last image")
        self.previews = [self.preview(word) for word in words]
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

    def changed(self) -> None:
        problem = self.form.problem()
        self.words.setText(problem or self.form.words)
        set_style(self.words, "bad", bool(problem))
        self.make.setEnabled(not problem)
        super().changed()

    def draw(self) -> None:
        if not self.filming:
            super().draw()

    def drawing(self) -> Pieces:
        options = self.preview_options(self.form.picture_options)
        yield from aim_at_largest(self.renderer, options)
        for label, frame in zip(self.previews, (0, self.form.frames - 1), strict=True):
            pixels = yield from self.renderer.render_steps(options, aim=False, frame=frame)
            self.put(pixels, label)

    # Filming ---------------------------------------------------------------------------
    @property
    def filming(self) -> bool:
        return self._runner.busy

    def _start(self) -> None:
        file = self._ask(self.form.kind.currentData())
        if file is None:
            return
        self.drawer.stop()
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
        self.changed()

    def _show_filming(self, filming: bool) -> None:
        self.bar.setRange(0, 0)
        self.bar.setVisible(filming)
        self.stop.setVisible(filming)
        self.make.setVisible(not filming)
        self.form.setEnabled(not filming)

    def done(self, result: int) -> None:
        self.cancel()
        super().done(result)
        self.renderer.close()


def passage_choices(session: Session, around: Sequence[int]) -> dict[int | Literal["all"], str]:
    """Return the numbers of passages that can be saved, in words: all, and those in the view."""
    shown = 2 * session.view.passages + 1
    numbers = " and ".join(map(str, around))
    words: dict[int | Literal["all"], str] = {"all": f"the whole wheel, {numbers}"}
    if 1 < shown < min(around):
        words[shown] = f"the passages in the view, {shown}"
    return words


class WheelDialog(PreviewDialog):
    """The dialog for the options of a wheel, with a picture of it.

    ``renderer``: draws the session whose step is saved. ``around``: the passages of the wheel of
    each zone.
    """

    def __init__(self, parent: QWidget, renderer: OffscreenRenderer, around: Sequence[int]) -> None:
        super().__init__(parent, "Save as wheel", renderer, (460, 360))
        self._session = renderer.session
        self._around = around
        self.picture = self.preview("Picture of the wheel")
        self.passages = Choice(
            passage_choices(self._session, around),
            "Passages side by side. For a part of the wheel, set Neighbours in the panel Display "
            "first.",
            "wheel_passages",
        )
        self.passages.chosen.connect(lambda _: self.changed())
        self.numbered = check_box(
            "Number the boundaries",
            "Give each passage boundaries of its own: blade_1, blade_2. Otherwise each boundary "
            "belongs to all passages.",
            name="wheel_numbered",
        )
        self.words = hint_label()
        kinds = QDialogButtonBox.StandardButton
        form = QFormLayout()
        form.addRow("Passages", self.passages)
        form.addRow("", self.numbered)
        buttons = dialog_buttons(self, kinds.Save, kinds.Cancel)
        buttons.button(kinds.Save).setText("Save…")
        self.setLayout(in_column(self.picture, form, self.words, buttons))

    @property
    def count(self) -> int | Literal["all"]:
        """Return the number of passages to be saved."""
        chosen: int | Literal["all"] = self.passages.currentData()
        return chosen

    def changed(self) -> None:
        mesh = self._session.opened_mesh
        count = self.count
        many = self._around if count == "all" else [count] * len(self._around)
        cells = sum(k * len(zone.cells) for k, zone in zip(many, zones_of(mesh), strict=True))
        self.words.setText(f"{cells:,} cells; nodes are merged where passages meet.")
        self.draw()

    def drawing(self) -> Pieces:
        shown = -1 if self.count == "all" else self.count // 2
        sides = self._session.case.markers_with("periodic")  # inside of the wheel
        bare = changes.show_boundaries(self._session, sides, False)
        self.renderer.session = changes.set_view(bare, passages=shown, sections=())
        size = drawn_for(self.renderer, self.box)
        options = PictureOptions(size, background="shown", legend=False, both=False, edges=False)
        pixels = yield from self.renderer.render_steps(options)
        self.put(pixels, self.picture)
