"""The form for one motion: which boundary, what kind, its numbers."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QFileDialog, QWidget

from slideviz.case.model import FromFile, Motion, Radial, Rotate, Scale, Translate
from slideviz.gui.panels.motion_form import ABOUT, MotionForm
from slideviz.gui.panels.motion_kinds import new_motion
from slideviz.view.motions.places import Axis
from slideviz.view.motions.words import direction_words

ALL_MOVING = ""
Z = (0.0, 0.0, 1.0)


class MotionEditor(MotionForm):
    """Shows a motion and tells each valid change of it.

    Signals
    -------
    changed(Motion)
        Another motion instead.
    table_wanted()
        The rows of its displacement file are to be typed.
    """

    changed = Signal(object)
    table_wanted = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motion: Motion | None = None
        self._dim = 3
        self._markers: tuple[str, ...] = ()
        self._centroid = {}
        self._machine: Axis | None = None
        self._connect()
        self.show_motion(None, (), 3)

    def _connect(self) -> None:
        self.marker.chosen.connect(lambda _: self._tell())
        self.kind.chosen.connect(self._kind_chosen)
        self.about.chosen.connect(self._about_chosen)
        for field in self.numbers:
            field.changed.connect(lambda _: self._tell())
        self.path.textEdited.connect(lambda _: self._tell())
        self.browse.clicked.connect(self._browse)
        self.table.clicked.connect(lambda _: self.table_wanted.emit())

    def show_motion(self, motion: Motion | None, markers: tuple[str, ...], dim: int) -> None:
        """Show a motion of one of these moving boundaries, or nothing."""
        self._motion, self._dim = motion, dim
        self.setVisible(motion is not None)
        if motion is None:
            return
        self._sync_markers(motion, markers)
        self.kind.show_value(type(motion))
        shown = self._show_numbers(motion, dim)
        if isinstance(motion, Rotate | Scale | Radial):
            shown |= {"about"} | self._show_place(motion, dim)
        for vector in (self.vector, self.factors, self.point):
            vector.set_count(dim)
        self.show_rows(shown)

    def _show_numbers(self, motion: Motion, dim: int) -> set[str]:
        """Show what a motion does, and return the rows for it."""
        if isinstance(motion, Translate):
            self.vector.show_value(motion.vector)
            return {"vector"}
        if isinstance(motion, Rotate):
            self.angle.show_value(motion.angle_deg)
            return {"angle"}
        if isinstance(motion, Scale):
            factors = motion.factors if len(motion.factors) > 1 else motion.factors * dim
            self.factors.show_value(factors)
            return {"factors"}
        if isinstance(motion, Radial):
            # Rounded: 1.03 is not 3 % to the last bit.
            self.percent.show_value(round(100.0 * (motion.factor - 1.0), 10))
            self.distance.show_value(motion.distance)
            return {"percent", "distance"}
        if str(motion.path) != self.path.text() and not self.path.hasFocus():
            self.path.setText("" if motion.path == Path() else str(motion.path))
        return {"path"}

    def _show_place(self, motion: Rotate | Scale | Radial, dim: int) -> set[str]:
        """Show what a motion leaves in place, and return the rows for it."""
        offered = ["point"] if isinstance(motion, Radial) else ["centroid", "point"]
        if self._machine is not None and not isinstance(motion, Scale):
            offered.insert(-1, "axis")
        words = [self._about_words(what) for what in offered]
        if [self.about.itemText(row) for row in range(self.about.count())] != words:
            self.about.clear()
            for what, word in zip(offered, words, strict=True):
                self.about.addItem(word, what)
        what = "centroid" if motion.point == "centroid" else "point"
        if "axis" in offered and self._is_machine(motion) and self.about.currentData() != "point":
            what = "axis"
        self.about.show_value(what)
        if what != "centroid":
            self.point.show_value(motion.point)
        if not isinstance(motion, Scale):
            self.axis.show_value(motion.axis)
        turns = not isinstance(motion, Scale) and dim == 3 and what != "axis"
        return ({"point"} if what == "point" else set()) | ({"axis"} if turns else set())

    def _about_words(self, what: str) -> str:
        if what != "axis" or self._dim == 2:
            return ABOUT[what]
        axis, _ = self._machine
        return f"{ABOUT[what]} ({direction_words(axis)})"

    def _is_machine(self, motion: Rotate | Radial) -> bool:
        """Tell whether a motion is about the machine's axis."""
        axis, origin = self._machine
        return motion.axis == axis and motion.point == origin[: self._dim]

    def _sync_markers(self, motion: Motion, markers: tuple[str, ...]) -> None:
        names = dict.fromkeys(markers)
        if isinstance(motion, FromFile):
            names[ALL_MOVING] = None
        names[motion.marker] = None
        if tuple(names) != self._markers:
            self._markers = tuple(names)
            self.marker.clear()
            for name in names:
                self.marker.addItem(name or "all moving", name)
        self.marker.show_value(motion.marker)

    def _kind_chosen(self, kind: type) -> None:
        if self._motion is not None and type(self._motion) is not kind:
            self.changed.emit(new_motion(kind, self._motion.marker, self._dim, self._machine))

    def _about_chosen(self, what: str) -> None:
        if what == "point" and getattr(self._motion, "point", None) == "centroid":
            centre = self._centroid.get(self._motion.marker, (0.0,) * self._dim)
            self.point.show_value(centre)
        elif what == "axis":
            axis, origin = self._machine
            self.axis.show_value(axis)
            self.point.show_value(origin)
        self._tell()
        # What is about the axis already is the same motion: only the fields differ.
        self.show_motion(self._motion, self._markers, self._dim)

    def set_centroids(self, centroids: dict[str, tuple[float, ...]]) -> None:
        """Take the centroids of boundaries: where a point starts that nobody has typed yet."""
        self._centroid = centroids

    def set_extent(self, extent: float) -> None:
        """Take the size of the mesh, beside which what rounding left of zero is shown as 0."""
        self.point.set_scale(extent)

    def set_machine(self, machine: Axis | None) -> None:
        """Take the axis about which the mesh repeats; None where it does not."""
        self._machine = machine

    def _tell(self) -> None:
        marker, kind = self.marker.currentData() or "", type(self._motion)
        axis = self.axis.value if self._dim == 3 else Z
        if self.axis.problem:
            axis = getattr(self._motion, "axis", Z)
        point = "centroid" if self.about.currentData() == "centroid" else self.point.value
        if kind is Translate:
            motion: Motion = Translate(marker, self.vector.value)
        elif kind is Rotate:
            motion = Rotate(marker, self.angle.value, point, axis)
        elif kind is Scale:
            motion = Scale(marker, self.factors.value, point)
        elif kind is Radial:
            factor = round(1.0 + self.percent.value / 100.0, 14)
            motion = Radial(marker, factor, self.distance.value, axis, point)
        else:
            motion = FromFile(Path(self.path.text().strip()), marker)
        if motion != self._motion:
            self.changed.emit(motion)

    def _browse(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Displacement file", self.path.text())
        if name:
            self.path.setText(name)
            self._tell()
