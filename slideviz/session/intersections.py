"""The check of the motions in the window: boundaries that cross, or faulty displacement files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from slideviz.case.model import Case, FromFile
from slideviz.case.motion import check_case, displacements
from slideviz.errors import SlidevizError
from slideviz.mesh.model import Mesh
from slideviz.session.jobs import Report, Stopped
from slideviz.session.run_messages import in_window_words
from slideviz.session.state import Session
from slideviz.solver.intersection import (
    folding_message,
    intersection_message,
    jump_message,
)


def intersection_key(session: Session) -> tuple[object, ...]:
    """Return the values on which the check depends: its result holds while they are the same."""
    case = session.case
    roles = tuple(sorted(case.roles.items()))
    return (session.mesh, case.motions, roles, case.periodic, case.sliding)


def find_intersection(case: Case, mesh: Mesh, _report: Report, stopped: Stopped) -> tuple[str, str]:
    """Return two sentences on boundaries that the motions make cross each other, "" for none.

    The first keeps a run from starting: a moved boundary crosses another one, or a displacement
    file has mistakes. The second does not: what moves crosses itself. Both are "" where the case
    has other problems, which are reported elsewhere.
    """
    files = [motion.path for motion in case.motions if isinstance(motion, FromFile)]
    try:
        if not case.motions or check_case(case, mesh) or stopped():
            return "", ""
        if not all(path.is_file() for path in files):
            return "", ""
        moved = displacements(case, mesh)
        asked = case, mesh, moved.nodes, moved.vectors
        found = intersection_message(*asked) or jump_message(*asked)
        folded = None if found else folding_message(*asked)
    except SlidevizError as error:
        return _first_line(error, files), ""
    said = in_window_words(found[0].upper() + found[1:] + ".") if found else ""
    return said, (f"{folded}." if folded else "")


def _first_line(error: SlidevizError, files: list[Path]) -> str:
    """Return the first line of an error, without folders of files, and how many more there are."""
    first, *others = str(error).splitlines()
    for path in files:
        first = first.replace(str(path), path.name)
    return f"{first} ({len(others)} more)." if others else f"{first}."


def set_intersection(session: Session, found: tuple[str, str], key: tuple[object, ...]) -> Session:
    """Return the session with the result of the check for ``key``, unless it is out of date."""
    if intersection_key(session) != key or (session.intersection, session.folding) == found:
        return session
    return replace(session, intersection=found[0], folding=found[1])
