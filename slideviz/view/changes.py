"""Pure functions from one session to the next: everything the user can ask for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from slideviz.case.model import Case, FromFile, Motion, Reduction, Role
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import Pair
from slideviz.view.guess import guess_case, guess_roles
from slideviz.view.inspect import ONLY_INVERTED
from slideviz.view.keep import kept_view
from slideviz.view.state import ColourBy, Frame, Run, Session, ViewState

if TYPE_CHECKING:
    from slideviz.view.section import Section

MANY_NODES = 20_000
"""Boundary nodes from which on a mesh is opened with data reduction."""

RELATIVE_TOLERANCE = 1e-5

TASTE = (
    "edges",
    "undeformed",
    "motion_ghost",
    "legend",
    "triad",
    "perspective",
    "colour_map",
)
"""Settings of the view that suit any mesh, so that they stay when another is opened."""

UNDEFORMED = 0
"""Stands for the undeformed mesh among the numbers of runs, which begin with 1."""

Place = Literal["open", "boundaries", "motion", "method"]


@dataclass(frozen=True)
class Missing:
    """What must be put right before a run, in words, and which panel does it."""

    text: str
    place: Place


def open_mesh(
    first: Frame, path: Path | None, pairs: Sequence[Pair] = (), case: Case | None = None
) -> Session:
    """Return a session with a mesh just read; without a case its roles are guessed."""
    mesh = first.mesh
    guesses = {} if case is not None else guess_roles(mesh, pairs)
    chosen = guess_case(mesh, guesses, pairs) if case is None else case
    listed = {name: chosen.roles.get(name, "fixed") for name in mesh.marker_names}
    others = {name: role for name, role in chosen.roles.items() if name not in listed}
    chosen = chosen.change(roles=listed | others, mesh_file=path or chosen.mesh_file)
    view = kept_view(chosen, ViewState(), mesh.marker_names)
    # From here on the view is the session's; it goes back into the case when that is saved.
    chosen = chosen.change(view={})
    session = Session(mesh, path, chosen, guesses, tuple(pairs), first, saved=chosen, view=view)
    return session if case is not None else _guess_reduction(session, mesh)


def _guess_reduction(session: Session, mesh: Mesh) -> Session:
    """Return the session with data reduction where all boundary nodes would be too many."""
    if not mesh.markers:
        return session
    count = len(np.unique(np.concatenate([marker.nodes for marker in mesh.markers])))
    if count <= MANY_NODES:
        return session
    case = session.case.change(reduction=suggested_reduction(mesh))
    why = (
        f"Data reduction is a guess: without it, {count:,} boundary nodes would need up to "
        f"{2.6 * 8 * count**2 / 1e9:.0f} GB of memory."
    )
    return replace(session, case=case, saved=case, reduction_guess=why)


def suggested_reduction(mesh: Mesh) -> Reduction:
    """Return data reduction with a tolerance that suits the size of the mesh: 1e-5 of it."""
    return Reduction(tolerance=float(f"{RELATIVE_TOLERANCE * mesh.extent:.2g}") or 1e-300)


def set_role(session: Session, names: Iterable[str], role: Role) -> Session:
    """Return the session with these boundaries in that role, which confirms it for them."""
    changed = tuple(names)
    roles = dict(session.case.roles) | dict.fromkeys(changed, role)
    guesses = {name: guess for name, guess in session.guesses.items() if name not in changed}
    motions = tuple(
        motion
        for motion in session.case.motions
        if not motion.marker or roles.get(motion.marker) == "moving"
    )
    case = session.case.change(roles=roles, motions=motions)
    if "periodic" not in roles.values():
        case = case.change(periodic="none")
    return replace(session, case=case, guesses=guesses)


def confirm(session: Session, names: Iterable[str] | None = None) -> Session:
    """Return the session with the guesses for these boundaries (default: all) taken as right."""
    gone = set(session.guesses if names is None else names)
    kept = {name: guess for name, guess in session.guesses.items() if name not in gone}
    return replace(session, guesses=kept)


def set_case(session: Session, **values: Any) -> Session:
    """Return the session with other settings of the case."""
    guess = "" if "reduction" in values else session.reduction_guess
    return replace(session, case=session.case.change(**values), reduction_guess=guess)


def add_motion(session: Session, motion: Motion) -> Session:
    """Return the session with one more motion, performed last."""
    return set_case(session, motions=(*session.case.motions, motion))


def replace_motion(session: Session, index: int, motion: Motion) -> Session:
    """Return the session with another motion at that place."""
    motions = list(session.case.motions)
    motions[index] = motion
    return set_case(session, motions=tuple(motions))


def remove_motion(session: Session, index: int) -> Session:
    """Return the session without the motion at that place."""
    motions = session.case.motions
    return set_case(session, motions=motions[:index] + motions[index + 1 :])


def move_motion(session: Session, index: int, by: int) -> Session:
    """Return the session with a motion performed earlier (negative) or later."""
    motions = list(session.case.motions)
    motion = motions.pop(index)
    motions.insert(max(0, index + by), motion)
    return set_case(session, motions=tuple(motions))


def set_view(session: Session, **values: Any) -> Session:
    """Return the session looked at in another way.

    What the colours say has a range of its own, which is there again when it is coloured by again.
    """
    old = session.view
    what: ColourBy = values.get("colour_by", old.colour_by)
    if what != old.colour_by:
        ranges = dict(old.ranges)
        if old.colour_range is not None:
            ranges[old.colour_by] = old.colour_range
        values = {"colour_range": ranges.pop(what, None)} | values
        values["ranges"] = tuple(sorted(ranges.items()))
        # Cells chosen by a quality say nothing of a displacement, and the other way round.
        if "displacement" in (what, old.colour_by) and old.threshold != ONLY_INVERTED:
            values.setdefault("threshold", None)
    return replace(session, view=replace(old, **values))


def select(session: Session, names: Iterable[str]) -> Session:
    """Return the session with these boundaries highlighted."""
    return set_view(session, selected=tuple(names))


def show(session: Session, names: Iterable[str], shown: bool = True) -> Session:
    """Return the session with these boundaries shown or hidden."""
    hidden = session.view.hidden
    change = frozenset(names)
    return set_view(session, hidden=hidden - change if shown else hidden | change)


def isolate(session: Session, names: Iterable[str]) -> Session:
    """Return the session with only these boundaries shown."""
    every = session.mesh.marker_names if session.mesh else ()
    return set_view(session, hidden=frozenset(every) - frozenset(names))


def show_frame(session: Session, index: int) -> Session:
    """Return the session at another step, the nearest there is."""
    return set_view(session, frame=min(max(index, 0), max(len(session.frames) - 1, 0)))


def add_section(session: Session, section: Section) -> Session:
    """Return the session with one more section."""
    return set_view(session, sections=(*session.view.sections, section))


def replace_section(session: Session, index: int, section: Section) -> Session:
    """Return the session with another section at that place."""
    sections = list(session.view.sections)
    sections[index] = section
    return set_view(session, sections=tuple(sections))


def remove_section(session: Session, index: int) -> Session:
    """Return the session without the section at that place."""
    sections = session.view.sections
    return set_view(session, sections=sections[:index] + sections[index + 1 :])


def lay_flat(session: Session, index: int | None) -> Session:
    """Return the session with the section at that place laid flat beside the view; None: none."""
    laid = (replace(one, flat=i == index) for i, one in enumerate(session.view.sections))
    return set_view(session, sections=tuple(laid))


def mark(session: Session, cell: int | None) -> Session:
    """Return the session with a cell marked, or none."""
    return set_view(session, marked=cell)


def start_run(session: Session) -> Session:
    """Return the session with one more run, of the settings there are, and it shown.

    Runs that were cancelled or failed before their first step go.
    """
    kept = tuple(run for run in session.runs if run.frames)
    number = 1 + max((run.number for run in session.runs), default=0)
    session = replace(session, runs=(*kept, Run(number, session.case)), shown=number)
    return show_frame(session, 0)


def add_frames(session: Session, frames: Sequence[Frame]) -> Session:
    """Return the session with steps just computed by the newest run; the last is shown."""
    newest = session.runs[-1]
    grown = replace(newest, frames=(*newest.frames, *frames), saved=False)
    session = replace(session, runs=(*session.runs[:-1], grown))
    if session.shown != grown.number:
        return session  # the user looks at another run meanwhile
    return show_frame(session, len(grown.frames))


def end_run(session: Session, end: Literal["done", "cancelled", "failed"]) -> Session:
    """Return the session with the newest run ended that way, if one was going on."""
    if not session.runs or session.runs[-1].end:
        return session
    ended = replace(session.runs[-1], end=end)
    return replace(session, runs=(*session.runs[:-1], ended))


def show_run(session: Session, number: int) -> Session:
    """Return the session with the last step of that run shown."""
    run = session.run(number)
    if run is None:
        return session
    beside = None if session.view.beside == number else session.view.beside
    session = set_view(replace(session, shown=number), beside=beside)
    return show_frame(session, len(run.frames))


def show_beside(session: Session, number: int | None) -> Session:
    """Return the session with another run in a second view beside the first; None: no such.

    ``UNDEFORMED`` stands for the undeformed mesh.
    """
    known = number == UNDEFORMED or session.run(number) is not None
    if number == session.shown or not known:
        number = None
    return set_view(session, beside=number, swapped=False)


def remove_run(session: Session, number: int) -> Session:
    """Return the session without a run; one that goes on stays."""
    run = session.run(number)
    if run is None or not run.end:
        return session
    rest = tuple(other for other in session.runs if other.number != number)
    beside = None if session.view.beside == number else session.view.beside
    session = set_view(replace(session, runs=rest), beside=beside)
    if session.shown != number:
        return session
    if not rest:
        return show_frame(set_view(replace(session, shown=None), beside=None), 0)
    return show_run(session, rest[-1].number)


def take_settings(session: Session, number: int) -> Session:
    """Return the session with the settings of a run put back: roles, motions, method."""
    run = session.run(number)
    if run is None:
        return session
    return replace(session, case=run.case, guesses={}, reduction_guess="")


def seen_beside(session: Session) -> Session:
    """Return the session as the second view shows it: the other run, at the matching step."""
    if session.view.beside == UNDEFORMED:
        return show_frame(session, 0)
    run, other = session.run_shown, session.run(session.view.beside)
    if other is None:
        return session
    last = len(run.frames) if run is not None else 0
    at = session.view.frame
    # Runs of different numbers of steps: the same part of the displacement.
    frame = round(at * len(other.frames) / last) if last else 0
    if at:
        frame = max(frame, 1)
    return show_frame(replace(session, shown=other.number), frame)


def saved_case(session: Session, case: Case) -> Session:
    """Return the session with ``case`` on disk."""
    return replace(session, case=case, saved=case)


def saved_mesh(session: Session) -> Session:
    """Return the session with the deformed mesh of the run that is shown on disk."""
    runs = tuple(
        replace(run, saved=True) if run.number == session.shown else run for run in session.runs
    )
    return replace(session, runs=runs)


def fresh_view(session: Session, old: ViewState) -> Session:
    """Return a session just opened with the taste of the one before: edges, legend, colours."""
    kept = {name: getattr(old, name) for name in TASTE}
    return set_view(session, **kept)


def is_missing(session: Session) -> tuple[Missing, ...]:
    """Return what must be put right before a run, most urgent first; empty when ready."""
    if session.mesh is None:
        return (Missing("Open a mesh first.", "open"),)
    case, found = session.case, []
    moving = case.markers_with("moving")
    if not moving:
        found.append(Missing("No boundary moves: give one the role “moving”.", "boundaries"))
    given = {motion.marker for motion in case.motions}
    found += [
        Missing(f"“{name}” has no motion: add one.", "motion")
        for name in moving
        if name not in given and "" not in given
    ]
    for motion in case.motions:
        if isinstance(motion, FromFile) and not motion.path.is_file():
            text = f"The displacement file {motion.path} does not exist."
            found.append(Missing(text, "motion"))
    if case.periodic == "moving" and case.sliding == "none":
        text = "Moving periodic vertices need sliding: choose pseudo or direct."
        found.append(Missing(text, "method"))
    if not found:
        found = [Missing(text, "boundaries") for text in _problems(session)]
    if not found and session.clash:
        found = [Missing(session.clash, "motion")]
    return tuple(found)


def _problems(session: Session) -> list[str]:
    """Return what the case itself finds wrong with the mesh."""
    from slideviz.case.motion import check_case

    assert session.mesh is not None
    return [str(problem) for problem in check_case(session.case, session.mesh)]
