"""The editor of a motion: boundary, kind, numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QFileDialog, QLabel, QWidget

from slideviz.case.model import (
    BoxMotion,
    Bump,
    Cst,
    Ffd,
    FfdCamber,
    FfdThickness,
    FfdTwist,
    FromFile,
    HicksHenne,
    Motion,
    OnAirfoil,
    Radial,
    Rotate,
    Scale,
    Target,
    Translate,
    named,
)
from slideviz.case.motion_words import direction_words, target_words
from slideviz.gui.panels.motion_form import ABOUT, MotionForm, new_motion
from slideviz.gui.widgets.fields import NumberField
from slideviz.gui.widgets.vector_field import VectorField
from slideviz.session.motions import Axis, radial

Z = (0.0, 0.0, 1.0)
"""Axis of rotations in 2D."""
RAISED = {
    True: ("Outwards by", "outwards, the lower side down,"),
    False: ("Raised by", "towards +y"),
}
"""Title and direction of the height of an airfoil's motion, by whether it is `HicksHenne`."""


class MotionEditor(MotionForm):
    """The editor of a motion, which emits each valid change."""

    changed = Signal(object)  # Motion
    """The motion as edited, in place of the one that was shown."""
    table_wanted = Signal()
    """The user wants to edit the rows of the motion's displacement file."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motion: Motion | None = None
        self._dim = 3
        self._targets: tuple[Target, ...] = ()
        self._centroid: Callable[[Target], tuple[float, ...]] = lambda _: (0.0,) * self._dim
        self._chord: Callable[[Target], tuple[float, float]] = lambda _: (0.0, 1.0)
        self._machine: Axis | None = None
        self._boxes: tuple[str, ...] = ()
        self._as_point = False
        self._connect()
        self.show_motion(None, (), 3)

    def _connect(self) -> None:
        self.marker.chosen.connect(lambda _: self._emit_changed())
        self.kind.chosen.connect(self._kind_chosen)
        self.about.chosen.connect(self._about_chosen)
        self.box.chosen.connect(lambda _: self._emit_changed())
        self.side.chosen.connect(lambda _: self._emit_changed())
        for field in self._rows.values():
            if isinstance(field, NumberField | VectorField):
                field.changed.connect(lambda _: self._emit_changed())
        self.path.textEdited.connect(lambda _: self._emit_changed())
        self.browse.clicked.connect(self._browse)
        self.table.clicked.connect(lambda _: self.table_wanted.emit())

    def show_motion(self, motion: Motion | None, targets: tuple[Target, ...], dim: int) -> None:
        """Show a motion, offering ``targets`` and ``dim`` components; None hides the editor."""
        self._motion, self._dim = motion, dim
        self.setVisible(motion is not None)
        if motion is None:
            return
        self._sync_targets(motion, targets)
        self.kind.set_item_enabled(FfdTwist, dim == 3)  # a section has no span to twist along
        self.kind.show_value(type(motion))
        shown = self._show_numbers(motion, dim)
        if isinstance(motion, Rotate | Scale | Radial):
            shown |= {"about"} | self._show_place(motion, dim)
        for vector in (self.vector, self.factors, self.point):
            vector.set_count(dim)
        self.index.set_count(dim - isinstance(motion, FfdCamber | FfdThickness))
        self.show_rows(shown)

    def _show_numbers(self, motion: Motion, dim: int) -> set[str]:
        """Fill the fields with a motion's numbers, and return the names of their rows."""
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
        if isinstance(motion, Ffd):
            self._sync_boxes(motion.box)
            self.index.show_value(motion.index)
            self.vector.show_value(motion.vector)
            return {"box", "index", "vector"}
        if isinstance(motion, FfdCamber | FfdThickness):
            self._sync_boxes(motion.box)
            self.index.show_value(motion.index)
            self.amount.show_value(motion.amount)
            return {"box", "index", "amount"}
        if isinstance(motion, FfdTwist):
            self._sync_boxes(motion.box)
            self.plane.show_value(motion.plane)
            self.angle.show_value(motion.angle_deg)
            self.point.show_value(motion.point)
            self.axis.show_value(motion.axis)
            return {"box", "plane", "angle", "point", "axis"}
        if isinstance(motion, OnAirfoil):
            return self._show_bump(motion)
        if not isinstance(motion, FromFile):
            return set()
        if str(motion.path) != self.path.text() and not self.path.hasFocus():
            self.path.setText("" if motion.path == Path() else str(motion.path))
        return {"path"}

    def _show_bump(self, motion: OnAirfoil) -> set[str]:
        """Fill the fields for a bump on an airfoil; return the names of their rows."""
        self.raised.show_value(motion.height)
        title, way = RAISED[isinstance(motion, HicksHenne)]
        label = self.form.labelForField(self.raised)
        assert isinstance(label, QLabel)
        label.setText(title)
        self.raised.set_tip(f"How far it moves {way}, in the mesh's length unit.")
        self.chord.show_value(motion.chord)
        shown = {"raised", "chord"}
        if not isinstance(motion, Bump):
            self.side.show_value(motion.side)
            shown.add("side")
        if isinstance(motion, Cst):
            self.term.show_value(motion.term)
            return shown | {"term"}
        self.peak.show_value(round(100.0 * motion.peak, 10))
        return shown | {"peak"}

    def _bump(self, motion: OnAirfoil) -> OnAirfoil:
        """Return the bump on an airfoil that the fields describe, in place of ``motion``."""
        low, high = motion.chord if self.chord.problem else self.chord.value
        values: dict[str, Any] = {"height": self.raised.value, "chord": (low, high)}
        if isinstance(motion, Cst):
            k, n = motion.term if self.term.problem else self.term.value
            values["term"] = (int(k), int(n))
        else:
            values["peak"] = round(self.peak.value / 100.0, 14)
        if not isinstance(motion, Bump):
            values["side"] = self.side.currentData()
        return replace(motion, marker=self._targets[self.marker.currentData()], **values)

    def _show_place(self, motion: Rotate | Scale | Radial, dim: int) -> set[str]:
        """Fill the fields for a motion's fixed point and axis; return the names of their rows."""
        offered = ["point"] if isinstance(motion, Radial) else ["centroid", "point"]
        if self._machine is not None and not isinstance(motion, Scale):
            offered.insert(-1, "axis")
        if self._radial(motion) is not None:
            offered.insert(-1, "radial")
        words = [self._about_words(what) for what in offered]
        if [self.about.itemText(row) for row in range(self.about.count())] != words:
            self.about.clear()
            for what, word in zip(offered, words, strict=True):
                self.about.addItem(word, what)
        what = "centroid" if motion.point == "centroid" else "point"
        if "axis" in offered and self._is_machine(motion) and not self._as_point:
            what = "axis"
        elif "radial" in offered and what == "centroid" and motion.axis == self._radial(motion):
            what = "radial"
        self.about.show_value(what)
        if motion.point != "centroid":
            self.point.show_value(motion.point)
        if not isinstance(motion, Scale):
            self.axis.show_value(motion.axis)
        turns = not isinstance(motion, Scale) and dim == 3 and what not in ("axis", "radial")
        return ({"point"} if what == "point" else set()) | ({"axis"} if turns else set())

    def _radial(self, motion: Motion) -> tuple[float, float, float] | None:
        """Return the radial direction through the centroid of a rotation's target.

        None if the motion is no rotation, or the mesh is 2D or does not repeat about an axis.
        """
        if self._machine is None or self._dim == 2 or not isinstance(motion, Rotate):
            return None
        return radial(self._machine, self._centroid(motion.marker))

    def _about_words(self, what: str) -> str:
        if what in ("centroid", "radial") and len(named(self._motion.marker)) != 1:
            return ABOUT[what].replace("its", "their")
        if what != "axis" or self._dim == 2 or self._machine is None:
            return ABOUT[what]
        axis, _ = self._machine
        return f"{ABOUT[what]} ({direction_words(axis)})"

    def _is_machine(self, motion: Rotate | Scale | Radial) -> bool:
        if self._machine is None or isinstance(motion, Scale):
            return False
        axis, origin = self._machine
        return motion.axis == axis and motion.point == origin[: self._dim]

    def _sync_targets(self, motion: Motion, targets: tuple[Target, ...]) -> None:
        targets = tuple(dict.fromkeys((*targets, motion.marker)))
        if targets != self._targets:
            self._targets = targets
            self.marker.clear()
            for place, target in enumerate(targets):
                # The item's data is an index: Qt would turn a tuple of names into a list.
                self.marker.addItem(target_words(target), place)
        self.marker.show_value(targets.index(motion.marker))

    def _sync_boxes(self, chosen: str) -> None:
        names = tuple(dict.fromkeys((*self._boxes, chosen)))
        if [self.box.itemData(row) for row in range(self.box.count())] != list(names):
            self.box.clear()
            for name in names:
                self.box.addItem(name or "(no box)", name)
        self.box.show_value(chosen)

    def _kind_chosen(self, kind: type) -> None:
        if self._motion is not None and type(self._motion) is not kind:
            marker = self._motion.marker
            chord = self._chord(marker)
            motion = new_motion(kind, marker, self._dim, self._machine, self._boxes, chord)
            self.changed.emit(motion)

    def _about_chosen(self, what: str) -> None:
        """Set the fixed point and axis to a choice, a key of `ABOUT`, and emit the motion."""
        motion = self._motion
        assert motion is not None
        across = self._radial(motion)
        radially = across is not None and getattr(motion, "axis", None) == across
        self._as_point = what == "point"
        if what == "point" and getattr(motion, "point", None) == "centroid":
            self.point.show_value(self._centroid(motion.marker))
        elif what == "axis" and self._machine is not None:
            axis, origin = self._machine
            self.axis.show_value(axis)
            self.point.show_value(origin)
        elif what == "radial" and across is not None:
            self.axis.show_value(across)
        elif what == "centroid" and radially and self._machine is not None:
            self.axis.show_value(self._machine[0])
        self._emit_changed()
        # The motion may be the same, but other fields belong to this choice.
        self.show_motion(self._motion, self._targets, self._dim)

    def show_another(self) -> None:
        """Reset what is not of the motion before another is shown: “a point”, invalid texts."""
        self._as_point = False
        for field in self._rows.values():
            if isinstance(field, NumberField | VectorField):
                field.restore()

    def focus(self) -> None:
        """Put the cursor into the first number field of the shown motion, and select its text."""
        first = {
            Translate: self.vector.fields[0],
            Rotate: self.angle,
            Scale: self.factors.fields[0],
            Radial: self.percent,
            HicksHenne: self.raised,
            Cst: self.raised,
            Bump: self.raised,
            Ffd: self.index.fields[0],
            FfdCamber: self.index.fields[0],
            FfdThickness: self.index.fields[0],
            FfdTwist: self.plane,
            FromFile: self.path,
        }.get(type(self._motion))
        if first is not None:
            first.setFocus()
            first.selectAll()

    def set_centroid(self, centroid: Callable[[Target], tuple[float, ...]]) -> None:
        """Set the function that returns a target's centroid, offered as the first fixed point."""
        self._centroid = centroid

    def set_chord(self, chord: Callable[[Target], tuple[float, float]]) -> None:
        """Set the function that returns from which x to which x a target goes."""
        self._chord = chord

    def set_extent(self, extent: float) -> None:
        """Set the size of the mesh; coordinates that are rounding errors beside it show as 0."""
        self.point.set_scale(extent)

    def set_machine(self, machine: Axis | None) -> None:
        """Set the axis about which the mesh repeats; None if it does not."""
        self._machine = machine

    def set_boxes(self, names: tuple[str, ...]) -> None:
        """Set the names of the boxes for free-form deformation that can be chosen."""
        self._boxes = names

    def _emit_changed(self) -> None:
        """Emit the motion that the fields describe, if it differs from the shown one."""
        marker, kind = self._targets[self.marker.currentData()], type(self._motion)
        x, y, z = self.axis.value if self._dim == 3 else Z
        if self.axis.problem:
            x, y, z = getattr(self._motion, "axis", Z)
        axis, point = (x, y, z), self.point.value
        centred = self.about.currentData() in ("centroid", "radial")
        about: tuple[float, ...] | Literal["centroid"] = "centroid" if centred else point
        if kind is Translate:
            motion: Motion = Translate(marker, self.vector.value)
        elif kind is Rotate:
            motion = Rotate(marker, self.angle.value, about, axis)
        elif kind is Scale:
            motion = Scale(marker, self.factors.value, about)
        elif kind is Radial:
            factor = round(1.0 + self.percent.value / 100.0, 14)
            motion = Radial(marker, factor, self.distance.value, axis, point)
        elif isinstance(self._motion, OnAirfoil):
            motion = self._bump(self._motion)
        elif isinstance(self._motion, BoxMotion):
            motion = self._of_box(marker, self._motion, axis)
        else:
            motion = FromFile(Path(self.path.text().strip()), marker)
        if motion != self._motion:
            self.changed.emit(motion)

    def _of_box(
        self, marker: Target, before: BoxMotion, axis: tuple[float, float, float]
    ) -> BoxMotion:
        """Return the motion of a box that the fields describe; in 2D, the last index stays."""
        box = self.box.currentData()
        if isinstance(before, FfdTwist):
            angle, point = self.angle.value, self.point.value
            return FfdTwist(marker, box, int(self.plane.value), angle, point, axis)
        last = before.index[-1]
        at = before.index if self.index.problem else (*self.index.value, last)
        if not isinstance(before, Ffd):
            i, j = (int(value) for value in at[:2])
            return type(before)(marker, box, (i, j), self.amount.value)
        i, j, k = (int(value) for value in at[:3])
        dx, dy, dz = (*self.vector.value, 0.0)[:3]
        return Ffd(marker, box, (i, j, k), (dx, dy, dz))

    def _browse(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, "Displacement file", self.path.text())
        if name:
            self.path.setText(name)
            self._emit_changed()
