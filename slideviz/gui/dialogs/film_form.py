"""The form for a film: kind, size, speed, images in between, background."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import QSignalBlocker, Signal
from qtpy.QtWidgets import QFormLayout, QWidget

from slideviz.errors import SlidevizError
from slideviz.export.film import FPS, SIZES, FilmOptions, check_film
from slideviz.export.offscreen import LARGEST, SMALLEST
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.gui.widgets.build import check_box, decimal_box, in_row, number_box
from slideviz.gui.widgets.choice import Choice

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


class FilmForm(QWidget):
    """The fields for the options of a film.

    Parameters
    ----------
    renderer : OffscreenRenderer
        Holds the session whose steps are filmed.

    Signals
    -------
    changed()
        An option has changed.
    """

    changed = Signal()

    def __init__(self, renderer: OffscreenRenderer) -> None:
        super().__init__()
        self.renderer = renderer
        self.frames = len(renderer.session.frames)
        self._make_size()
        self._make_pace()
        self.white = check_box("White background", "Else the background of the view.")
        self.white.setChecked(True)
        self.fill = check_box(
            "Fill the images with the mesh", "Else they show what the view shows of the mesh."
        )
        self.fill.setChecked(renderer.fills)
        self.mark = check_box("Marked cell", "Its outline, with its number and its value.")
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.addRow("Kind", self.kind)
        form.addRow("Size", self.size_choice)
        form.addRow("", self._pixels)
        form.addRow("Frames per second", self.fps)
        form.addRow("Interpolated frames between steps", self.between)
        form.addRow("Last frame stays", self.hold)
        for option in (self.white, self.fill, self.mark):
            option.toggled.connect(self._changed)
            form.addRow("", option)
        form.setRowVisible(self.mark, renderer.session.view.marked_cell is not None)
        self._kind_chosen(self.kind.currentData())

    def _make_size(self) -> None:
        self.kind, self.size_choice = Choice(KINDS), Choice(SIZE_WORDS)
        self.kind.chosen.connect(self._kind_chosen)
        self.size_choice.chosen.connect(self._size_chosen)
        self.width_px, self.height_px = (
            number_box(SMALLEST, LARGEST, SMALLEST, self._pixels_typed, unit=" px") for _ in "wh"
        )
        self._pixels = in_row(self.width_px, self.height_px)

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
        size = self.width_px.value(), self.height_px.value()
        return FilmOptions(size, self.fps.value(), self.hold.value(), self.between.value())

    @property
    def picture_options(self) -> PictureOptions:
        """Return the options of the film's images."""
        size = self.width_px.value(), self.height_px.value()
        view = self.renderer.session.view
        return PictureOptions(
            size,
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

    def _size_chosen(self, name: str) -> None:
        if "x" in name:
            for box, length in zip((self.width_px, self.height_px), name.split("x"), strict=True):
                with QSignalBlocker(box):
                    box.setValue(int(length))
        self._changed()

    def _pixels_typed(self) -> None:
        self.size_choice.show_value("other")
        self._changed()

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
