"""The dialog for films: how one is made, its first and last image, and its progress."""

from __future__ import annotations

from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

from qtpy.QtCore import QSize, Qt, QTimer, Signal
from qtpy.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from slideviz.errors import SlidevizError
from slideviz.gui.export_picture import doubled, fitted, framed, to_image
from slideviz.gui.fields import Choice
from slideviz.view import changes
from slideviz.view.figure import Figure, Studio, sees_all
from slideviz.view.film import Drawn, film_of
from slideviz.view.offscreen import LARGEST, SMALLEST
from slideviz.view.reel import FPS, SIZES, Reel, check_film

PREVIEW = (360, 225)
KINDS = {
    ".mp4": "MP4, small and plays everywhere",
    ".gif": "GIF, for slides and web pages",
    "": "one PNG picture for each image",
}
SIZE_WORDS = {
    "800x500": "800 × 500",
    "1280x800": "1280 × 800",
    "1920x1080": "1920 × 1080",
    "other": "other",
}


class FilmDialog(QDialog):
    """Asks how a film is made and makes it, one image in each turn of the event loop.

    Parameters
    ----------
    parent : QWidget
    studio : Studio
        Knows the session, whose steps are filmed whatever the window shows meanwhile.
    ask : callable
        Returns the file for a kind of `KINDS`, or None.

    Signals
    -------
    made(Path), failed(Exception), stopped()
        How a film ended.
    """

    made = Signal(object)
    failed = Signal(object)
    stopped = Signal()

    def __init__(self, parent: QWidget, studio: Studio, ask: Callable[[str], Path | None]) -> None:
        super().__init__(parent)
        self.setWindowTitle("Export film")
        self.studio = studio
        self._ask = ask
        self._film: Generator[Drawn, None, None] | None = None
        self._file: Path | None = None
        self.frames = len(studio.session.frames)
        outer = QVBoxLayout(self)
        outer.addLayout(self._make_previews())
        outer.addWidget(self._make_form())
        self.words = QLabel()
        self.words.setWordWrap(True)
        outer.addWidget(self.words)
        self.bar = QProgressBar()
        outer.addWidget(self.bar)
        outer.addWidget(self._make_buttons())
        self._turn, self._soon = QTimer(self), QTimer(self)
        self._turn.timeout.connect(self._pull)
        self._soon.setSingleShot(True)
        self._soon.setInterval(120)
        self._soon.timeout.connect(self._draw)
        self._kind_chosen(self.kind.currentData())
        self._show_filming(False)

    # Parts -----------------------------------------------------------------------------

    def _make_previews(self) -> QHBoxLayout:
        row = QHBoxLayout()
        self.previews = []
        for word in ("First image", "Last image"):
            column, title, picture = QVBoxLayout(), QLabel(word), QLabel()
            title.setProperty("hint", True)
            picture.setFixedSize(QSize(PREVIEW[0] + 2, PREVIEW[1] + 2))
            picture.setAlignment(Qt.AlignmentFlag.AlignCenter)
            picture.setAccessibleName(word)
            self.previews.append(picture)
            column.addWidget(title)
            column.addWidget(picture)
            row.addLayout(column)
        return row

    def _make_form(self) -> QWidget:
        self.form = QWidget()
        form = QFormLayout(self.form)
        form.setContentsMargins(0, 0, 0, 0)
        self.kind, self.size_choice = Choice(KINDS), Choice(SIZE_WORDS)
        self.kind.chosen.connect(self._kind_chosen)
        self.size_choice.chosen.connect(self._size_chosen)
        self.width_px, self.height_px = QSpinBox(), QSpinBox()
        pixels = QHBoxLayout()
        for box in (self.width_px, self.height_px):
            box.setRange(SMALLEST, LARGEST)
            box.setSuffix(" px")
            box.valueChanged.connect(self._pixels_typed)
            pixels.addWidget(box)
        self.fps, self.hold = QDoubleSpinBox(), QDoubleSpinBox()
        self.between = QSpinBox()
        for box, low, high, value, unit in (
            (self.fps, 0.5, 50.0, FPS, " a second"),
            (self.hold, 0.0, 60.0, Reel().hold, " s"),
        ):
            box.setRange(low, high)
            box.setDecimals(1)
            box.setSuffix(unit)
            box.setValue(value)
            box.valueChanged.connect(self._changed)
        self.between.setRange(0, 100)
        # Few steps jump; images in between make about three seconds of them.
        self.between.setValue(0 if self.frames > 15 else round(3 * FPS / self.frames) - 1)
        self.between.valueChanged.connect(self._changed)
        self.fps.setToolTip("Images shown in a second.")
        self.hold.setToolTip("How long the last image stays before the film ends or begins again.")
        self.between.setToolTip(
            "Images between two steps, with the nodes on straight lines from one to the next."
        )
        self.white = QCheckBox("White background")
        self.white.setToolTip("Else the background of the view.")
        self.white.setChecked(True)
        self.fill = QCheckBox("Fill the images with the mesh")
        self.fill.setToolTip("Else they show what the view shows of the mesh.")
        like = self.studio.like
        self.fill.setChecked(like is None or sees_all(like))
        form.addRow("Kind", self.kind)
        form.addRow("Size", self.size_choice)
        form.addRow("", pixels)
        form.addRow("Images", self.fps)
        form.addRow("Between two steps", self.between)
        form.addRow("Last image stays", self.hold)
        for option in (self.white, self.fill):
            option.toggled.connect(self._changed)
            form.addRow("", option)
        return self.form

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

    # What was chosen -------------------------------------------------------------------

    @property
    def reel(self) -> Reel:
        """Return how the film is made."""
        size = self.width_px.value(), self.height_px.value()
        return Reel(size, self.fps.value(), self.hold.value(), self.between.value())

    @property
    def figure(self) -> Figure:
        """Return what its images have."""
        size = self.width_px.value(), self.height_px.value()
        view = self.studio.session.view
        return Figure(
            size,
            "white" if self.white.isChecked() else "shown",
            legend=view.legend,
            edges=view.edges,
            triad=view.triad,
            title=True,
            fill=self.fill.isChecked(),
            both=False,
            letters=1.0,
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
                box.blockSignals(True)
                box.setValue(int(length))
                box.blockSignals(False)
        self._changed()

    def _pixels_typed(self) -> None:
        self.size_choice.show_value("other")
        self._changed()

    def problem(self) -> str:
        """Return why no film can be made like that; empty when it can."""
        kind = self.kind.currentData()
        try:
            # Any name in a folder that is there; the real one is asked for later.
            check_film(Path(f"film{kind}").absolute(), self.reel, overwrite=True)
        except SlidevizError as error:
            return str(error)
        return ""

    def _changed(self, _: object = None) -> None:
        problem = self.problem()
        self.words.setText(problem or length_words(self.reel, self.frames, self.kind.currentData()))
        self.words.setProperty("bad", bool(problem))
        self.words.style().polish(self.words)
        self.make.setEnabled(not problem)
        self._soon.start()

    def _draw(self) -> None:
        """Draw the first and the last image, from one place."""
        if self._film is not None:
            return
        figure, whole = self.figure.within(doubled(PREVIEW)), self.studio.session
        self._pose(figure)
        for label, frame in zip(self.previews, (0, self.frames - 1), strict=True):
            self.studio.session = changes.show_frame(whole, frame)
            image = to_image(self.studio.image(figure, aim=False))
            label.setPixmap(framed(fitted(image, PREVIEW)))
        self.studio.session = whole

    def _pose(self, figure: Figure) -> Any:
        """Return the scene as the film sees it: the step that needs most room is seen whole."""
        whole = self.studio.session
        widest = max(range(self.frames), key=lambda k: whole.frames[k].mesh.extent)
        self.studio.session = changes.show_frame(whole, widest)
        scene = self.studio.pose(figure)
        self.studio.session = whole
        return scene

    # Filming ---------------------------------------------------------------------------

    @property
    def filming(self) -> bool:
        """Tell whether a film is being made."""
        return self._film is not None

    def _start(self) -> None:
        file = self._ask(self.kind.currentData())
        if file is None:
            return
        figure, whole = self.figure, self.studio.session
        scene = self._pose(figure)
        self._file = file
        self._film = film_of(
            figure.showing(whole),
            self.studio.surfaces,
            file,
            self.reel,
            like=scene,
            overwrite=True,
        )
        self._show_filming(True)
        self._turn.start(0)

    def _pull(self) -> None:
        """Draw one image."""
        assert self._film is not None
        try:
            drawn = next(self._film)
        except StopIteration:
            self._end()
            self.made.emit(self._file)
            self.accept()
        except (SlidevizError, OSError) as error:
            self._end()
            self.failed.emit(error)
        else:
            self.bar.setRange(0, drawn.total)
            self.bar.setValue(drawn.done)
            self.words.setText(f"Image {drawn.done} of {drawn.total} of {self._file.name}")

    def cancel(self) -> None:
        """Stop filming, if it goes on; no file is left."""
        if self._film is not None:
            film = self._film
            self._end()
            film.close()
            self.stopped.emit()

    def _end(self) -> None:
        self._turn.stop()
        self._film = None
        self._show_filming(False)
        self._changed()

    def _show_filming(self, filming: bool) -> None:
        self.bar.setRange(0, 0)
        self.bar.setVisible(filming)
        self.stop.setVisible(filming)
        self.make.setVisible(not filming)
        self.form.setEnabled(not filming)

    def done(self, result: int) -> None:
        """Close; a film that goes on is stopped."""
        self.cancel()
        self._soon.stop()
        super().done(result)
        self.studio.close()


def length_words(reel: Reel, frames: int, kind: str) -> str:
    """Return in words how many images a film has, and how long it is."""
    count = reel.count(frames)
    steps = f"{frames - 1} step{'s' if frames > 2 else ''}"
    between = f", {reel.between} image{'s' if reel.between > 1 else ''} between two"
    text = f"{count} images: the undeformed mesh and {steps}{between if reel.between else ''}"
    if not kind:
        return f"{text}; each in a file of its own."
    pace = reel.pace(frames)
    seconds = (count - 1) / pace + max(reel.hold, 1.0 / pace)
    return f"{text}. The film lasts {seconds:.1f} s."
