"""The dialog for pictures: their options and a preview."""

from __future__ import annotations

import json
from collections.abc import Generator
from dataclasses import asdict, replace
from typing import Any

from qtpy.QtCore import QSignalBlocker, Qt
from qtpy.QtGui import QShowEvent
from qtpy.QtWidgets import QCheckBox, QDialog, QDialogButtonBox, QFormLayout, QLabel, QWidget

from slideviz.export.offscreen import LARGEST, LETTERS, SMALLEST, font_scale
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import BACKGROUNDS, PictureOptions, size_words
from slideviz.export.vector import MOST_CELLS
from slideviz.gui.responsiveness.timers import PREVIEW_MS, single_shot
from slideviz.gui.responsiveness.worker import PieceRunner, reraise
from slideviz.gui.widgets.build import (
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
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.pixmaps import (
    copy_image,
    drawn_for,
    fitted,
    framed,
    preview_label,
    to_image,
    wait_cursor,
)
from slideviz.terms import SHOWN

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
    "both": ("Both runs beside each other", "As the two views, with one legend."),
}
"""Text and tip of the check box for each field of `PictureOptions` that is a bool."""


class PictureDialog(QDialog):
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
        self._view_size = tuple(min(max(length, SMALLEST), LARGEST) for length in view_size)
        self._make_preview()
        self._make_size()
        self._make_options()
        left = in_column(self.preview, self.words, self.kinds, None)
        parts = in_row(left, in_column(self._form, None), spacing=16)
        self.setLayout(in_column(on_screen(as_widget(parts), self), self._make_buttons()))
        self._timer = single_shot(self, self._draw, PREVIEW_MS)
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
        self.kinds = hint_label(_kinds(self.renderer))
        self.kinds.setFixedWidth(PREVIEW[0])

    def _make_size(self) -> None:
        self.size_choice = Choice(SIZES)
        self.size_choice.chosen.connect(self._size_chosen)
        self.width_px, self.height_px = (
            number_box(SMALLEST, LARGEST, SMALLEST, self._pixels_typed, unit=" px") for _ in "wh"
        )
        self.width_cm, self.height_cm = (
            decimal_box(1.0, 200.0, length, self._changed, unit=" cm") for length in PAPER[:2]
        )
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
        """Return the options of the picture as chosen in the dialog."""
        picked: dict[str, Any] = {name: box.isChecked() for name, box in self.options.items()}
        background, text = self.background.currentData(), float(self.text.currentData())
        if self.size_choice.currentData() != "paper":
            size = self.width_px.value(), self.height_px.value()
            return PictureOptions(size, background, **picked, letters=text * LETTERS)
        dpi = float(self.dpi.value())
        wide, high = (round(box.value() / 2.54 * dpi) for box in (self.width_cm, self.height_cm))
        size = wide, high
        pixels = text * PAPER_POINTS / 72.0 * dpi
        letters = pixels / 13.0 / font_scale(size)
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
            width, height = (int(length) for length in known["size"])
            across, high, dpi = (float(number) for number in known.get("paper", PAPER))
        except (TypeError, ValueError, KeyError):
            known, (width, height), (across, high, dpi) = asdict(usual), usual.size, PAPER
        self.width_px.setValue(width)
        self.height_px.setValue(height)
        self.width_cm.setValue(across)
        self.height_cm.setValue(high)
        self.dpi.setValue(round(dpi))
        for name, box in self.options.items():
            box.setChecked(bool(known.get(name, getattr(usual, name))))
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
        if name not in ("paper", "other"):
            size = self._view_size if name == "view" else [int(n) for n in name.split("x")]
            for box, length in zip((self.width_px, self.height_px), size, strict=True):
                with QSignalBlocker(box):
                    box.setValue(length)
        self._form.setRowVisible(self._paper, name == "paper")
        self._form.setRowVisible(self._pixels, name != "paper")
        self._changed()

    def _pixels_typed(self) -> None:
        self.size_choice.show_value("other")
        self._changed()

    def _changed(self, _: object = None) -> None:
        options = self.picture_options
        too_large = max(options.size) > LARGEST or min(options.size) < SMALLEST
        self.words.setText(
            f"{size_words(options)}: width and height can be {SMALLEST} to {LARGEST} pixels"
            if too_large
            else size_words(options)
        )
        set_style(self.words, "bad", too_large)
        for button in (self.save, self.copy):
            button.setEnabled(not too_large)
        if not too_large and self.isVisible():
            self._timer.start()

    # Picture ---------------------------------------------------------------------------

    def _draw(self) -> None:
        self._runner.start(self._drawing())

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
        """Close the dialog and stop drawing."""
        self._timer.stop()
        self._runner.stop()
        super().done(result)


def _kinds(renderer: OffscreenRenderer) -> str:
    """Return a sentence about the file formats that are possible, and why others are not."""
    mesh = renderer.session.mesh
    if mesh is None or mesh.dim != 2:
        return "Saved as PNG; the view of a 3D mesh consists of pixels."
    if len(mesh.cells) > MOST_CELLS:
        return f"Saved as PNG; SVG and PDF can have at most {MOST_CELLS:,} cells."
    return (
        "Saved as PNG, or as SVG or PDF with sharp lines at any size; these two show cells and "
        "boundaries, without points, neighbouring passages and axes."
    )
