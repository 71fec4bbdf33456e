"""Changes of the view, as functions from one session to the next."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from slideviz.sections.threshold import ONLY_INVERTED
from slideviz.session.rows import replaced, without
from slideviz.session.state import Session, ViewState
from slideviz.session.undoable import undoable
from slideviz.terms import SHOWN, ColorBy

if TYPE_CHECKING:
    from slideviz.sections.model import Section

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
        # A threshold for a quality means nothing for a displacement, and the other way round.
        if "displacement" in (what, old.color_by) and old.threshold != ONLY_INVERTED:
            values.setdefault("threshold", None)
    if "sections" in values:
        index = selection_after(old.section_index, old.sections, values["sections"])
        values.setdefault("section_index", index)
    if session.in_file:
        values.pop("threshold", None)  # needs the values of all cells
    drawn = {name: values.pop(name) for name in SHOWN if name in values}
    return replace(session, view=replace(old.with_drawn(drawn), **values))


def select(session: Session, names: Iterable[str]) -> Session:
    """Return the session with the boundaries ``names`` highlighted, and no others."""
    return set_view(session, selected=tuple(names))


@undoable("hidden boundaries")
def show(session: Session, names: Iterable[str], shown: bool = True) -> Session:
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
    """Return the session with the frame ``index`` shown, or the nearest there is."""
    return set_view(session, frame=min(max(index, 0), max(len(session.frames) - 1, 0)))


@undoable("new section")
def add_section(session: Session, section: Section) -> Session:
    """Return the session with one more section, which is selected."""
    return set_view(session, sections=(*session.view.sections, section))


@undoable("section")
def replace_section(session: Session, index: int, section: Section) -> Session:
    """Return the session with another section at the place ``index``."""
    return set_view(session, sections=replaced(session.view.sections, index, section))


@undoable("removing a section")
def remove_section(session: Session, index: int) -> Session:
    """Return the session without the section at the place ``index``."""
    return set_view(session, sections=without(session.view.sections, index))


@undoable("flat view")
def lay_flat(session: Session, index: int | None) -> Session:
    """Return the session with a flat view of the section at the place ``index``; None: of none."""
    laid = (replace(one, flat=i == index) for i, one in enumerate(session.view.sections))
    return set_view(session, sections=tuple(laid))


@undoable("choice of a section")
def choose_section(session: Session, index: int | None) -> Session:
    """Return the session with the section at the place ``index`` selected; None: none."""
    return set_view(session, section_index=index)


@undoable("handle")
def show_handle(session: Session, shown: bool) -> Session:
    """Return the session with the handle of the selected section shown, or not."""
    return set_view(session, handle=shown)


def flat_one(sections: Sequence[Section]) -> int | None:
    """Return the place of the section that has a flat view and is drawn, or None."""
    return next((index for index, one in enumerate(sections) if one.flat and one.shown), None)


def selection_after(
    index: int | None, old: Sequence[Section], new: Sequence[Section]
) -> int | None:
    """Return the place of the selected section after one was added, removed or changed.

    ``index`` is its place among ``old``. A section that was added is selected; where the selected
    one was removed, its neighbour is.
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


def fresh_view(session: Session, old: ViewState) -> Session:
    """Return a session just opened, with the things drawn and the color map of the view ``old``.

    FFD boxes are drawn as ``session`` has them: if it has FFD motions.
    """
    drawn = old.with_drawn({"ffd": "ffd" in session.view.drawn}).drawn
    return set_view(session, drawn=drawn, color_map=old.color_map)
