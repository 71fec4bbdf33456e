"""The editor of a section: direction, point, position or size, whole cells or cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from qtpy.QtCore import QSignalBlocker, Qt, Signal
from qtpy.QtGui import QStandardItemModel
from qtpy.QtWidgets import QFormLayout, QLabel, QSlider, QWidget

from slideviz.errors import CaseError
from slideviz.gui.responsiveness.timers import single_shot
from slideviz.gui.widgets.build import check_box, grow_fields, in_row
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import NumberField
from slideviz.gui.widgets.vector_field import VectorField
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.sections.model import Section, Triple
from slideviz.session import section_cuts

STEPS = 1000
"""Positions of the slider."""

FREE = "free"
AXES: dict[str, Triple] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
"""The directions that can be chosen by name."""


class SectionEditor(QWidget):
    """The editor of a section, which emits the section after each valid change.

    While the slider is dragged, at most one section is emitted per turn of the event loop, so that
    drawing never falls behind the mouse.
    """

    changed = Signal(object)  # Section
    """The section as edited."""
    dragging = Signal(bool)
    """The slider was pressed (True) or released (False)."""

    def __init__(self) -> None:
        super().__init__()
        self._section: Section | None = None
        self._points: FloatArray | None = None
        self._mesh: Mesh | None = None
        self._span = (0.0, 1.0)
        self._span_of: tuple[object, ...] = ()
        # Whether the fields of a free direction are shown; they stay while a direction is typed,
        # even along x, y or z.
        self._free = self._typing = False
        self._place: int | None = None
        self._make_fields()
        self._place_fields()
        self._soon = single_shot(self, self._slider_moved)

    def _make_fields(self) -> None:
        self.axis = Choice({**{word: word for word in AXES}, FREE: "free"})
        self.axis.chosen.connect(self._axis_chosen)
        self.direction = VectorField((0.0, 0.0, 1.0), tip="Any length but zero.")
        self.direction.changed.connect(self._direction_typed)
        self.centre = VectorField()
        self.centre.changed.connect(self._centre_typed)
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, STEPS)
        self.slider.setPageStep(STEPS // 20)
        self.slider.setMinimumWidth(80)
        self.slider.valueChanged.connect(lambda _: self._soon.start())
        self.slider.sliderPressed.connect(lambda: self.dragging.emit(True))
        self.slider.sliderReleased.connect(self._slider_released)
        self.number = NumberField(0.0, self._allowed)
        self.number.setFixedWidth(84)
        self.number.changed.connect(self._position_typed)
        tip = "Show the cells it cuts whole, instead of cut."
        self.whole = check_box("Whole cells", tip, lambda on: self._emit_changed(whole_cells=on))

    def _place_fields(self) -> None:
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        grow_fields(form)
        self.axis_name, self.place_name = QLabel("Normal"), QLabel("Position")
        # One width for all words, so that the fields do not jump.
        self.axis_name.setMinimumWidth(self.fontMetrics().horizontalAdvance("Position"))
        axis = in_row(self.axis, self.whole, wide=[self.axis], spacing=6)
        place = in_row(self.slider, self.number, wide=[self.slider], spacing=6)
        form.addRow(self.axis_name, axis)
        form.addRow("", self.direction)
        self.centre_name = QLabel("Centre")
        form.addRow(self.centre_name, self.centre)
        form.addRow(self.place_name, place)
        self.form = form

    # What is shown ---------------------------------------------------------------------

    def show_section(
        self, section: Section | None, mesh: Mesh | None, place: int | None = None
    ) -> None:
        """Show a section of a mesh; ``place`` is its row in the list. None hides the editor."""
        other = (place, _way(section)) != (self._place, _way(self._section))
        self._section, self._place = section, place
        self.setVisible(section is not None and mesh is not None)
        if section is None or mesh is None:
            return
        if mesh is not self._mesh:
            self._mesh, self._points = mesh, section_cuts.cell_points(mesh)
        terms, flat = section.shape.terms, mesh.dim == 2
        # A circle's axis is always z.
        fixed = flat and bool(terms.point)
        word = _axis_of(section)
        # A direction changed elsewhere (undo, handle) is shown as x, y or z again if it is.
        if other and not self._typing:
            self._free = False
        self._free = self._free or word == FREE
        self.axis.setVisible(not fixed)
        self.axis_name.setText("" if fixed else terms.direction.capitalize())
        self.centre_name.setText(terms.point)
        self.place_name.setText("Position" if terms.size is None else terms.size.label)
        self.axis.setToolTip(f"Direction of the {terms.direction}.")
        self.number.set_tip(terms.tip(mesh.dim))
        self.axis.show_value(FREE if self._free else word)
        self.direction.set_count(mesh.dim)
        self.centre.set_count(mesh.dim)
        self.centre.set_tip(f"{terms.point_tip(mesh.dim)}, in the mesh's length unit.")
        self.direction.show_value(section.direction)
        self.centre.show_value(section.origin)
        for widget, shown in (
            (self.direction, self._free and not fixed),
            (self.centre, bool(terms.point)),
        ):
            self.form.setRowVisible(widget, shown)
        with QSignalBlocker(self.whole):
            self.whole.setChecked(section.whole_cells)
        self._sync_axes(flat)
        self._sync_place(section)

    def _sync_axes(self, flat: bool) -> None:
        """Enable the choice of z, unless the mesh is 2D."""
        at = self.axis.findData("z")
        model = self.axis.model()
        assert isinstance(model, QStandardItemModel)
        model.item(at).setEnabled(not flat)

    def _sync_place(self, section: Section) -> None:
        """Show position or size; the slider's range is found again only if it may have changed."""
        centre = section.origin if section.shape.terms.point else ()
        key = (self._mesh, section.kind, section.direction, centre)
        if key != self._span_of:
            assert self._points is not None
            self._span_of, self._span = key, section_cuts.position_range(section, self._points)
        value, (low, high) = section.shape.position(section), self._span
        self.number.show_value(float(f"{value:.6g}"))
        if self.slider.isSliderDown() or self._soon.isActive():
            return  # the user is moving the slider
        share = (value - low) / (high - low) if high > low else 0.0
        with QSignalBlocker(self.slider):
            self.slider.setValue(round(float(np.clip(share, 0.0, 1.0)) * STEPS))

    # Widgets to state ------------------------------------------------------------------

    def _emit_changed(self, **values: object) -> None:
        if self._section is not None:
            self._emit(replace(self._section, **values))  # type: ignore[arg-type]

    def _emit(self, section: Section) -> None:
        if section != self._section:
            self.changed.emit(section)

    def _axis_chosen(self, word: str) -> None:
        self._free = word == FREE
        if self._section is None or self._points is None:
            return
        if word == FREE:
            self.show_section(self._section, self._mesh, self._place)
        else:
            self._emit(section_cuts.with_direction(self._section, AXES[word], self._points))

    def _direction_typed(self, values: tuple[float, ...]) -> None:
        x, y, z = (*values, 0.0, 0.0)[:3]
        direction = x, y, z
        if any(direction) and self._section is not None and self._points is not None:
            self._typing = True
            try:
                self._emit(section_cuts.with_direction(self._section, direction, self._points))
            finally:
                self._typing = False
        elif not any(direction):
            self.direction.fields[0].setToolTip("A direction is needed: not all may be 0.")

    def _centre_typed(self, values: tuple[float, ...]) -> None:
        self._emit_changed(origin=(*values, 0.0)[:3])

    def _position_typed(self, value: float) -> None:
        if self._section is not None:
            self._emit(self._section.shape.at_position(self._section, value))

    def _allowed(self, value: float) -> str:
        if self._section is None:
            return ""
        try:
            self._section.shape.at_position(self._section, value)
        except CaseError as problem:
            return str(problem)
        return ""

    def _slider_released(self) -> None:
        if self._soon.isActive():
            self._soon.stop()
            self._slider_moved()
        self.dragging.emit(False)

    def _slider_moved(self) -> None:
        if self._section is None:
            return
        low, high = self._span
        # A radius of 0 is not allowed, and a plane through the outermost nodes cuts nothing.
        share = np.clip(self.slider.value() / STEPS, 1e-4, 1.0 - 1e-4)
        value = low + float(share) * (high - low)
        self._emit(self._section.shape.at_position(self._section, value))


def _way(section: Section | None) -> tuple[object, ...]:
    return () if section is None else (section.kind, section.direction)


def _axis_of(section: Section) -> str:
    """Return ``x``, ``y`` or ``z`` if the section's direction is along that axis, else `FREE`."""
    unit = np.asarray(section.direction) / np.linalg.norm(section.direction)
    for word, axis in AXES.items():
        along = float(unit @ np.asarray(axis))
        if (along if section.shape.terms.one_way else abs(along)) > 1.0 - 1e-12:
            return word
    return FREE
