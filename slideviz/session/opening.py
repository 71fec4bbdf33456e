"""The session of a mesh just read: its roles are guessed, or it has a case and the view in it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.case.model import NEW, Case
from slideviz.case.motions.box import box_motions
from slideviz.mesh.model import Mesh, Skin
from slideviz.mesh.periodic import Pair, find_pairs
from slideviz.rbf.reduction import Reduction
from slideviz.session.saving import bound_sections, view_from_case
from slideviz.session.state import Guess, Run, Session, StepFrame, ViewState
from slideviz.solver.setup import relaxes
from slideviz.terms import ColorBy, Role

RELATIVE_TOLERANCE = 1e-5  # suggested tolerance of data reduction, over the mesh's extent
SQUARE = 1e-6  # directions are perpendicular or parallel where their cosine is this near to 0 or 1
STEPS = 5
"""Number of steps of a guessed case with sliding boundaries where nothing is relaxed: relaxation is
better and faster from one step."""


UNCHOSEN = Guess("fixed", "boundaries without a role are fixed")


def open_mesh(
    first: StepFrame, path: Path | None, pairs: Sequence[Pair] = (), case: Case | None = None
) -> Session:
    """Return the session of a mesh just read; without a case its roles are guessed.

    A boundary for which nothing is known is guessed to be fixed.

    ``pairs``: boundaries that match each other.
    """
    mesh = first.mesh
    guesses = {} if case is not None else guess_roles(mesh, pairs)
    chosen = guess_case(mesh, guesses, pairs) if case is None else case
    known = guesses if case is None else case.roles
    guesses |= {name: UNCHOSEN for name in mesh.marker_names if name not in known}
    listed = {name: chosen.roles.get(name, "fixed") for name in mesh.marker_names}
    others = {name: role for name, role in chosen.roles.items() if name not in listed}
    chosen = chosen.change(roles=listed | others, mesh_file=path or chosen.mesh_file)
    view = view_from_case(chosen, ViewState(), mesh.marker_names)
    if has_ffd(chosen) and "VIEW_SHOW" not in chosen.view:
        view = view.with_drawn({"ffd": True})
    view = replace(view, sections=bound_sections(view.sections, mesh, chosen, pairs))
    flat = view.flat_index
    if isinstance(mesh, Skin):
        view = replace(view, threshold=None)  # needs the values of all cells
    if flat is None and view.sections:
        flat = 0
    view = replace(view, section_index=flat)
    # From here on the view is the session's; it goes back into the case when that is saved.
    chosen = chosen.change(view={})
    session = Session(mesh, path, chosen, guesses, tuple(pairs), first, view=view)
    return replace(session, saved=chosen, saved_sections=view.sections)


def has_ffd(case: Case) -> bool:
    """Return whether a case has a motion of an FFD box."""
    return bool(box_motions(case))


def suggested_reduction(mesh: Mesh) -> Reduction:
    """Return data reduction with a tolerance of 1e-5 of the mesh's extent."""
    return Reduction(tolerance=float(f"{RELATIVE_TOLERANCE * mesh.extent:.2g}") or 1e-300)


def session_of_runs(
    first: StepFrame, runs: Sequence[Run] = (), color_by: ColorBy = "size-skew"
) -> Session:
    """Return a session for a picture: the last step of a run, with that of a second run beside it.

    ``first``: the undeformed mesh. ``runs``: runs of that mesh: none, one or two, with different
    numbers. ``color_by``: the quantity to color by, with one color range for both.
    """
    last = 0
    beside = None
    if runs:
        last = len(runs[0].frames)
        beside = runs[1].number if len(runs) > 1 else None
    case = runs[0].case if runs else Case()
    view = ViewState(color_by=color_by, frame=last, beside=beside)
    shown = runs[0].number if runs else None
    return Session(first.mesh, None, case, first=first, runs=tuple(runs), shown=shown, view=view)


def with_case_view(session: Session) -> Session:
    """Return a session with the view of its case; step and second view stay."""
    first = session.first
    assert first is not None
    pairs = tuple(find_pairs(first.mesh))
    view = open_mesh(first, None, pairs, session.case).view
    return replace(session, pairs=pairs, view=session.view.in_style(view))


NAMES: tuple[tuple[Role, str], ...] = (
    ("periodic", r"per|period|periodic|cyclic|pitchwise"),
    ("moving", r"airfoil|aerofoil|foil|profile|blade|vane|wing|naca\d*|cylinder"),
    ("sliding", r"hub|shroud|casing|endwall|sidewall|sym|symm|symmetry"),
    ("sliding", r"inflow|inlet|outflow|outlet|exit|in|out|interface"),
    ("moving", r"rotor|stator"),
    ("fixed", r"walls?|far|farfield|freestream|upper|lower|left|right|top|bottom|front|back"),
)
"""Roles and patterns of words in names that hint at them; the first row with a match counts."""

_WORDS = tuple((role, re.compile(pattern)) for role, pattern in NAMES)


def guess_by_name(name: str) -> Guess | None:
    """Return the role that the words of a boundary's name hint at, or None."""
    # "Periodic1", "inflow_2" and "FLUID_INLET" all end up as words in lower case.
    parts = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    words = [word for word in re.split(r"[^a-z]+|(?<=[a-z])(?=\d)", parts.lower()) if word]
    whole = [re.sub(r"[^a-z]", "", name.lower())]
    for role, pattern in _WORDS:
        for word in words + whole:
            if pattern.fullmatch(word):
                return Guess(role, f"its name says “{word}”")
    return None


def guess_roles(mesh: Mesh, pairs: Sequence[Pair] = ()) -> dict[str, Guess]:
    """Guess the roles of boundaries from their names and from matching pairs.

    Interfaces with other zones are fixed: they follow these where these move. Boundaries that match
    are periodic, unless a name hints at another role, or the mesh is a box that matches along all
    axes: opposite sides of every box match.
    """
    guesses = {name: found for name in mesh.marker_names if (found := guess_by_name(name))}
    guesses |= {name: Guess(role, "its file says so") for name, role in mesh.roles.items()}
    guesses |= {i.marker: Guess("fixed", f"it is {i.describe()}") for i in mesh.interfaces}
    unnamed = [p for p in pairs if p.first not in guesses and p.second not in guesses]
    box = _is_box(mesh, unnamed)
    for pair in pairs:
        ends = (pair.first, pair.second)
        named = [guesses[name].role for name in ends if name in guesses]
        if (named and set(named) != {"periodic"}) or (box and not named):
            continue
        for name, other in (ends, ends[::-1]):
            guesses[name] = Guess("periodic", f"it matches {other}: {pair.describe()}")
    return {name: guesses[name] for name in mesh.marker_names if name in guesses}


def _is_box(mesh: Mesh, pairs: Sequence[Pair]) -> bool:
    """Return whether all pairs match by translations, along all axes of a box.

    That is along perpendicular directions, as many as the mesh has dimensions.
    """
    ways = np.array(
        [p.vector / np.linalg.norm(p.vector) for p in pairs if p.kind == "translational"]
    )
    if len(ways) < max(len(pairs), mesh.dim) or np.linalg.matrix_rank(ways) < mesh.dim:
        return False
    cosines = abs(ways @ ways.T)
    return bool((np.minimum(cosines, 1.0 - cosines) < SQUARE).all())


def guess_case(mesh: Mesh, guesses: dict[str, Guess], pairs: Sequence[Pair]) -> Case:
    """Return the case with the guessed roles; periodic where a pair of periodic ones matches."""
    roles = {name: guesses[name].role if name in guesses else "fixed" for name in mesh.marker_names}
    case = Case(roles=roles, zone=mesh.zone if mesh.zones > 1 else None, **NEW)
    if "sliding" in roles.values():
        # Without a sliding method the role would have no effect.
        case = case.change(sliding="ps", steps=1 if relaxes(case, mesh) else STEPS)
    for pair in pairs:
        if roles[pair.first] == roles[pair.second] == "periodic":
            return with_periodicity(case, pair)
    return case


def with_periodicity(case: Case, pair: Pair | None) -> Case:
    """Return the case with periodic deformation, and the axis of a pair if there is one.

    PERIODIC_MODE is moving where the case has a sliding method, else fixed.
    """
    case = case.change(periodic="fixed" if case.sliding == "none" else "moving")
    return case if pair is None else case.change(axis=pair.axis, origin=pair.origin)
