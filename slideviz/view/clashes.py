"""Whether the motions, as they are typed, put a boundary through another one."""

from __future__ import annotations

from dataclasses import replace

from slideviz.case.clash import clash
from slideviz.case.model import Case
from slideviz.case.motion import check_case, displacements
from slideviz.errors import SlidevizError
from slideviz.mesh.model import Mesh
from slideviz.view.jobs import Report, Stopped
from slideviz.view.state import Session


def clash_key(session: Session) -> tuple[object, ...]:
    """Return what a clash depends on: it need not be looked for again while this is the same."""
    case = session.case
    return (session.mesh, case.motions, tuple(sorted(case.roles.items())), case.periodic)


def find_clash(case: Case, mesh: Mesh, _report: Report, stopped: Stopped) -> str:
    """Return the sentence about a clash, empty when there is none or the case has other problems.

    Those are told elsewhere; a displacement file that cannot be read, by the run.
    """
    try:
        if not case.motions or check_case(case, mesh) or stopped():
            return ""
        moved = displacements(case, mesh)
        found = clash(case, mesh, moved.nodes, moved.vectors)
    except SlidevizError:
        return ""
    return found[0].upper() + found[1:] + "." if found else ""


def set_clash(session: Session, text: str, key: tuple[object, ...]) -> Session:
    """Return the session with what was found for ``key``, unless that is no longer asked for."""
    if clash_key(session) != key or session.clash == text:
        return session
    return replace(session, clash=text)
