"""The dialog of "Save as wheel": how many passages, which boundaries, and a picture of them."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any, Literal

from qtpy.QtGui import QShowEvent
from qtpy.QtWidgets import QDialog, QDialogButtonBox, QFormLayout, QWidget

from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.gui.responsiveness.worker import PieceRunner, reraise
from slideviz.gui.widgets.build import Choice, check_box, dialog_buttons, hint_label, in_column
from slideviz.gui.widgets.pixmaps import drawn_for, fitted, framed, preview_label, to_image
from slideviz.mesh.zones import zones_of
from slideviz.session import changes
from slideviz.session.state import Session

PREVIEW = (460, 360)  # largest width and height of the picture, in pixels


def passage_choices(session: Session, around: Sequence[int]) -> dict[int | Literal["all"], str]:
    """Return the numbers of passages that can be saved, in words: all, and those in the view."""
    shown = 2 * session.view.passages + 1
    numbers = " and ".join(map(str, around))
    words: dict[int | Literal["all"], str] = {"all": f"the whole wheel, {numbers}"}
    if 1 < shown < min(around):
        words[shown] = f"the passages in the view, {shown}"
    return words


class WheelDialog(QDialog):
    """The dialog for the options of a wheel, with a picture of it.

    ``renderer``: draws the session whose step is saved. ``around``: the passages of the wheel of
    each zone.
    """

    def __init__(self, parent: QWidget, renderer: OffscreenRenderer, around: Sequence[int]) -> None:
        super().__init__(parent)
        self.setWindowTitle("Save as wheel")
        self.renderer = renderer
        self._session = renderer.session
        self._around = around
        self.preview = preview_label("Picture of the wheel", PREVIEW)
        self.passages = Choice(
            passage_choices(self._session, around),
            "Passages side by side. For a part of the wheel, set Neighbours in the panel Display "
            "first.",
            "wheel_passages",
        )
        self.passages.chosen.connect(lambda _: self._draw())
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
        self.setLayout(in_column(self.preview, form, self.words, buttons))
        self._runner = PieceRunner(self)
        self._runner.failed.connect(reraise)

    @property
    def count(self) -> int | Literal["all"]:
        """Return the number of passages to be saved."""
        chosen: int | Literal["all"] = self.passages.currentData()
        return chosen

    def _draw(self) -> None:
        mesh = self._session.mesh
        count = self.count
        assert mesh is not None
        many = self._around if count == "all" else [count] * len(self._around)
        cells = sum(k * len(zone.cells) for k, zone in zip(many, zones_of(mesh), strict=True))
        self.words.setText(f"{cells:,} cells; nodes are merged where passages meet.")
        self._runner.start(self._drawing())

    def _drawing(self) -> Generator[object, Any, None]:
        """Yield pieces of the work that draws the picture."""
        shown = -1 if self.count == "all" else self.count // 2
        sides = self._session.case.markers_with("periodic")  # inside of the wheel
        bare = changes.show_boundaries(self._session, sides, False)
        self.renderer.session = changes.set_view(bare, passages=shown, sections=())
        size = drawn_for(self.renderer, PREVIEW)
        options = PictureOptions(size, background="shown", legend=False, both=False, edges=False)
        pixels = yield from self.renderer.render_steps(options)
        self.preview.setPixmap(framed(fitted(to_image(pixels), PREVIEW)))

    def showEvent(self, event: QShowEvent) -> None:
        """Draw the first picture, now that the dialog is visible."""
        super().showEvent(event)
        self._draw()

    def done(self, result: int) -> None:
        self._runner.stop()
        super().done(result)
