"""The form of a motion: rows for the numbers of all kinds of motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from qtpy.QtWidgets import QFormLayout, QLabel, QPushButton, QSizePolicy, QWidget

from slideviz.case.model import (
    Bump,
    Cst,
    Ffd,
    FfdCamber,
    FfdThickness,
    FfdTwist,
    FromFile,
    HicksHenne,
    Motion,
    Radial,
    Rotate,
    Scale,
    Target,
    Translate,
)
from slideviz.gui.widgets.build import as_widget, grow_fields, in_row
from slideviz.gui.widgets.choice import Choice
from slideviz.gui.widgets.fields import NumberField, TextField, not_zero
from slideviz.gui.widgets.vector_field import VectorField, a_direction
from slideviz.session.motions import Axis
from slideviz.terms import MOTION_KINDS, SIDES

ABOUT = {
    "centroid": "its centroid",
    "axis": "the machine's axis",
    "radial": "radial through its centroid",
    "point": "a point",
}
"""What a motion leaves in place, by the choice's value."""


class MotionForm(QWidget):
    """The fields for all kinds of motion, in a form of which only some rows are shown."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.form = QFormLayout(self)
        self.form.setContentsMargins(0, 2, 0, 0)
        grow_fields(self.form)
        self._make_fields()
        self._place_fields()

    def _make_fields(self) -> None:
        self.marker = Choice(
            {},
            "The boundaries that move. To move some of them as one body, about their common "
            "centroid, select them in the table of boundaries first; then you can choose them "
            "here.",
        )
        self.kind = Choice(KINDS)
        self.vector = VectorField(
            tip="How far it moves along each axis, in the mesh's length unit."
        )
        self.angle = NumberField(
            tip="Degrees; positive turns counter-clockwise seen against the axis."
        )
        self.factors = VectorField(
            (1.0, 1.0, 1.0), tip="Enlargement along each axis: 1 leaves it, 2 doubles it."
        )
        for field in self.factors.fields:
            field._allowed = not_zero
        self.percent = NumberField(
            allowed=_scale_problem,
            tip="How much larger the radius becomes, in percent: 3 is 3 % outwards.",
        )
        self.distance = NumberField(
            tip="How far it also moves outwards, in the mesh's length unit."
        )
        first = {what: ABOUT[what] for what in ("centroid", "point")}
        self.about = Choice(first, "What stays in place while it turns or grows.")
        self.point = VectorField(tip="The point that stays in place.")
        self.axis = VectorField(
            (0.0, 0.0, 1.0), a_direction, tip="Direction of the axis; its length does not matter."
        )
        self.box = Choice({}, "The box whose control points move: of the mesh, or of the case.")
        self.index = VectorField(
            allowed=control_point_problem,
            names="ijk",
            tip="The control point, counted from 0 along each direction of the box; -1 is all.",
        )
        self.plane = NumberField(
            0.0,
            plane_index_problem,
            tip="The plane of control points, counted from 0 along j; -1 is all.",
        )
        self.amount = NumberField(
            tip="How far control points move, in the mesh's length unit. With the thickness, the "
            "last ones move forwards, and the first ones as far backwards."
        )
        self.side = Choice({side: term.label for side, term in SIDES.items()}, "Which side moves.")
        self.side.set_tips({side: term.tip for side, term in SIDES.items()})
        self.term = VectorField(
            (1.0, 1.0),
            term_problem,
            names=("term", "of"),
            tip="The term of the shape function, counted from 1 at the leading edge, and how many.",
        )
        self.peak = NumberField(
            50.0, peak_problem, tip="Where the bump is highest, in percent of the chord."
        )
        self.raised = NumberField(tip="How far it is raised, in the mesh's length unit.")
        self.chord = VectorField(
            (0.0, 1.0),
            chord_problem,
            names=("x from", "to"),
            tip="x of the leading and of the trailing edge: the airfoil lies along x.",
        )
        self.path = TextField()
        self.path.setToolTip("A line for each node: its number and its displacement.")
        self.browse = QPushButton("…")
        self.browse.setMaximumWidth(30)
        self.browse.setToolTip("Choose the file.")
        self.table = QPushButton("Table…")
        self.table.setObjectName("motion_table")
        self.table.setToolTip("Type or paste the rows, or change them, and save them as the file.")

    def _place_fields(self) -> None:
        both = (self.kind, self.marker)
        line = in_row(*both, wide=both, spacing=6)
        line.setStretch(0, 4)  # room for the longest kind, where the window is 1280 pixels wide
        line.setStretch(1, 3)
        self.form.addRow("Motion", as_widget(line))
        file = as_widget(in_row(self.path, self.browse, self.table, wide=[self.path], spacing=4))
        self._rows: dict[str, QWidget] = {}
        for name, title, widget in (
            ("box", "Box", self.box),
            ("index", "Control point", self.index),
            ("plane", "Plane j", self.plane),
            ("vector", "By", self.vector),
            ("amount", "By", self.amount),
            ("angle", "Angle (°)", self.angle),
            ("factors", "Factors", self.factors),
            ("percent", "Radius by (%)", self.percent),
            ("distance", "and by (length)", self.distance),
            ("about", "About", self.about),
            ("point", "Point", self.point),
            ("axis", "Axis", self.axis),
            ("side", "Side", self.side),
            ("term", "Shape", self.term),
            ("peak", "Peak at (%)", self.peak),
            ("raised", "Raised by", self.raised),
            ("chord", "Chord", self.chord),
            ("path", "File", file),
        ):
            self._rows[name] = widget
            self.form.addRow(QLabel(title), widget)
        # One width for all labels, so that the fields do not jump from motion to motion.
        labels = [self.form.labelForField(widget) for widget in self._rows.values()]
        widest = max(label.sizeHint().width() for label in labels)
        for label in labels:
            label.setMinimumWidth(widest)
        for choice in (self.kind, self.marker, self.about, self.box, self.side):
            choice.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)

    def show_rows(self, names: set[str]) -> None:
        """Show the rows with these names, and hide the others."""
        for name, widget in self._rows.items():
            self.form.setRowVisible(widget, name in names)


def _scale_problem(value: float) -> str:
    """Return why a radius cannot change by this many percent; empty if it can."""
    return "" if value > -100.0 else "-100 % or less would fold the boundary"


KINDS: dict[type, str] = {
    Translate: MOTION_KINDS["translate"].label,
    Rotate: MOTION_KINDS["rotate"].label,
    Scale: MOTION_KINDS["scale"].label,
    Radial: MOTION_KINDS["radial"].label,
    HicksHenne: MOTION_KINDS["hicks-henne"].label,
    Cst: MOTION_KINDS["cst"].label,
    Bump: MOTION_KINDS["bump"].label,
    Ffd: MOTION_KINDS["ffd"].label,
    FfdCamber: MOTION_KINDS["ffd-camber"].label,
    FfdThickness: MOTION_KINDS["ffd-thickness"].label,
    FfdTwist: MOTION_KINDS["ffd-twist"].label,
    FromFile: MOTION_KINDS["file"].label,
}
"""Labels of the kinds of motion, by class."""


def control_point_problem(values: Sequence[float]) -> str:
    """Return why numbers are no index of a control point; empty if they are."""
    whole = all(value == int(value) and value >= -1 for value in values)
    return "" if whole else "expected whole numbers from 0, or -1 for all"


def plane_index_problem(value: float) -> str:
    """Return why a number is none of a plane of control points; empty if it is."""
    return control_point_problem((value,))


def term_problem(values: Sequence[float]) -> str:
    """Return why numbers are no term of a shape function; empty if they are."""
    k, n = values
    whole = k == int(k) and n == int(n) and 1 <= k <= n
    return "" if whole else "expected whole numbers, and a term from 1 to how many there are"


def peak_problem(value: float) -> str:
    """Return why a bump cannot have its peak at this percentage of the chord; empty if it can."""
    return "" if 0.0 < value < 100.0 else "the peak lies between 0 and 100 % of the chord"


def chord_problem(values: Sequence[float]) -> str:
    """Return why a chord cannot go from one x to another; empty if it can."""
    return "" if values[0] < values[1] else "the trailing edge has the larger x"


def new_motion(
    kind: type,
    marker: Target,
    dim: int,
    machine: Axis | None = None,
    boxes: Sequence[str] = (),
    chord: tuple[float, float] = (0.0, 1.0),
) -> Motion:
    """Return a motion of a kind with zero displacement, to be edited.

    Rotations and radial motions are about ``machine``, the axis about which the mesh repeats, if
    there is one; a free-form deformation moves a control point of the first of ``boxes``, a bump
    is one of an airfoil along ``chord``.
    """
    if kind in (HicksHenne, Cst, Bump):
        return kind(marker, 0.0, chord=chord)
    axis, origin = machine or ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    if kind is Translate:
        return Translate(marker, (0.0,) * dim)
    if kind is Rotate:
        return Rotate(marker, 0.0, "centroid" if machine is None else origin[:dim], axis)
    if kind is Radial:
        return Radial(marker, 1.0, 0.0, axis, origin[:dim])
    if kind is Scale:
        return Scale(marker, (1.0,) * dim)
    if kind is Ffd:
        return Ffd(marker, (*boxes, "")[0], (0, 0, 0 if dim == 3 else -1), (0.0, 0.0, 0.0))
    if kind in (FfdCamber, FfdThickness):
        return kind(marker, (*boxes, "")[0], (0, 0 if dim == 3 else -1), 0.0)
    if kind is FfdTwist:
        return FfdTwist(marker, (*boxes, "")[0], 0, 0.0)
    return FromFile(Path(), marker)
