"""A session with a mesh just read: what is guessed of it, and what its case kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.case.model import Case, Reduction
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import Pair
from slideviz.session.changes_view import flat_one
from slideviz.session.guess import guess_case, guess_roles
from slideviz.session.keep import kept_view
from slideviz.session.state import Frame, Run, Session, ViewState
from slideviz.terms import ColourBy

MANY_NODES = 20_000
"""Boundary nodes from which on a mesh is opened with data reduction."""


RELATIVE_TOLERANCE = 1e-5


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
    flat = flat_one(view.sections)
    view = replace(view, chosen=flat if flat is not None else 0 if view.sections else None)
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


def of_runs(first: Frame, runs: Sequence[Run] = (), colour_by: ColourBy = "size-skew") -> Session:
    """Return a session that shows the last step of a run, with that of a second one beside it.

    Parameters
    ----------
    first : Frame
        The undeformed mesh.
    runs : sequence of Run
        Of that mesh: none, one or two, each with another number.
    colour_by : {"size-skew", "size", "skew", "displacement"}
        What the colours say; their range holds all runs.
    """
    last, beside = 0, None
    if runs:
        last = len(runs[0].frames)
        beside = runs[1].number if len(runs) > 1 else None
    case = runs[0].case if runs else Case()
    view = ViewState(colour_by=colour_by, frame=last, beside=beside)
    shown = runs[0].number if runs else None
    return Session(first.mesh, None, case, first=first, runs=tuple(runs), shown=shown, view=view)
