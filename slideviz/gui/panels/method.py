"""The method panel: sliding, periodicity, steps, data reduction, and more."""

from __future__ import annotations

from dataclasses import replace

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QWidget

from slideviz.case.model import Reduction
from slideviz.gui.panels.method_form import TIPS, MethodForm
from slideviz.gui.panels.method_more import NO_REDUCTION, enable, not_used
from slideviz.gui.widgets.field_watch import FieldWatch
from slideviz.view.missing import Missing
from slideviz.view.motions.period_words import found_text
from slideviz.view.session import changes
from slideviz.view.session.state import Session
from slideviz.view.session.store import Store


class MethodPanel(MethodForm):
    """Shows the settings of the case and changes them."""

    def __init__(self, store: Store, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.store = store
        self._mesh = None
        self._extent = 0.0
        self._reduction: Reduction | None = None
        self._connect()
        store.listen(lambda _old, new: self.sync(new))
        self.sync(store.session)
        self.watch = FieldWatch(self, store, "method")

    def _show_more(self) -> None:
        """Scroll to the settings that have opened below the others."""
        self.scroll.widget().adjustSize()
        bar = self.scroll.verticalScrollBar()
        bar.setValue(min(self.more.y(), bar.maximum()))

    def _connect(self) -> None:
        for name in ("method", "sliding", "periodic", "periodic_type"):
            getattr(self, name).chosen.connect(lambda value, name=name: self._set(name, value))
        self.axis.changed.connect(lambda value: self._set("axis", value))
        self.origin.changed.connect(lambda value: self._set("origin", value))
        self.steps.valueChanged.connect(lambda value: self._set("steps", value))
        self.reduction.toggled.connect(self._reduction_toggled)
        self.tolerance.changed.connect(self._tolerance_changed)
        self.more.changed.connect(self._set)
        self.more.button.toggled.connect(
            # When its form has been laid out.
            lambda on: on and QTimer.singleShot(0, self, self._show_more)
        )

    def lead_to(self, _missing: Missing) -> None:
        """Put the cursor where something is put right."""
        if not self.watch.focus():
            self.sliding.setFocus()

    def _set(self, name: str, value: object) -> None:
        if getattr(self.store.session.case, name) != value:
            self.store.change(changes.set_case, **{name: value})

    def _reduction_toggled(self, on: bool) -> None:
        # What was set before it was switched off comes back with it.
        mesh = self.store.session.mesh
        first = self._reduction or (changes.suggested_reduction(mesh) if mesh else Reduction())
        self._set("reduction", first if on else None)

    def _tolerance_changed(self, value: float) -> None:
        given = self.store.session.case.reduction or Reduction()
        self._set("reduction", replace(given, tolerance=value, relative=None))

    # State to widgets ------------------------------------------------------------------

    def sync(self, session: Session) -> None:
        """Show the session."""
        case = session.case
        for name in ("method", "sliding", "periodic", "periodic_type"):
            getattr(self, name).show_value(getattr(case, name))
        self.axis.show_value(case.axis)
        self.origin.set_scale(self._extent)
        self.origin.show_value(case.origin)
        if self.steps.value() != case.steps:
            self.steps.blockSignals(True)
            self.steps.setValue(case.steps)
            self.steps.blockSignals(False)
        self._sync_reduction(session)
        self.more.sync(session)
        self._sync_reasons(session)
        text = found_text(session)
        self.found.setText(text)
        self.form.setRowVisible(self.found, bool(text))

    def _sync_reduction(self, session: Session) -> None:
        given = session.case.reduction
        if session.mesh is not self._mesh:
            self._mesh, self._reduction = session.mesh, None
            # Once for each mesh: it takes 10 ms where there are 250,000 cells.
            self._extent = session.mesh.extent if session.mesh is not None else 0.0
        self._reduction = given or self._reduction
        self.reduction.blockSignals(True)
        self.reduction.setChecked(given is not None)
        self.reduction.blockSignals(False)
        no_method = not_used(session.case)
        enable(self.reduction, no_method, TIPS["reduction"])
        enable(self.tolerance, no_method or ("" if given else NO_REDUCTION), TIPS["tolerance"])
        extent = self._extent
        if self._reduction is not None:
            of_extent = self._reduction.relative
            absolute = of_extent * extent if of_extent else self._reduction.tolerance
            self.tolerance.show_value(float(f"{absolute:.6g}"))
        part = f"{self.tolerance.value / extent:.3g} of the extent" if extent and given else ""
        self.tolerance_hint.setText(part)
        self.guess_text.setText(session.reduction_guess)
        self.form.setRowVisible(self.guess_text, bool(session.reduction_guess))

    def _sync_reasons(self, session: Session) -> None:
        case = session.case
        roles = set(case.roles.values())
        no_pair = "" if "periodic" in roles else "no boundary has the role “periodic”"
        slides = roles & {"sliding", "periodic", "internal"}
        no_slide = "" if slides else "no boundary has the role “sliding” or “periodic”"
        rotational = case.periodic_type != "translational" and "rotational" in _kinds(session)
        rotational = rotational or case.periodic_type == "rotational"
        no_axis = no_pair or ("" if rotational else "only rotational periodicity has an axis")
        for name, why in (
            ("sliding", no_slide),
            ("periodic", no_pair),
            ("periodic_type", no_pair),
            ("axis", no_axis),
            ("origin", no_axis),
        ):
            enable(getattr(self, name), why, TIPS[name])
        for name in ("axis", "origin"):
            self.form.setRowVisible(getattr(self, name), not no_axis)
        reasons = list(
            dict.fromkeys(
                f"{title}: {why}."
                for title, why in (("Sliding", no_slide), ("Periodicity", no_pair))
                if why
            )
        )
        self.reason.setText(
            "\n".join(reasons) if session.mesh is not None else "Open a mesh first."
        )
        self.reason.setVisible(bool(self.reason.text()))


def _kinds(session: Session) -> set[str]:
    names = set(session.case.markers_with("periodic"))
    return {pair.kind for pair in session.pairs if {pair.first, pair.second} <= names}
