"""The run panel, run and cancel, and its strip over the view: progress, result, messages."""

from __future__ import annotations

import html
from collections.abc import Callable
from functools import partial

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QPushButton

from slideviz.case.words import counted
from slideviz.color_scheme import ColorScheme
from slideviz.gui.commands import COMMANDS, Command
from slideviz.gui.widgets.banner import Answers, MessageStrip
from slideviz.gui.widgets.build import (
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
    Notice,
    Requirement,
    end_parts,
    exact_cost,
    inverted_words,
    limits_words,
    notices,
    path_ending,
    run_requirements,
    with_field_labels,
)
from slideviz.session.state import Preview, Session

LONGEST_TEXT = 100  # number of letters from which a text is shortened (see `_shortened`)
SETTINGS = "settings"
REACH = "reach"
"""Targets of links in the text: take the settings of the shown run, show the curve of how far its
motion may go."""


class RunPanel(Panel):
    """The panel to run and cancel.

    Its ``strip`` is over the view: progress, result or what is missing, and all messages.
    """

    requirement_clicked = Signal(object)  # a missing `Requirement`, to be led to where it is met

    def make(self) -> None:
        self._busy = self._progress_text = ""
        self._compiling = False
        self._missing: tuple[Requirement, ...] = ()
        self._listed: tuple[Notice, ...] = ()
        self._cost = ""
        self.run = self._button(COMMANDS["run"], "#ffffff")
        self.cancel = self._button(COMMANDS["cancel"], "#3b4652")
        self.strip = MessageStrip()
        self.text = self.strip.text
        self.text.linkActivated.connect(self._link)
        self.bar = QuietBar()
        self.bar.setRange(0, 1000)
        self.bar.setTextVisible(False)
        self.bar.setFixedHeight(6)
        policy = self.bar.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.bar.setSizePolicy(policy)
        row = in_row(self.run, self.cancel, self.bar, wide=[self.bar])
        in_column(row, on=self, margins=6)
        # Some checks go through the mesh: they are not repeated if only the view changed.
        self.follow(_checked, self._check)
        self.follow(
            lambda session: (
                _checked(session),
                session.run_shown,
                session.folding,
                session.outdated,
            ),
            self._list_messages,
        )
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

    def _list_messages(self, session: Session) -> None:
        """List the messages of the session, with their buttons, unless the text has all of it."""
        listed = tuple(notices(session, self._missing))
        if listed == self._listed:
            return
        self._listed = listed
        if len(listed) == 1 and listed[0].kind == "task" and not listed[0].settings:
            listed = ()
        kinds = dict.fromkeys(one.kind for one in listed)
        count = [counted(sum(one.kind == kind for one in listed), kind) for kind in kinds]
        rows = [(_named(one), one.kind != "error", self._answers(one)) for one in listed]
        self.strip.show_rows(", ".join(count), rows)

    def _answers(self, notice: Notice) -> Answers:
        """Return what the buttons of a message do."""
        answers: dict[str, Callable[[], object]] = {}
        for name in notice.commands:
            command = COMMANDS[name]
            answers[command.title.replace("&", "")] = partial(command.do, self.services)
        for key, value in notice.settings:
            put = partial(self.change, changes.set_keys, **{key: value})
            answers[with_field_labels(f"{key}= {value}")] = put
        if notice.leads is not None:
            lead = partial(self.requirement_clicked.emit, notice.leads)
            answers[f"Show the {notice.leads.place}"] = lead
        return answers

    def sync(self, session: Session) -> None:
        self.strip.setVisible(session.mesh is not None or bool(self._busy))
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
            text = html.escape(_shortened(first.text))
            self.text.setText(f"<a href='{first.place}'>{text}</a>")
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
            self.text.setText(f"<b>{text}</b>" if bad else text)
            if run.safe is not None:
                words = run.safe.words
                tip = f"{words[:1].upper()}{words[1:]}{path_ending(run)}."
                self.text.setToolTip(wrapped(tip))
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
        if target == REACH:
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


def _named(notice: Notice) -> str:
    return f"Note: {notice.text}" if notice.kind == "note" else notice.text


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
