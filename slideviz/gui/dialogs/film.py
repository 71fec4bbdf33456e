"""The dialog for films: options, preview of the first and last image, and progress."""

from __future__ import annotations

from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QDialog, QDialogButtonBox, QHBoxLayout, QLabel, QWidget

from slideviz.export.film import FilmProgress, aim_at_largest, filming
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.gui.dialogs.film_form import FilmForm
from slideviz.gui.responsiveness.piece_runner import PieceRunner, raise_again
from slideviz.gui.responsiveness.settings import PREVIEW_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.widgets.build import (
    QuietBar,
    boxed,
    hint_label,
    in_column,
    in_row,
    on_screen,
    set_style,
)
from slideviz.gui.widgets.pixmaps import drawn_for, fitted, framed, preview_label, to_image

PREVIEW = (360, 225)
"""Largest width and height of a preview, in pixels."""


class FilmDialog(QDialog):
    """The dialog that makes a film, one image per turn of the event loop, so that nothing freezes.

    Parameters
    ----------
    parent : QWidget
    renderer : OffscreenRenderer
        Draws the steps of its session, whatever the window shows meanwhile.
    ask : callable
        Asks the user for the file, given a kind of `slideviz.gui.dialogs.film_form.KINDS`; returns
        None if there is none.

    Signals
    -------
    made(Path), failed(Exception), stopped()
        A film was written; failed; was stopped by the user.
    """

    made = Signal(object)
    failed = Signal(object)
    stopped = Signal()

    def __init__(
        self, parent: QWidget, renderer: OffscreenRenderer, ask: Callable[[str], Path | None]
    ) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export film")
        self.renderer = renderer
        self._ask = ask
        self._file: Path | None = None
        self._runner, self._previewing = PieceRunner(self), PieceRunner(self)
        self._runner.came.connect(self._came)
        self._runner.done.connect(self._done)
        self._runner.failed.connect(self._failed)
        self._previewing.failed.connect(raise_again)
        self.form = FilmForm(renderer)
        self.form.changed.connect(self._changed)
        self.words = QLabel()
        self.words.setTextFormat(Qt.TextFormat.PlainText)  # it has the name of a file
        self.words.setWordWrap(True)
        self.bar = QuietBar()
        parts = boxed(in_column(self._make_previews(), self.form, self.words, self.bar))
        self.setLayout(in_column(on_screen(parts, self), self._make_buttons()))
        self._soon = later(self, self._draw, PREVIEW_MS)
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
        """Return whether a film is being made."""
        return self._runner.busy

    def _start(self) -> None:
        file = self._ask(self.form.kind.currentData())
        if file is None:
            return
        self._previewing.stop()
        self._file = file
        options, film_options = self.form.picture_options, self.form.film_options
        self._runner.start(filming(self.renderer, options, file, film_options, overwrite=True))
        self._show_filming(True)

    def _came(self, drawn: FilmProgress) -> None:
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
        """Close the dialog and stop a film that is being made."""
        self.cancel()
        self._soon.stop()
        self._previewing.stop()
        super().done(result)
        self.renderer.close()
