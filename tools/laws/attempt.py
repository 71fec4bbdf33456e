"""One deformation within a limit of time: its steps, or the error that ended it."""

from __future__ import annotations

import signal
import traceback
import warnings
from types import FrameType

from slideviz.case.model import Case
from slideviz.mesh.model import Mesh
from slideviz.solver.deform import deform
from slideviz.solver.steps import Step

LIMIT_S = 60.0
"""Seconds that one deformation may take: the meshes are small."""


class TooLong(BaseException):
    """A deformation did not come to an end; no handler of the program may catch it."""


def tried(case: Case, mesh: Mesh) -> tuple[list[Step] | None, BaseException | None]:
    """Return the steps of a deformation, or what ended it before."""
    before = signal.signal(signal.SIGALRM, _ring)
    signal.setitimer(signal.ITIMER_REAL, LIMIT_S)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            return list(deform(case, mesh)), None
    except (Exception, TooLong) as problem:
        return None, problem
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _ring(_number: int, _frame: FrameType | None) -> None:
    raise TooLong(f"more than {LIMIT_S:.0f} s")


def told(problem: BaseException | None) -> str:
    """Return an error and where it came from, in one line."""
    assert problem is not None
    last = traceback.extract_tb(problem.__traceback__)
    place = next((f for f in reversed(last) if "slideviz" in f.filename), last[-1])
    where = f"{place.filename.rpartition('slideviz/')[2]}:{place.lineno}"
    return f"{type(problem).__name__} at {where}: {str(problem)[:200]}"
