"""Changes of the case, as functions from one session to the next: roles, motions, settings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from slideviz.case.model import Case, FromFile, Motion, named
from slideviz.session.opening import guess_by_name, has_ffd, with_periodicity
from slideviz.session.rows import replaced, without
from slideviz.session.state import PanelPlace, Session
from slideviz.session.undoable import undoable
from slideviz.terms import Role


@undoable("role")
def set_role(session: Session, names: Iterable[str], role: Role) -> Session:
    """Return the session with boundaries in a role, which is no longer a guess.

    Motions lose boundaries that no longer move. Boundaries guessed periodic only because they match
    one of these become fixed. The first periodic boundary turns periodicity on, the last one off;
    the first sliding one turns pseudo sliding on where nothing slides.
    """
    changed = tuple(names)
    roles = dict(session.case.roles) | dict.fromkeys(changed, role)
    guesses = {name: guess for name, guess in session.guesses.items() if name not in changed}
    for name in _left_alone(session, changed, role):
        if name in guesses:
            del guesses[name]
            roles[name] = "fixed"
    still = (_of_moving(motion, roles) for motion in session.case.motions)
    motions = tuple(motion for motion in still if motion is not None)
    case = session.case.change(roles=roles, motions=motions)
    first_sliding = "sliding" in roles.values() and "sliding" not in session.case.roles.values()
    if first_sliding and case.sliding == "none":
        case = case.change(sliding="ps")
    if "periodic" not in roles.values():
        case = case.change(periodic="none")
    elif case.periodic == "none" and "periodic" not in session.case.roles.values():
        mine = (p for p in session.pairs if {p.first, p.second} & set(changed))
        case = with_periodicity(case, next(mine, None))
    return replace(session, case=case, guesses=guesses)


def _left_alone(session: Session, changed: Sequence[str], role: Role) -> Iterator[str]:
    """Yield the boundaries that match one of ``changed``, and whose names hint at no role.

    None where ``role`` is periodic.
    """
    for pair in session.pairs if role != "periodic" else ():
        for name, other in ((pair.first, pair.second), (pair.second, pair.first)):
            if other in changed and guess_by_name(name) is None:
                yield name


def _of_moving(motion: Motion, roles: Mapping[str, Role]) -> Motion | None:
    """Return the motion for those of its boundaries that move; None where none does."""
    names = named(motion.marker)
    moving = tuple(name for name in names if roles.get(name) == "moving")
    if moving == names:
        return motion
    return replace(motion, marker=moving if len(moving) > 1 else moving[0]) if moving else None


@undoable("confirming guesses")
def confirm(session: Session, names: Iterable[str] | None = None) -> Session:
    """Return the session with the guesses for some boundaries (default: all) confirmed."""
    gone = set(session.guesses if names is None else names)
    kept = {name: guess for name, guess in session.guesses.items() if name not in gone}
    return replace(session, guesses=kept)


@undoable("settings")
def set_case(session: Session, **values: Any) -> Session:
    """Return the session with other values of fields of its case."""
    return replace(session, case=session.case.change(**values))


def set_invalid(session: Session, place: PanelPlace, sentences: tuple[str, ...]) -> Session:
    """Return the session with ``sentences`` on the invalid fields of the panel ``place``."""
    # The order of the panels does not count: two of them would change it in turns, for ever.
    if tuple(said for where, said in session.invalid if where == place) == sentences:
        return session
    others = tuple(each for each in session.invalid if each[0] != place)
    return replace(session, invalid=(*others, *((place, sentence) for sentence in sentences)))


@undoable("new motion")
def add_motion(session: Session, motion: Motion, index: int | None = None) -> Session:
    """Return the session with one more motion, performed last, or at the place ``index``."""
    motions = list(session.case.motions)
    motions.insert(len(motions) if index is None else index, motion)
    return _with_motions(session, motions)


def _with_motions(session: Session, motions: Sequence[Motion]) -> Session:
    """Return the session with other motions; FFD boxes are drawn from the first FFD motion on."""
    found = set_case(session, motions=tuple(motions))
    if has_ffd(found.case) and not has_ffd(session.case):
        return replace(found, view=found.view.with_drawn({"ffd": True}))
    return found


@undoable("motion")
def replace_motion(session: Session, index: int, motion: Motion) -> Session:
    """Return the session with another motion at the place ``index``."""
    return _with_motions(session, replaced(session.case.motions, index, motion))


@undoable("removing a motion")
def remove_motion(session: Session, index: int) -> Session:
    """Return the session without the motion at the place ``index``."""
    return set_case(session, motions=without(session.case.motions, index))


@undoable("order of motions")
def move_motion(session: Session, index: int, by: int) -> Session:
    """Return the session with a motion performed ``by`` places later (negative: earlier)."""
    motions = list(session.case.motions)
    motion = motions.pop(index)
    motions.insert(max(0, index + by), motion)
    return set_case(session, motions=tuple(motions))


def moved_files(session: Session, moved: Mapping[Path, Path]) -> Session:
    """Return the session after mesh or displacement files were moved: new paths by old ones."""

    def there(case: Case) -> Case:
        motions = tuple(
            replace(m, path=moved.get(m.path, m.path)) if isinstance(m, FromFile) else m
            for m in case.motions
        )
        file, out = case.mesh_file, case.mesh_out
        if file is None or file not in moved:
            return case.change(motions=motions)
        new = moved[file]
        if out is not None and out.parent == file.parent:
            out = new.with_name(f"{new.stem}_deformed{out.suffix}")
        return case.change(motions=motions, mesh_file=new, mesh_out=out)

    return replace(
        session,
        path=moved.get(session.path, session.path) if session.path else None,
        case=there(session.case),
        # The files are the same, so that runs stay those of the case.
        runs=tuple(replace(run, case=there(run.case)) for run in session.runs),
    )


def saved_case(session: Session, case: Case) -> Session:
    """Return the session after ``case`` was written to disk, with its sections."""
    return replace(session, case=case, saved=case, saved_sections=session.view.sections)
