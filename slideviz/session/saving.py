"""The view in a case file: made from a session that is saved, and put into one that is opened."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from slideviz.argument_types import record
from slideviz.case.keys import SectionText, hyphened
from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from slideviz.formats.openfoam_paths import shown_name
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import Pair
from slideviz.sections.model import Section
from slideviz.sections.span import between_walls, find_walls
from slideviz.session.state import Run, Session, ViewState
from slideviz.terms import SHOWN, Numbers, Texts


@record
class Unsaved:
    """Unsaved work of a session."""

    session: Session
    lost: Mapping[str, str]
    """The words for what would be lost, by its kind: ``run``, a question on the run that goes on;
    ``case``; ``mesh``, the deformed mesh of the run shown; ``runs``, that there are others;
    ``table``, a sentence on the table of designs."""
    named: Run | None = None  # the run that `lost` is about, whose mesh or steps would be lost

    @classmethod
    def of(cls, session: Session, busy: bool, designs: str = "") -> Unsaved:
        """Return the unsaved work of a session.

        ``busy``: whether a job is running. ``designs``: a sentence on a table of designs that would
        be lost; "" for none.
        """
        lost = {}
        # The mesh of a design is computed again at a click.
        last = session.runs[-1] if session.runs else None
        going = busy and last is not None and not last.end and last.panels is None
        run = last if going else session.run_shown
        if going and run is not None:
            lost["run"] = _stop_question(run)
        cut = unsaved_sections(session)
        source = session.case.source
        if session.unsaved_case or cut:
            more = ", method and sections" if session.view.sections else " and method"
            lost["case"] = f"the changes to {source.name}" if source else f"roles, motions{more}"
        if not going and session.unsaved_mesh and run is not None and run.panels is None:
            part = f" ({run.progress_words})" if run.incomplete else ""
            lost["mesh"] = f"the deformed mesh of run {run.number}{part}"
        elif not going and any(map(_is_unsaved, session.runs)):
            lost["runs"] = "the session"
        if designs:
            lost["table"] = designs
        return cls(session, lost, run)

    @property
    def can_save(self) -> list[str]:
        """Return what can be saved: ``session`` has all, then kinds of lost work with own files.

        While a run goes on, only ``run``, to be stopped first.
        """
        each = [name for name in self.lost if name != "runs"]
        return ["run"] if "run" in self.lost else ["session", *each]

    def question(self, before: str) -> str:
        """Return the question to the user, with what else to know in further lines.

        ``before``: the action that would lose the work, such as "closing".
        """
        table = self.lost.get("table", "")
        kept = [self.lost[name] for name in ("case", "mesh", "runs") if name in self.lost]
        if "run" in self.lost:
            case = f"Not saved either: {kept[0]}." if kept else ""
            lines = [self.lost["run"], " ".join(filter(None, (case, self._others())))]
        elif kept:
            source = self.session.case.source
            if "case" in self.lost and source is None:
                kept[0] += " as a case"
            lines = [f"Save {' and '.join(kept)} before {before}?"]
            lines.append(" ".join(filter(None, (self._repeats(), self._others()))))
        else:
            lines = [f"Save the table of designs before {before}?"]
        return "\n".join(filter(None, (*lines, table)))

    def _repeats(self) -> str:
        run = self.session.run_shown
        if self.session.unsaved_case and run and run.end == "done" and not self.session.outdated:
            return f"The case repeats run {run.number} exactly."
        return ""

    def _others(self) -> str:
        """Return a sentence about the other runs whose meshes are not saved."""
        runs = filter(_is_unsaved, self.session.runs)
        others = [str(run.number) for run in runs if run is not self.named]
        if len(others) == 1:
            return f"The mesh of run {others[0]} is not saved either."
        return f"The meshes of runs {', '.join(others)} are not saved either." if others else ""


def _is_unsaved(run: Run) -> bool:
    """Return whether a run would be lost; that of a design is computed again at a click."""
    return bool(run.frames) and not run.saved and run.panels is None


def _stop_question(run: Run) -> str:
    """Return the question whether a run that goes on is to be stopped, and what is kept of it."""
    count = len(run.frames)
    if not count:
        return f"Run {run.number} is still running, and has no finished step yet. Stop it?"
    steps = "finished step" if count == 1 else f"{count} finished steps"
    return f"Run {run.number} is still running. Stop it and keep its {steps}?"


def unsaved_sections(session: Session) -> bool:
    """Return whether the sections differ from those of the case file, but for how they are shown.

    False where there is no case file.
    """
    if session.case.source is None or session.view.sections is session.saved_sections:
        return False
    return _places(session.view.sections) != _places(session.saved_sections)


def _places(sections: Sequence[Section]) -> list[Section]:
    """Return sections without how they are shown."""
    return [replace(section, shown=True, flat=False, name="") for section in sections]


def title_of(session: Session) -> str:
    """Return the title of the window that shows a session, with a star if something is unsaved."""
    file = session.case.source or session.path
    # No star for the mesh of a run that the case on disk repeats, nor for that of a design.
    run = session.run_shown
    comes_again = session.repeatable or (run is not None and run.panels is not None)
    lost = session.unsaved_mesh and not comes_again
    star = "*" if session.unsaved_case or unsaved_sections(session) or lost else ""
    part = f" – {run.progress_words}" if run is not None and run.incomplete else ""
    return f"{star}{shown_name(file)}{part} – slideviz" if file else "slideviz"


Camera = Numbers
"""Position, focal point and view-up (3 numbers each), and parallel scale (half the visible height);
perhaps also width over height of the view."""


_FIELDS = {
    "VIEW_COLOR": "color_by",
    "VIEW_RANGE": "color_range",
    "VIEW_MAP": "color_map",
    "VIEW_THRESHOLD": "threshold",
    "VIEW_POINTS": "points",
    "VIEW_COPIES": "passages",
}
"""Keys that have the value of a field of the view as it is."""


def view_to_case(session: Session, camera: Camera | None = None) -> Case:
    """Return the case of a session with its view and camera as keys; defaults are left out."""
    view = session.view
    first = ViewState()
    changed = {
        key: getattr(view, field)
        for key, field in _FIELDS.items()
        if getattr(view, field) != getattr(first, field)
    }
    if view.drawn != first.drawn:
        changed["VIEW_SHOW"] = tuple(hyphened(name) for name in SHOWN if name in view.drawn)
    if view.hidden:
        names = session.mesh.marker_names if session.mesh is not None else ()
        changed["VIEW_HIDDEN"] = tuple(name for name in names if name in view.hidden)
    if view.sections:
        changed["VIEW_SECTIONS"] = tuple(_text(section) for section in view.sections)
    if camera is not None:
        changed["VIEW_CAMERA"] = camera
    return session.case.change(view=changed)


def view_from_case(case: Case, view: ViewState, names: Texts) -> ViewState:
    """Return the view that a case has; what it leaves out is taken from ``view``.

    ``names``: the boundaries of the mesh; other names of hidden boundaries are ignored.
    """
    kept = case.view
    values: dict[str, Any] = {field: kept[key] for key, field in _FIELDS.items() if key in kept}
    if "VIEW_SHOW" in kept:
        values["drawn"] = frozenset(name for name in SHOWN if hyphened(name) in kept["VIEW_SHOW"])
    if "VIEW_HIDDEN" in kept:
        values["hidden"] = frozenset(kept["VIEW_HIDDEN"]) & frozenset(names)
    if "VIEW_SECTIONS" in kept:
        values["sections"] = tuple(_section(text) for text in kept["VIEW_SECTIONS"])
    return replace(view, **values)


def as_recovered(session: Session, source: Path | None) -> Session:
    """Return a session just opened from its recovery file as unsaved, of case file ``source``."""
    return replace(session, case=session.case.change(source=source), saved=Case())


def _text(section: Section) -> SectionText:
    size = () if section.terms.size is None else (section.size,)
    numbers = (*size, *section.direction, *section.origin)
    return (
        section.kind,
        tuple(float(n) for n in numbers),
        section.whole_cells,
        section.flat,
        section.shown,
    )


def _section(text: SectionText) -> Section:
    kind, numbers, whole, flat, shown = text
    *size, a, b, c, x, y, z = numbers
    section = Section.of(kind, (x, y, z), (a, b, c), sum(size))
    return replace(section, whole_cells=whole, shown=shown, flat=flat)


def with_walls(section: Section, mesh: Mesh, case: Case, pairs: Sequence[Pair] = ()) -> Section:
    """Return a section of constant span with hub and shroud of the case; others as they are.

    Raises CaseError or MeshError if there are none.
    """
    if section.kind != "span":
        return section
    periods = [pair for pair in pairs if pair.kind == "rotational"]
    about = section.direction, section.origin
    return between_walls(section, find_walls(mesh, case, periods, about=about))


def bound_sections(
    sections: Sequence[Section], mesh: Mesh, case: Case, pairs: Sequence[Pair]
) -> tuple[Section, ...]:
    """Return sections `with_walls`, or without where there are none: these cut nothing."""
    out = []
    for section in sections:
        try:
            out.append(with_walls(section, mesh, case, pairs))
        except SlidevizError:
            out.append(replace(section, walls=None))
    return tuple(out)


def continued_case(session: Session, path: Path) -> Case:
    """Return the case of the deformed mesh of a session, saved at ``path``, for a further motion.

    The mesh of the session becomes the reference, unless that has one itself.
    """
    case = view_to_case(session)
    reference = case.reference_file or session.path
    return case.change(mesh_file=path, mesh_format=None, reference_file=reference, source=None)


def files_of(case: Case) -> Iterable[Path]:
    """Return the files that a case needs: its mesh, the reference, and those of its motions."""
    return case.change(source=None).inputs()


def files_beside(case: Case, path: Path, folder: Path) -> dict[Path, Path]:
    """Return new paths, beside the case file ``path``, for a case's files that are in ``folder``.

    By old path; none where ``path`` is in that folder, too.
    """
    if folder in path.parents:
        return {}
    return {
        file: path.with_suffix(file.suffix)
        if file == case.mesh_file
        else path.with_name(f"{path.stem}_{file.name}")
        for file in files_of(case)
        if folder in file.parents and file.is_file()
    }
