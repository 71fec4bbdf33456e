"""The form for one motion: which boundary, what kind, its numbers."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import Signal
from qtpy.QtWidgets import (
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from slideviz.case.model import FromFile, Motion, Rotate, Scale, Translate
from slideviz.gui.fields import Choice, NumberField, VectorField, not_zero

KINDS: dict[type, str] = {
    Translate: "translate",
    Rotate: "rotate",
    Scale: "scale",
    FromFile: "displacement file",
}
ALL_MOVING = ""


class MotionEditor(QWidget):
    """Shows a motion and tells each valid change of it."""

    changed = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motion: Motion | None = None
        self._dim = 3
        self._markers: tuple[str, ...] = ()
        self._centroid = {}
        self.form = QFormLayout(self)
        self.form.setContentsMargins(0, 2, 0, 0)
        self.form.setVerticalSpacing(4)
        self.form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._make_fields()
        self._place_fields()
        self.show_motion(None, (), 3)

    def _make_fields(self) -> None:
        self.marker = Choice({})
        self.kind = Choice(KINDS)
        self.vector = VectorField()
        self.vector.set_tip("How far it moves along each axis, in the mesh's length unit.")
        self.angle = NumberField()
        self.angle.set_tip("Degrees; positive turns counter-clockwise seen against the axis.")
        self.factors = VectorField((1.0, 1.0, 1.0))
        self.factors.set_tip("Enlargement along each axis: 1 leaves it, 2 doubles it.")
        for field in self.factors.fields:
            field._allowed = not_zero
        self.about = Choice({"centroid": "its centroid", "point": "a point"})
        self.about.setToolTip("What stays in place while it turns or grows.")
        self.point = VectorField()
        self.point.set_tip("The point that stays in place.")
        self.axis = VectorField((0.0, 0.0, 1.0))
        self.axis.set_tip("Direction of the axis; its length does not matter.")
        self.path = QLineEdit()
        self.path.setToolTip("A line for each node: its number and its displacement.")
        self.browse = QPushButton("…")
        self.browse.setMaximumWidth(30)
        self.browse.setToolTip("Choose the file.")
        self.marker.chosen.connect(lambda _: self._tell())
        self.kind.chosen.connect(self._kind_chosen)
        self.about.chosen.connect(self._about_chosen)
        for field in (self.vector, self.angle, self.factors, self.point, self.axis):
            field.changed.connect(lambda _: self._tell())
        self.path.textEdited.connect(lambda _: self._tell())
        self.browse.clicked.connect(self._browse)

    def _place_fields(self) -> None:
        row = QWidget()
        line = QHBoxLayout(row)
        line.setContentsMargins(0, 0, 0, 0)
        line.setSpacing(4)
        line.addWidget(self.path, 1)
        line.addWidget(self.browse)
        both = QWidget()
        pair = QHBoxLayout(both)
        pair.setContentsMargins(0, 0, 0, 0)
        pair.setSpacing(6)
        pair.addWidget(self.kind, 1)
        pair.addWidget(self.marker, 1)
        self.form.addRow("Motion", both)
        self._rows: dict[str, QWidget] = {
            "vector": self.vector,
            "angle": self.angle,
            "factors": self.factors,
            "about": self.about,
            "point": self.point,
            "axis": self.axis,
            "path": row,
        }
        titles = ("By", "Angle (°)", "Factors", "About", "Point", "Axis", "File")
        for title, widget in zip(titles, self._rows.values(), strict=True):
            self.form.addRow(QLabel(title), widget)

    def show_motion(self, motion: Motion | None, markers: tuple[str, ...], dim: int) -> None:
        """Show a motion of one of these moving boundaries, or nothing."""
        self._motion, self._dim = motion, dim
        self.setVisible(motion is not None)
        if motion is None:
            return
        self._sync_markers(motion, markers)
        self.kind.show_value(type(motion))
        shown = {"path"} if isinstance(motion, FromFile) else set()
        if isinstance(motion, Translate):
            shown = {"vector"}
            self.vector.show_value(motion.vector)
        elif isinstance(motion, Rotate):
            shown = {"angle", "about"} | ({"axis"} if dim == 3 else set())
            self.angle.show_value(motion.angle_deg)
            self.axis.show_value(motion.axis)
        elif isinstance(motion, Scale):
            shown = {"factors", "about"}
            factors = motion.factors if len(motion.factors) > 1 else motion.factors * dim
            self.factors.show_value(factors)
        elif str(motion.path) != self.path.text() and not self.path.hasFocus():
            self.path.setText("" if motion.path == Path() else str(motion.path))
        if isinstance(motion, Rotate | Scale):
            self.about.show_value("centroid" if motion.point == "centroid" else "point")
            if motion.point != "centroid":
                shown.add("point")
                self.point.show_value(motion.point)
        for vector in (self.vector, self.factors, self.point):
            vector.set_count(dim)
        for name, widget in self._rows.items():
            self.form.setRowVisible(widget, name in shown)

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
            self.changed.emit(new_motion(kind, self._motion.marker, self._dim))

    def _about_chosen(self, what: str) -> None:
        if what == "point" and isinstance(self._motion, Rotate | Scale):
            centre = self._centroid.get(self._motion.marker, (0.0,) * self._dim)
            self.point.show_value(centre)
        self._tell()

    def set_centroids(self, centroids: dict[str, tuple[float, ...]]) -> None:
        """Take the centroids of boundaries: where a point starts that nobody has typed yet."""
        self._centroid = centroids

    def _tell(self) -> None:
        marker, kind = self.marker.currentData() or "", type(self._motion)
        point = "centroid" if self.about.currentData() == "centroid" else self.point.value
        if kind is Translate:
            motion: Motion = Translate(marker, self.vector.value)
        elif kind is Rotate:
            axis = self.axis.value if self._dim == 3 else (0.0, 0.0, 1.0)
            if not any(axis):
                self.axis.fields[0].setToolTip("The axis needs a direction: not all may be 0.")
                return
            motion = Rotate(marker, self.angle.value, point, axis)
        elif kind is Scale:
            motion = Scale(marker, self.factors.value, point)
        else:
            motion = FromFile(Path(self.path.text().strip()), marker)
        if motion != self._motion:
            self.changed.emit(motion)

    def _browse(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Displacement file", self.path.text())
        if name:
            self.path.setText(name)
            self._tell()


def new_motion(kind: type, marker: str, dim: int) -> Motion:
    """Return a motion of that kind which does not move anything yet."""
    if kind is Translate:
        return Translate(marker, (0.0,) * dim)
    if kind is Rotate:
        return Rotate(marker, 0.0)
    if kind is Scale:
        return Scale(marker, (1.0,) * dim)
    return FromFile(Path(), marker)


def describe(motion: Motion) -> str:
    """Return a motion in a few words."""
    if isinstance(motion, Translate):
        what = f"translate by ({', '.join(f'{v:.4g}' for v in motion.vector)})"
    elif isinstance(motion, Rotate):
        what = f"rotate by {motion.angle_deg:.5g}°" + _about(motion.point)
    elif isinstance(motion, Scale):
        what = f"scale by {' × '.join(f'{v:.4g}' for v in motion.factors)}" + _about(motion.point)
    else:
        what = f"displace as in {motion.path.name or '(no file yet)'}"
    return f"{motion.marker or 'all moving'}: {what}"


def _about(point: object) -> str:
    if point == "centroid":
        return " about its centroid"
    return f" about ({', '.join(f'{v:.4g}' for v in point)})"
