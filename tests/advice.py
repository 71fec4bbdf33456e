"""What the commands say may help against inverted cells."""

from types import SimpleNamespace
from typing import Any

from slideviz.cli.report import _advice


def advice_for(case: Any, step: Any = None, mesh: Any = None, found: Any = None) -> str:
    """Return the advice after a run whose last step is ``step``; without a mesh of one in a file.

    ``found`` is its quality; without it one cell is inverted.
    """
    quality = found or SimpleNamespace(inverted=1)
    walls = None if mesh is None else ()
    done: Any = SimpleNamespace(quality=quality, walls=walls, mesh=mesh, steps=(step,))
    return _advice(case, done, ())
