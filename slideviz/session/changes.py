"""All changes of a session: functions from one session to the next.

A change with `undoable` above it can be undone, and the menu names it so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from slideviz.case.model import Case
from slideviz.case.motion_words import describe
from slideviz.case.motions.box import Ffd
from slideviz.case.motions.motion import Motion, named
from slideviz.ffd.box import Index
from slideviz.formats.openfoam_paths import ending_of, stem_of
from slideviz.sections.polygons import ONLY_INVERTED
from slideviz.session.motions import new_target, with_box
from slideviz.session.opening import UNCHOSEN, guess_by_name, has_ffd, with_periodicity
from slideviz.session.reach import scaled
from slideviz.session.saving import bound_sections
from slideviz.session.state import (
    UNDEFORMED,
    Handle,
    PanelPlace,
    Preview,
    Run,
    Session,
    StepFrame,
    ViewState,
)
from slideviz.terms import SHOWN, SIZE_SKEW, ColorBy, FfdSystem, Role, Texts

if TYPE_CHECKING:
    from slideviz.sections.model import Section

MOST_REMOVED = 2  # removed runs that undo can bring back: each may take hundreds of megabytes
Change = TypeVar("Change", bound=Callable[..., Any])
Row = TypeVar("Row")
Words = str | Callable[[Mapping[str, Any]], str | None]

_WORDS: dict[Callable[..., Any], Words] = {}


def undoable(words: Words) -> Callable[[Change], Change]:
    """Return a decorator that lets `slideviz.session.store.Store` undo a change.

    ``words``: the words after "Undo" in the menu; or a function that returns them for the change's
    keyword arguments, or None if such a change is not to be undone.
    """

    def mark(change: Change) -> Change:
        _WORDS[change] = words
        return change

    return mark


def undo_words(change: Callable[..., Any], named: Mapping[str, Any]) -> str | None:
    """Return the words in the menu for a change with keyword arguments ``named``; None: no undo."""
    words = _WORDS.get(change)
    return words if words is None or isinstance(words, str) else words(named)


def motion_words(old: Session, new: Session) -> str:
    """Return the motion that was changed, added or removed, in brackets; "" for none or several."""
    before = old.case.motions
    after = new.case.motions
    found = [one for one in after if one not in before] or [*{*before} - {*after}]
    if new.mesh is None or len(found) != 1:
        return ""
    return f" ({describe(found[0], new.mesh.dim, new.mesh.extent)})"


def _replaced(rows: tuple[Row, ...], index: int, row: Row) -> tuple[Row, ...]:
    changed = list(rows)
    changed[index] = row
    return tuple(changed)


def _without(rows: tuple[Row, ...], index: int) -> tuple[Row, ...]:
    return rows[:index] + rows[index + 1 :]


# The view --------------------------------------------------------------------------------
UNDO_WORDS: dict[str, str] = {
    "color_range": "color range",
    "color_map": "colors",
    "threshold": "range of cells",
    "points": "points",
    "sections": "sections",
    "passages": "neighbours",
    "hidden": "hidden boundaries",
    **{name: term.name.lower() for name, term in SHOWN.items()},
}
"""Words after "Undo" for a change of one value of the view, by its name; for others "view"."""


def _undo_words(values: Mapping[str, Any]) -> str | None:
    if "color_by" in values:
        return None  # the quantity that the view is colored by is not undone
    return UNDO_WORDS.get(next(iter(values)), "view") if len(values) == 1 else "view"


@undoable(_undo_words)
def set_view(session: Session, **values: Any) -> Session:
    """Return the session with other values of fields of `ViewState`, or of names in `SHOWN`.

    Each quantity that the view is colored by has its own color range, which comes back with it.
    """
    old = session.view
    what: ColorBy = values.get("color_by", old.color_by)
    if what != old.color_by:
        ranges = dict(old.ranges)
        if old.color_range is not None:
            ranges[old.color_by] = old.color_range
        values = {"color_range": ranges.pop(what, None)} | values
        values["ranges"] = tuple(sorted(ranges.items()))
        # A threshold for a quality means nothing for another number, and the other way round.
        if not {what, old.color_by} <= {"role", *SIZE_SKEW} and old.threshold != ONLY_INVERTED:
            values.setdefault("threshold", None)
    if "sections" in values:
        index = selection_after(old.section_index, old.sections, values["sections"])
        values.setdefault("section_index", index)
    if session.lacks_cells:
        values.pop("threshold", None)  # needs the values of all cells
    drawn = {name: values.pop(name) for name in SHOWN if name in values}
    return replace(session, view=replace(old.with_drawn(drawn), **values))


def select(session: Session, names: Iterable[str]) -> Session:
    """Return the session with the boundaries ``names`` highlighted, and no others.

    They have a handle if all of them move; else that of a motion or section stays.
    """
    chosen = tuple(names)
    handle: Handle = session.view.handle
    handle = "" if handle == "boundary" else handle
    if chosen and all(session.role(name) == "moving" for name in chosen):
        handle = "boundary"
    return set_view(session, selected=chosen, handle=handle)


@undoable("hidden boundaries")
def show_boundaries(session: Session, names: Iterable[str], shown: bool = True) -> Session:
    """Return the session with the boundaries ``names`` shown, or hidden."""
    hidden = session.view.hidden
    change = frozenset(names)
    return set_view(session, hidden=hidden - change if shown else hidden | change)


@undoable("hidden boundaries")
def isolate(session: Session, names: Iterable[str]) -> Session:
    """Return the session with only the boundaries ``names`` shown."""
    every = session.mesh.marker_names if session.mesh else ()
    return set_view(session, hidden=frozenset(every) - frozenset(names))


def show_frame(session: Session, index: int) -> Session:
    """Return the session with the frame ``index`` shown, or the nearest there is; no preview."""
    session = replace(session, preview=None)
    return set_view(session, frame=min(max(index, 0), max(len(session.frames) - 1, 0)))


@undoable("new section")
def add_section(session: Session, section: Section) -> Session:
    """Return the session with one more section, which is selected."""
    return set_view(session, sections=(*session.view.sections, section))


@undoable("section")
def replace_section(session: Session, index: int, section: Section) -> Session:
    """Return the session with another section at the place ``index``."""
    return set_view(session, sections=_replaced(session.view.sections, index, section))


@undoable("removing a section")
def remove_section(session: Session, index: int) -> Session:
    """Return the session without the section at the place ``index``."""
    return set_view(session, sections=_without(session.view.sections, index))


@undoable("flat view")
def lay_flat(session: Session, index: int | None) -> Session:
    """Return the session with a flat view of the section at the place ``index``; None: of none."""
    laid = (replace(one, flat=i == index) for i, one in enumerate(session.view.sections))
    return set_view(session, sections=tuple(laid))


@undoable("choice of a section")
def choose_section(session: Session, index: int | None) -> Session:
    """Return the session with the section at the place ``index`` selected; None: none."""
    return set_view(session, section_index=index)


@undoable("handle shown or hidden")
def show_handle(session: Session, shown: Handle) -> Session:
    """Return the session with the handle of what is chosen shown; "" for none."""
    return set_view(session, handle=shown)


@undoable("drag")
def place(session: Session, moved: Session) -> Session:
    """Return the session with motions and sections as a handle put them in ``moved``."""
    view = replace(
        session.view,
        sections=moved.view.sections,
        section_index=moved.view.section_index,
        motion_index=moved.view.motion_index,
        handle=moved.view.handle,
    )
    return replace(session, case=moved.case, view=view)


def selection_after(
    index: int | None, old: Sequence[Section], new: Sequence[Section]
) -> int | None:
    """Return the index of the selected section after one was added, removed or changed.

    ``index`` is its index in ``old``. An added section becomes selected. If the selected one was
    removed, its neighbour becomes selected.
    """
    if not new:
        return None
    if len(new) == len(old) and index is not None:
        return index
    first = next(
        (i for i, (a, b) in enumerate(zip(old, new, strict=False)) if a != b),
        min(len(old), len(new)),
    )
    if len(new) > len(old) or index is None:
        return min(first, len(new) - 1)
    return min(index - (index > first), len(new) - 1)


def mark_cell(session: Session, cell: int | None) -> Session:
    """Return the session with a cell marked; None: none."""
    return set_view(session, marked_cell=cell, marked_in=session.shown)


def inherit_view(session: Session, old: ViewState) -> Session:
    """Return a session just opened, with the things drawn and the color map of the view ``old``.

    FFD boxes are drawn as ``session`` has them: if it has FFD motions.
    """
    drawn = old.with_drawn({"ffd": "ffd" in session.view.drawn}).drawn
    return set_view(session, drawn=drawn, color_map=old.color_map)


# Roles, motions and settings -------------------------------------------------------------
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
    for name in _unhinted_partners(session, changed, role):
        if name in guesses:
            guesses[name] = UNCHOSEN
            roles[name] = "fixed"
    still = (_restricted_to_moving(motion, roles) for motion in session.case.motions)
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


def _unhinted_partners(session: Session, changed: Sequence[str], role: Role) -> Iterator[str]:
    """Yield the boundaries that match one of ``changed``, and whose names hint at no role.

    None where ``role`` is periodic.
    """
    for pair in session.pairs if role != "periodic" else ():
        for name, other in ((pair.first, pair.second), (pair.second, pair.first)):
            if other in changed and guess_by_name(name) is None:
                yield name


def _restricted_to_moving(motion: Motion, roles: Mapping[str, Role]) -> Motion | None:
    """Return the motion for those of its boundaries that move; None where none does."""
    names = named(motion.marker)
    moving = tuple(name for name in names if roles.get(name) == "moving")
    if moving == names:
        return motion
    if not moving:
        return None
    return replace(motion, marker=moving if len(moving) > 1 else moving[0])


@undoable("confirming guesses")
def confirm_guesses(session: Session, names: Iterable[str] | None = None) -> Session:
    """Return the session with the guesses for some boundaries (default: all) confirmed."""
    gone = set(session.guesses if names is None else names)
    guesses = {name: guess for name, guess in session.guesses.items() if name not in gone}
    return replace(session, guesses=guesses)


@undoable("settings")
def set_case(session: Session, **values: Any) -> Session:
    """Return the session with other values of fields of its case.

    Sections of constant span get the walls that SPAN has then.
    """
    changed = replace(session, case=session.case.change(**values))
    if session.mesh is None or not {"span", "span_axis"} & {*values}:
        return changed
    bound = bound_sections(session.view.sections, session.mesh, changed.case, session.pairs)
    return set_view(changed, sections=bound)


@undoable("settings")
def set_keys(session: Session, **keys: str) -> Session:
    """Return the session with other values of some keys of its case, as texts."""
    return replace(session, case=session.case.set(**keys))


def set_invalid(session: Session, place: PanelPlace, sentences: Texts) -> Session:
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
    place = len(motions) if index is None else index
    motions.insert(place, motion)
    return choose_motion(_with_motions(session, motions), place)


def choose_motion(session: Session, index: int) -> Session:
    """Return the session with the motion at the place ``index`` chosen, which has a handle then."""
    return set_view(session, motion_index=index, handle="motion")


def _with_motions(session: Session, motions: Sequence[Motion]) -> Session:
    """Return the session with other motions; FFD boxes are drawn from the first FFD motion on."""
    changed = set_case(session, motions=tuple(motions))
    if has_ffd(changed.case) and not has_ffd(session.case):
        return replace(changed, view=changed.view.with_drawn({"ffd": True}))
    return changed


@undoable("motion")
def replace_motion(session: Session, index: int, motion: Motion) -> Session:
    """Return the session with another motion at the place ``index``."""
    return _with_motions(session, _replaced(session.case.motions, index, motion))


@undoable("new box")
def add_box(session: Session, index: int) -> Session:
    """Return the session with a new FFD box around the boundaries of a motion, which uses it."""
    changed = replace(session, case=with_box(session, index))
    return replace(changed, view=changed.view.with_drawn({"ffd": True}))


@undoable("box")
def shape_box(
    session: Session, index: int, degrees: Index | None, system: FfdSystem | None
) -> Session:
    """Return the session with other degrees or coordinates of a motion's box; None: the same."""
    return replace(session, case=with_box(session, index, degrees, system))


@undoable("control point")
def choose_control(session: Session, box: str, index: Index) -> Session:
    """Return the session with the motion of a box's control points (i, j, k) chosen.

    Unless there is one, the chosen motion of the box takes them if it moves nothing yet; else a new
    one is added.
    """
    motions = session.case.motions
    mine = {at: one for at, one in enumerate(motions) if isinstance(one, Ffd) and one.box == box}
    same = next((at for at, one in mine.items() if one.index == index), None)
    if same is not None:
        return choose_motion(session, same)
    chosen = session.motion_index
    if chosen in mine and not any(mine[chosen].vector):
        return replace_motion(session, chosen, replace(mine[chosen], index=index))
    marker = next((one.marker for one in reversed(mine.values())), new_target(session))
    return add_motion(session, Ffd(marker, box, index, (0.0, 0.0, 0.0))) if marker else session


@undoable("scaled motion")
def scale_motions(session: Session, part: float) -> Session:
    """Return the session with the motions of the run that is shown, ``part`` times as far."""
    run = session.run_shown
    motions = scaled(run.case.motions, part) if run is not None else None
    return session if motions is None else _with_motions(session, motions)


@undoable("removing a motion")
def remove_motion(session: Session, index: int) -> Session:
    """Return the session without the motion at the place ``index``."""
    return set_case(session, motions=_without(session.case.motions, index))


@undoable("order of motions")
def move_motion(session: Session, index: int, by: int) -> Session:
    """Return the session with a motion performed ``by`` places later (negative: earlier)."""
    motions = list(session.case.motions)
    motion = motions.pop(index)
    place = max(0, index + by)
    motions.insert(place, motion)
    return set_view(set_case(session, motions=tuple(motions)), motion_index=place)


def moved_files(session: Session, moved: Mapping[Path, Path]) -> Session:
    """Return the session after mesh or displacement files were moved: new paths by old ones."""

    def there(case: Case) -> Case:
        file = case.mesh_file
        out = case.mesh_out
        case = case.with_paths(lambda path: moved.get(path, path))
        if file and out and file in moved and out.parent == file.parent:
            new = moved[file]
            case = case.change(mesh_out=new.with_name(f"{stem_of(new)}_deformed{ending_of(out)}"))
        return case

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


def saved_session(session: Session, written: Session, path: Path) -> Session:
    """Return the session after ``written``, an earlier state of it, was saved as a session file."""
    numbers = {run.number for run in written.runs}
    runs = (replace(run, saved=run.saved or run.number in numbers) for run in session.runs)
    there = written.case.change(source=path)
    session = replace(session, runs=tuple(runs), case=session.case.change(source=path))
    return replace(session, saved=there, saved_sections=written.view.sections)


# Runs ------------------------------------------------------------------------------------
def show_preview(session: Session, preview: Preview) -> Session:
    """Return the session with the preview of a case shown, colored by quality if by roles."""
    color = "size-skew" if session.view.color_by == "role" else session.view.color_by
    return set_view(replace(session, preview=preview), frame=1, color_by=color)


def end_preview(session: Session) -> Session:
    """Return the session with the last step of the run that is shown, instead of a preview."""
    run = session.run_shown
    if session.preview is None:
        return session
    return show_frame(session, len(run.frames) if run else 0)


def start_run(
    session: Session, case: Case | None = None, name: str = "", live: bool = False
) -> Session:
    """Return the session with a new run, which is shown: of ``case``, or of the session's case.

    With a ``name`` it is the run of a design. Earlier runs without any step are removed; by one
    that is ``live``, the one before, too. No cell is marked: one that was bad need not be of
    interest in another run. A preview is shown until the run ends.
    """
    view = session.view
    kept = tuple(
        run
        for run in session.runs
        if run.frames
        and not (live and run.live and not run.name and not run.saved and run.number != view.beside)
    )
    number = 1 + session.last_number
    panels = session.case if name else None
    preview = None if name else session.preview
    run = Run(number, case or session.case, name=name, panels=panels, live=live)
    session = replace(session, runs=(*kept, run), shown=number, newest=number)
    session = show_frame(set_view(session, marked_cell=None), 0)
    return show_preview(session, preview) if preview else session


def add_frames(session: Session, frames: Sequence[StepFrame]) -> Session:
    """Return the session with further steps of the newest run, the last shown if that run is."""
    newest = session.runs[-1]
    grown = (*newest.frames, *frames)
    session = _with_run(session, newest.number, frames=grown, saved=False)
    if session.shown != newest.number or session.preview:
        return session  # the user looks at another run meanwhile, or at the preview
    return show_frame(session, len(grown))


def end_run(session: Session, end: Literal["done", "cancelled", "failed"]) -> Session:
    """Return the session with ``end`` as the end of the newest run, if that had none.

    A live run is cancelled because the hand moves on: it is removed, and the preview stays.
    """
    if not session.runs or session.runs[-1].end:
        return session
    *others, newest = session.runs
    if newest.live and end == "cancelled":
        shown = others[-1].number if others else None
        shown = shown if session.shown == newest.number else session.shown
        return replace(session, runs=tuple(others), shown=shown)
    off = None
    preview = session.preview
    if preview and newest.last and session.mesh and preview.case is newest.case:
        off = preview.off(newest.last, session.mesh)
    session = _with_run(session, newest.number, end=end, preview_off=off)
    return end_preview(session) if session.shown == newest.number else session


def show_run(session: Session, number: int) -> Session:
    """Return the session with the last step of a run shown, if there is the run."""
    run = session.run(number)
    if run is None:
        return session
    beside = None if session.view.beside == number else session.view.beside
    session = set_view(replace(session, shown=number), beside=beside)
    return show_frame(session, len(run.frames))


def show_design(session: Session, number: int, name: str) -> Session:
    """Show the last step of a design's run, and remember its name and the panels' settings."""
    return show_run(_with_run(session, number, name=name, panels=session.case), number)


def show_beside(session: Session, number: int | None) -> Session:
    """Return the session with another run in a second view; None for no second view.

    ``UNDEFORMED`` is the number of the undeformed mesh.
    """
    known = number == UNDEFORMED or session.run(number) is not None
    if number == session.shown or not known:
        number = None
    return set_view(session, beside=number, swapped=False)


@undoable("removing a run")
def remove_run(session: Session, number: int) -> Session:
    """Return the session without a run, which undo can bring back; unchanged while it goes on."""
    run = session.run(number)
    if run is None or not run.end:
        return session
    runs = tuple(other for other in session.runs if other.number != number)
    beside = None if session.view.beside == number else session.view.beside
    removed = (*session.removed, run)[-MOST_REMOVED:]
    session = replace(session, runs=runs, removed=removed, newest=session.last_number)
    session = set_view(session, beside=beside)
    if session.shown != number:
        return session
    if not runs:
        return show_frame(set_view(replace(session, shown=None), beside=None), 0)
    return show_run(session, runs[-1].number)


def restore_run(session: Session, number: int) -> Session:
    """Return the session with a removed run back at its place, if it is still in ``removed``."""
    back = [run for run in session.removed if run.number == number]
    if not back:
        return session
    runs = tuple(sorted((*session.runs, *back), key=lambda run: run.number))
    return replace(
        session, runs=runs, removed=tuple(run for run in session.removed if run not in back)
    )


def rename_run(session: Session, number: int, name: str) -> Session:
    """Return the session with another name for a run; "" takes its name away."""
    name = " ".join(name.split())
    run = session.run(number)
    if run is None or run.name == name:
        return session
    return _with_run(session, number, name=name)


@undoable("settings of a run")
def adopt_settings(session: Session, number: int) -> Session:
    """Return the session with the settings of a run, and without guessed roles."""
    run = session.run(number)
    if run is None:
        return session
    return replace(session, case=run.case, guesses={})


def saved_mesh(session: Session) -> Session:
    """Return the session after the deformed mesh of the run that is shown was written to disk."""
    return _with_run(session, session.shown, saved=True)


def _with_run(session: Session, number: int | None, **values: Any) -> Session:
    """Return the session with other values of fields of a run."""
    runs = (replace(run, **values) if run.number == number else run for run in session.runs)
    return replace(session, runs=tuple(runs))
