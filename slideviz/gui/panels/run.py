"""The run panel: run, requirements, progress, cancel."""

from __future__ import annotations

import html

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QPushButton, QSizePolicy

from slideviz.color_scheme import ColorScheme
from slideviz.errors import Message
from slideviz.gui.commands import COMMANDS, Command
from slideviz.gui.widgets.build import (
    LinkLabel,
    QuietBar,
    in_column,
    in_row,
    push_button,
    set_style,
    wrapped,
)
from slideviz.gui.widgets.panel import Panel
from slideviz.gui.widgets.theme import icon
from slideviz.mesh.margin import reach_words
from slideviz.session import changes
from slideviz.session.jobs import JobProgress
from slideviz.session.reach import reach_run
from slideviz.session.run_messages import (
    Requirement,
    end_parts,
    exact_cost,
    inverted_words,
    limits_words,
    path_ending,
    remarks_of,
    remedy_for,
    run_requirements,
    with_field_labels,
)
from slideviz.session.state import Preview, Run, Session

LONGEST_TEXT = 100  # number of letters from which a text is shortened (see `_shortened`)
SETTINGS = "settings"
NOTES = "notes"
REACH = "reach"
"""Targets of links in the text: take the settings of the shown run, show its notes, show the curve
of how far its motion may go."""


class RunPanel(Panel):
    """The panel to run and cancel, with a line of text: progress, result or what is missing."""

    requirement_clicked = Signal(object)  # a missing `Requirement`, to be led to where it is met

    def make(self) -> None:
        self._busy = self._progress_text = ""
        self._compiling = False
        self._missing: tuple[Requirement, ...] = ()
        self._cost = ""
        self._remedy: tuple[Run | None, Message | None, str] = (None, None, "")
        self.run = self._button(COMMANDS["run"], "#ffffff")
        self.cancel = self._button(COMMANDS["cancel"], "#3b4652")
        self.text = LinkLabel()
        self.text.setMinimumHeight(34)
        # A long sentence wraps; it must not make all panels on this side wider.
        self.text.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.text.linkActivated.connect(self._link)
        self.bar = QuietBar()
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setFixedHeight(6)
        policy = self.bar.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.bar.setSizePolicy(policy)
        row = in_row(self.run, self.cancel, self.text, wide=[self.text])
        # The panel is the lowest one, and grows upwards: so a line more does not move the button.
        for widget in (self.run, self.cancel, self.text):
            row.setAlignment(widget, Qt.AlignmentFlag.AlignBottom)
        in_column(row, self.bar, spacing=5, on=self, margins=6)
        # Some checks go through the mesh: they are not repeated if only the view changed.
        self.follow(_checked, self._check)
        self.follow()

    def _button(self, command: Command, color: str) -> QPushButton:
        words = command.title.replace("&", "")
        button = push_button(
            words, command.button_tip, lambda: command.do(self.services), command.name
        )
        button.setIcon(icon(command.image, color))
        button.setShortcut(command.button_key)
        return button

    def _check(self, session: Session) -> None:
        self._missing = run_requirements(session)
        self._cost = exact_cost(session.case, session.mesh) if session.mesh else ""

    def sync(self, session: Session) -> None:
        self.cancel.setVisible(bool(self._busy))
        self.run.setVisible(not self._busy)
        self.bar.setVisible(bool(self._busy or session.preview))
        self.run.setEnabled(not self._missing)
        if self._busy or self._missing:
            set_style(self.text, "bad", False)
        if self._busy:
            return
        self.bar.setValue(0)
        if self._missing:
            first = self._missing[0]
            more = len(self._missing) - 1
            text = html.escape(_shortened(first.text))
            self.text.setText(
                f"<a href='{first.place}'>{text}</a>" + (f" (+{more} more)" if more else "")
            )
            tip = "\n".join(missing.text for missing in self._missing)
            self.text.setToolTip(wrapped(tip))
            self.run.setToolTip(wrapped(tip))
            return
        self.run.setToolTip(COMMANDS["run"].button_tip)
        self.text.setToolTip("")
        if session.preview is not None:
            self._show_preview(session.preview)
            return
        self._show_run(session)

    def _show_preview(self, preview: Preview) -> None:
        """Show how far the motion may go: the bar is full where the first cell folds."""
        safe = preview.safe
        self.bar.setValue(round(1000 * min(1.0, 1.0 / max(safe.fraction, 1e-3))))
        words = safe.words if safe.cell is None else f"the motion {reach_words(safe.fraction)}"
        bad = preview.frame.quality.inverted > 0
        self.text.setText(f"Preview: {words}.")
        self.text.setToolTip(wrapped(f"{safe.words}. The bar is full where the first cell folds."))
        set_style(self.text, "bad", bad)

    def _show_run(self, session: Session) -> None:
        """Show how the shown run ended, or that the panels have other settings than it."""
        run = session.run_shown
        bad = ""
        if run is None:
            self._show_ready("Ready.", session)
        elif not session.outdated:
            bad = inverted_words(run)
            text, reach = map(html.escape, end_parts(run))
            if reach_run(session):
                reach = f"<a href='{REACH}'>{reach}</a>"
            text = text + reach
            notes = remarks_of(run, "note")
            count = f"{len(notes)} note{'' if len(notes) == 1 else 's'}"
            link = f" <a href='{NOTES}'>{count}</a>" if notes else ""
            self.text.setText((f"<b>{text}</b>" if bad else text) + link)
            if bad and self._remedy[:2] != (run, session.folding):
                # The boundaries beside its cells are searched once.
                remedy = remedy_for(run, session.mesh, session.folding)
                self._remedy = (run, session.folding, remedy)
            lines = [self._remedy[2], *notes] if bad else list(notes)
            if run.safe is not None:
                words = run.safe.words
                lines.append(f"{words[:1].upper()}{words[1:]}{path_ending(run)}.")
            self.text.setToolTip(wrapped("\n".join(lines)))
        elif run is session.runs[-1] and run.panels != session.case:
            self._show_ready("Settings changed since the last run.", session)
        else:
            link = f"<a href='{SETTINGS}'>Use its settings</a>"
            design = run.panels is not None and html.escape(run.name)
            name = design or f"run {run.number}"
            self.text.setText(f"The panels differ from {name}. {link}")
        missed = run is not None and not session.outdated and limits_words(run)
        set_style(self.text, "bad", bool(bad or missed))

    def _show_ready(self, text: str, session: Session) -> None:
        """Show ``text`` (or a warning that cells will fold), and the cost of the run."""
        folding = session.folding
        full = with_field_labels(f"{folding}.") if folding else ""
        text = _shortened(full) if full else text
        text = html.escape(" ".join(filter(None, (text, self._cost))))
        self.text.setText(f"<a href='motion'>{text}</a>" if folding else text)
        self.text.setToolTip(wrapped(full))

    def _link(self, target: str) -> None:
        if target == NOTES:
            run = self.session.run_shown
            if run is not None:
                text = "\n".join(f"Note: {note}" for note in remarks_of(run, "note"))
                self.services.banner.show_message(text)
        elif target == REACH:
            self.requirement_clicked.emit(Requirement("", "curves"))
        elif target == SETTINGS:
            self.change(changes.adopt_settings, self.session.shown)
        else:
            asked = Requirement("", "motion")
            self.requirement_clicked.emit((*self._missing, asked)[0])

    def take_theme(self, _scheme: ColorScheme) -> None:
        """Set the text again: a label's links keep the colors of the old theme otherwise."""
        text = self.text.text()
        self.text.clear()
        self.text.setText(text)

    def set_busy(self, what: str) -> None:
        """Show the name of the running job; an empty text means that none runs."""
        self._busy = what
        self.cancel.setEnabled(True)
        self.bar.setRange(0, 1000)
        self.bar.setValue(0)
        if what:
            self._show_progress_text(what)
            self.text.setToolTip("")
        self.sync(self.session)

    def show_progress(self, progress: JobProgress) -> None:
        if not self._busy:
            return
        self._show_progress_text(progress.text)
        if progress.fraction is None:
            self.bar.setRange(0, 0)
        else:
            self.bar.setRange(0, 1000)
            self.bar.setValue(round(1000 * progress.fraction))

    def set_compiling(self, compiling: bool) -> None:
        """Show with the progress of a job whether it may wait for compilation."""
        self._compiling = compiling
        if self._busy and self.cancel.isEnabled():
            self._show_progress_text(self._progress_text)

    def _show_progress_text(self, text: str) -> None:
        self._progress_text = text
        self.text.setText(html.escape(f"{text} (compiling, once)" if self._compiling else text))

    def show_cancelling(self) -> None:
        self.cancel.setEnabled(False)
        self.text.setText("Cancelling…")


def _checked(session: Session) -> object:
    return session.mesh, session.case, session.intersection, session.invalid


def _shortened(text: str) -> str:
    """Return a text short enough to stand beside the button: a long one only up to its ``;``.

    One within brackets does not end it.
    """
    if len(text) <= LONGEST_TEXT:
        return text
    ends = (end for end, letter in enumerate(text) if letter == ";" and _is_closed(text[:end]))
    return text[: next(ends, len(text))].removesuffix(".") + "."


def _is_closed(text: str) -> bool:
    return text.count("(") == text.count(")")
