"""JIT warm-up: tiny deformations that make Numba compile, or load, its loops in advance."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any

from slideviz.case.model import Case, Translate
from slideviz.errors import Cancelled, SlidevizError
from slideviz.samples.table import sample
from slideviz.session.jobs import Stopped, require_going

_RUNS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    # The first compiles nearly everything: curved boundaries, and angles in the distance.
    ("cylindrical", {"sliding": "ps"}),
    ("cylindrical", {"sliding": "ds"}),
    ("hexahedron", {"sliding": "ps"}),
    ("square", {"sliding": "ps"}),
    ("cylindrical", {"sliding": "ps", "method": "idw"}),
    ("square", {"sliding": "ps", "method": "idw"}),
    ("hexahedron", {"sliding": "ds", "method": "elastic"}),
)
"""Samples and settings that need every loop between them."""


def warm_up(compiling: Callable[[], None], stopped: Stopped) -> None:
    """Deform some cells of the samples, in memory.

    Parameters
    ----------
    compiling
        Called when something is really compiled; never when all comes from the cache on disk.
    stopped
        Asked between and within the deformations; compilation itself cannot be interrupted.
    """
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, _: object) -> None:
            compiling()

        def on_end(self, _: object) -> None:
            pass

    # What fails here fails again in the user's run, with a message there.
    with (
        contextlib.suppress(Cancelled, SlidevizError),
        event.install_listener("numba:compile", Listener()),
    ):
        for name, settings in _RUNS:
            require_going(stopped)
            _deform(name, settings, stopped)


def _deform(name: str, settings: Mapping[str, Any], stopped: Stopped) -> None:
    from slideviz.deformation.solver import deform

    # Elasticity needs so many cells that its solver has more than one level.
    made = sample(name, size=8 if settings.get("method") == "elastic" else 4)
    mesh = made.mesh
    (block,) = made.case.markers_with("moving")
    motion = Translate(block, (1e-3 * mesh.extent,) * mesh.dim)
    case: Case = made.case.change(
        motions=(motion,), steps=1, periodic="moving", reduction=None, **settings
    )
    for _ in deform(case, mesh, progress=lambda _: require_going(stopped)):
        pass
