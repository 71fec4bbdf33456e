"""The view in a case file: made from a session that is saved, and put into one that is opened."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from slideviz.case.model import Case, FromFile
from slideviz.case.view_keys import SectionText, hyphened
from slideviz.sections.model import Section
from slideviz.session.state import Session, ViewState
from slideviz.terms import SHOWN

Camera = tuple[float, ...]
"""Position, focal point and view-up (3 numbers each), and parallel scale (half the visible height);
perhaps also width over height of the view."""


def view_to_case(session: Session, camera: Camera | None = None) -> Case:
    """Return the case of a session with its view and camera as keys; defaults are left out."""
    view, first = session.view, ViewState()
    before = _plain(first)
    kept = {key: value for key, value in _plain(view).items() if before[key] != value}
    ranges = {"VIEW_RANGE": view.color_range, "VIEW_THRESHOLD": view.threshold}
    kept |= {key: value for key, value in ranges.items() if value is not None}
    if view.hidden:
        names = session.mesh.marker_names if session.mesh is not None else ()
        kept["VIEW_HIDDEN"] = tuple(name for name in names if name in view.hidden)
    if view.sections:
        kept["VIEW_SECTIONS"] = tuple(_text(section) for section in view.sections)
    if camera is not None:
        kept["VIEW_CAMERA"] = camera
    return session.case.change(view=kept)


def view_from_case(case: Case, view: ViewState, names: tuple[str, ...]) -> ViewState:
    """Return the view that a case has; what it leaves out is taken from ``view``.

    Parameters
    ----------
    names : tuple of str
        The boundaries of the mesh; other names of hidden boundaries are ignored.
    """
    kept, values = case.view, dict[str, Any]()
    for key, field in (
        ("VIEW_COLOR", "color_by"),
        ("VIEW_RANGE", "color_range"),
        ("VIEW_MAP", "color_map"),
        ("VIEW_THRESHOLD", "threshold"),
        ("VIEW_POINTS", "points"),
        ("VIEW_COPIES", "passages"),
    ):
        if key in kept:
            values[field] = kept[key]
    if "VIEW_SHOW" in kept:
        values["drawn"] = frozenset(name for name in SHOWN if hyphened(name) in kept["VIEW_SHOW"])
    if "VIEW_HIDDEN" in kept:
        values["hidden"] = frozenset(kept["VIEW_HIDDEN"]) & frozenset(names)
    if "VIEW_SECTIONS" in kept:
        values["sections"] = tuple(_section(text) for text in kept["VIEW_SECTIONS"])
    return replace(view, **values)


def restored(session: Session, source: Path | None) -> Session:
    """Return a session just opened from its recovery file as unsaved, of case file ``source``."""
    return replace(session, case=session.case.change(source=source), saved=Case())


def camera_from_case(case: Case) -> Camera | None:
    """Return the camera that a case has, or None."""
    camera: Camera | None = case.view.get("VIEW_CAMERA")
    return camera


def _plain(view: ViewState) -> dict[str, Any]:
    """Return the values of a view that are never None, by key of the case file."""
    return {
        "VIEW_COLOR": view.color_by,
        "VIEW_MAP": view.color_map,
        "VIEW_POINTS": view.points,
        "VIEW_SHOW": tuple(hyphened(name) for name in SHOWN if name in view.drawn),
        "VIEW_COPIES": view.passages,
    }


def _text(section: Section) -> SectionText:
    size = () if section.shape.terms.size is None else (section.size,)
    numbers = (*size, *section.direction, *section.origin)
    return (
        section.kind,
        tuple(float(n) for n in numbers),
        section.whole,
        section.flat,
        section.shown,
    )


def _section(text: SectionText) -> Section:
    kind, numbers, whole, flat, shown = text
    *size, a, b, c, x, y, z = numbers
    section = Section.of(kind, (x, y, z), (a, b, c), sum(size))
    return replace(section, whole=whole, shown=shown, flat=flat)


def files_beside(case: Case, path: Path, folder: Path) -> dict[Path, Path]:
    """Return new paths, beside the case file ``path``, for a case's files that are in ``folder``.

    By old path; none where ``path`` is in that folder, too.
    """
    if folder in path.parents:
        return {}
    used = [case.mesh_file, *(m.path for m in case.motions if isinstance(m, FromFile))]
    return {
        file: path.with_suffix(file.suffix)
        if file == case.mesh_file
        else path.with_name(f"{path.stem}_{file.name}")
        for file in used
        if file and folder in file.parents and file.is_file()
    }
