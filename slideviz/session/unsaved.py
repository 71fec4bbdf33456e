"""Unsaved work, which closing or opening another mesh would lose, and the question about it.

`slideviz.gui.files` looks for unsaved work, and `ask_unsaved` of `slideviz.gui.widgets.questions`
asks the question.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from slideviz.session.state import Session


@dataclass(frozen=True, eq=False)
class Unsaved:
    """Unsaved work of a session."""

    session: Session
    lost: Mapping[str, str]
    """The words for what would be lost, by its kind: ``case``; ``mesh``, the deformed mesh of the
    run shown, or ``run`` while that goes on; ``table``, a sentence on the table of designs."""

    @classmethod
    def of(cls, session: Session, busy: bool, designs: str = "") -> Unsaved:
        """Return the unsaved work of a session.

        Parameters
        ----------
        busy : bool
            Whether a job is running.
        designs : str
            A sentence on a table of designs that would be lost; "" for none.
        """
        lost = {}
        cut, source = unsaved_sections(session), session.case.source
        if session.unsaved_case or cut:
            last = ", method and sections" if session.view.sections else " and method"
            new = f"roles, motions{last} as a case"
            lost["case"] = f"the changes to {source.name}" if source else new
        run = session.run_shown
        # The mesh of a design is computed again at a click.
        if session.unsaved_mesh and run is not None and run.panels is None:
            # A run that goes on has no last step to save.
            name = "mesh" if run.end and not busy else "run"
            lost[name] = f"the deformed mesh of run {run.number}"
        if designs:
            lost["table"] = designs
        return cls(session, lost)

    @property
    def can_save(self) -> list[str]:
        """Return the kinds of lost work that can be saved now: ``case``, ``mesh``, ``table``."""
        return [name for name in self.lost if name != "run"]

    def question(self, before: str) -> str:
        """Return the question to the user, with what else to know in further lines.

        Parameters
        ----------
        before : str
            The action that would lose the work, such as "closing".
        """
        number = self.session.shown
        if "table" in self.lost:
            rest = self._without("table")
            what = "Save the table of designs"
            question = rest.question(before) if rest.lost else f"{what} before {before}?"
            return f"{question}\n{self.lost['table']}"
        if "run" in self.lost:
            if len(self.lost) == 1:
                return f"Run {number} goes on. Lose its steps?"
            lost = "Its steps are lost, for it goes on; cancel it to save what there is."
            return f"{self._without('run').question(before)}\nRun {number} goes on. {lost}"
        text = f"Save {' and '.join(self.lost.values())} before {before}?"
        more = " ".join(filter(None, (self._repeats(), self._others())))
        return f"{text}\n{more}" if more else text

    def _without(self, gone: str) -> Unsaved:
        """Return the unsaved work without that of the kind ``gone``."""
        return replace(self, lost={name: self.lost[name] for name in self.lost if name != gone})

    def _repeats(self) -> str:
        run = self.session.run_shown
        if self.session.unsaved_case and run and run.end == "done" and not self.session.outdated:
            return f"The case repeats run {run.number} exactly."
        return ""

    def _others(self) -> str:
        """Return a sentence about the runs that are not shown and whose meshes are not saved."""
        runs = [
            run for run in self.session.runs if run.frames and not run.saved and run.panels is None
        ]
        others = [str(run.number) for run in runs if run is not self.session.run_shown]
        several = len(others) > 1
        return (
            f"The mesh{'es' * several} of run{'s' * several} {', '.join(others)} "
            f"{'are' if several else 'is'} not saved either."
            if others
            else ""
        )


def unsaved_sections(session: Session) -> bool:
    """Return whether the sections differ from those of the case file, but for how they are shown.

    False where there is no case file.
    """
    if session.case.source is None or session.view.sections is session.saved_sections:
        return False
    now, saved = (
        [replace(section, shown=True, flat=False, name="") for section in sections]
        for sections in (session.view.sections, session.saved_sections)
    )
    return now != saved


def title_of(session: Session) -> str:
    """Return the title of the window that shows a session, with a star if something is unsaved."""
    file = session.case.source or session.path
    # No star for the mesh of a run that the case on disk repeats, nor for that of a design.
    run = session.run_shown
    comes_again = session.repeatable or (run is not None and run.panels is not None)
    lost = session.unsaved_mesh and not comes_again
    star = "*" if session.unsaved_case or unsaved_sections(session) or lost else ""
    return f"{star}{file.name} – slideviz" if file else "slideviz"
