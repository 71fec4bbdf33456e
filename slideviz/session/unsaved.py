"""Unsaved work, which closing or opening another mesh would lose, and the question about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from slideviz.session.state import Session


@dataclass(frozen=True, eq=False)
class Unsaved:
    """Unsaved work of a session.

    Attributes
    ----------
    session : Session
    what : mapping
        The words for what would be lost: of a case, of a mesh, of a run that goes on; of designs,
        as ``table``, a sentence.
    """

    session: Session
    what: Mapping[str, str]

    @classmethod
    def of(cls, session: Session, busy: bool, designs: str = "") -> Unsaved:
        """Return the unsaved work of a session, while a job runs or none does, and of designs."""
        what = {}
        cut, source = unsaved_sections(session), session.case.source
        if session.unsaved_case or cut:
            last = ", method and sections" if session.view.sections else " and method"
            new = f"roles, motions{last} as a case"
            what["case"] = f"the changes to {source.name}" if source else new
        run = session.run_shown
        # The mesh of a design comes again at a click.
        if session.unsaved_mesh and run is not None and run.panels is None:
            # While it goes on there is no last step to save.
            name = "mesh" if run.end and not busy else "run"
            what[name] = f"the deformed mesh of run {run.number}"
        if designs:
            what["table"] = designs
        return cls(session, what)

    @property
    def can_save(self) -> list[str]:
        """Return what can be saved now: ``case``, ``mesh`` and ``table``."""
        return [name for name in self.what if name != "run"]

    def question(self, before: str) -> str:
        """Return the question to the user; a second line says what saving is good for.

        Parameters
        ----------
        before : str
            What the work would be lost by, as ``closing``.
        """
        number = self.session.shown
        if "table" in self.what:
            rest = self._without("table")
            what = "Save the table of designs"
            question = rest.question(before) if rest.what else f"{what} before {before}?"
            return f"{question}\n{self.what['table']}"
        if "run" in self.what:
            if len(self.what) == 1:
                return f"Run {number} goes on. Lose its steps?"
            lost = "Its steps are lost, for it goes on; cancel it to save what there is."
            return f"{self._without('run').question(before)}\nRun {number} goes on. {lost}"
        text = f"Save {' and '.join(self.what.values())} before {before}?"
        more = " ".join(filter(None, (self._repeats(), self._others())))
        return f"{text}\n{more}" if more else text

    def _without(self, gone: str) -> Unsaved:
        """Return the work but for one part of it."""
        return replace(self, what={name: self.what[name] for name in self.what if name != gone})

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
    """Tell whether the sections are others than those of the case file, however they are shown.

    Where there is no case file they were only looked at: False.
    """
    now, saved = (
        [replace(section, shown=True, flat=False, name="") for section in sections]
        for sections in (session.view.sections, session.saved_sections)
    )
    return session.case.source is not None and now != saved


def title_of(session: Session) -> str:
    """Return the title of the window that shows a session, with a star if something is unsaved."""
    file = session.case.source or session.path
    # The mesh of a run that the case on disk repeats is not what is unsaved of it, nor is that of
    # a design.
    run = session.run_shown
    comes_again = session.repeatable or (run is not None and run.panels is not None)
    lost = session.unsaved_mesh and not comes_again
    star = "*" if session.unsaved_case or unsaved_sections(session) or lost else ""
    return f"{star}{file.name} – slideviz" if file else "slideviz"
