"""Pure functions from one session to the next: everything the user can ask for, by one name."""

from __future__ import annotations

from slideviz.view.missing import Missing, Place, is_missing
from slideviz.view.session.changes_case import (
    add_motion,
    confirm,
    move_motion,
    remove_motion,
    replace_motion,
    saved_case,
    set_case,
    set_role,
)
from slideviz.view.session.changes_runs import (
    UNDEFORMED,
    add_frames,
    end_run,
    remove_run,
    rename_run,
    saved_mesh,
    seen_beside,
    show_beside,
    show_run,
    start_run,
    take_settings,
)
from slideviz.view.session.changes_view import (
    TASTE,
    add_section,
    fresh_view,
    isolate,
    lay_flat,
    mark,
    remove_section,
    replace_section,
    select,
    set_view,
    show,
    show_frame,
)
from slideviz.view.session.colours import fit_colours
from slideviz.view.session.opening import open_mesh, suggested_reduction

__all__ = [
    "TASTE",
    "UNDEFORMED",
    "Missing",
    "Place",
    "add_frames",
    "add_motion",
    "add_section",
    "confirm",
    "end_run",
    "fit_colours",
    "fresh_view",
    "is_missing",
    "isolate",
    "lay_flat",
    "mark",
    "move_motion",
    "open_mesh",
    "remove_motion",
    "remove_run",
    "remove_section",
    "rename_run",
    "replace_motion",
    "replace_section",
    "saved_case",
    "saved_mesh",
    "seen_beside",
    "select",
    "set_case",
    "set_role",
    "set_view",
    "show",
    "show_beside",
    "show_frame",
    "show_run",
    "start_run",
    "suggested_reduction",
    "take_settings",
]
