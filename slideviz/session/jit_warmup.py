"""JIT warm-up: deforms tiny meshes, so that Numba's loops are compiled, or loaded, in advance."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from slideviz.case.model import Case
from slideviz.case.motions.rigid import Translate
from slideviz.errors import Cancelled, SlidevizError
from slideviz.formats.source import Source
from slideviz.formats.su2.read import read_su2
from slideviz.formats.su2.write import su2_blocks
from slideviz.mesh.walls import walls
from slideviz.samples.table import sample
from slideviz.sections.cut import Cutter
from slideviz.sections.plane import Plane
from slideviz.session.jobs import Job
from slideviz.session.state import cell_displacement
from slideviz.solver.deform import deform
from slideviz.system.jit_cache import compilation_watched

_RUNS: tuple[tuple[str, Mapping[str, Any]], ...] = (
    # The first compiles nearly everything: curved boundaries, and angles in the distance.
    ("cylindrical", {"sliding": "ps"}),
    ("cylindrical", {"sliding": "ds"}),
    ("hexahedron", {"sliding": "ps", "relax": "yes", "layers": "keep"}),
    ("square", {"sliding": "ps", "repair": "yes", "repair_below": 0.999999}),
    ("cylindrical", {"sliding": "ps", "method": "idw"}),
    ("square", {"sliding": "ps", "method": "idw"}),
    ("hexahedron", {"sliding": "ds", "method": "elastic"}),
)
"""Samples and settings that together use every compiled loop."""


def warm_up(compiling: Callable[[], None], job: Job) -> None:
    """Write, read, cut and deform samples of few cells in memory, to compile all loops.

    ``compiling``: called when a loop is compiled; never when all come from the cache on disk.
    ``job`` may be stopped; compilation itself cannot be interrupted.
    """
    # An error here is one in the user's run too, where it gets a message.
    with contextlib.suppress(Cancelled, SlidevizError), compilation_watched(compiling):
        _write_and_read()
        _look()
        for name, settings in _RUNS:
            job.going_on()
            _deform(name, settings, job)


def _write_and_read() -> None:
    """Write a mesh as SU2 text, read it, and write it moved, in memory."""
    mesh = sample("square", size=4).mesh
    text = Source(Path(mesh.name), b"".join(su2_blocks(mesh)))
    read = read_su2(text, None, lambda _: None)
    b"".join(su2_blocks(read.with_points(read.points / 3.0)))


def _look() -> None:
    """Cut a mesh, color it by its displacement, and measure its walls."""
    mesh = sample("cylindrical", size=4).mesh
    Cutter(mesh).cut(mesh.points, Plane("plane", tuple(mesh.points.mean(axis=0)), (0, 0, 1)))
    cell_displacement(mesh.with_points(mesh.points / 3.0), mesh)
    walls(mesh)


def _deform(name: str, settings: Mapping[str, Any], job: Job) -> None:
    made = sample(name, size=_size(settings))
    mesh = made.mesh
    (block,) = made.case.markers_with("moving")
    motion = Translate(block, (1e-3 * mesh.extent,) * mesh.dim)
    case: Case = made.case.change(
        motions=(motion,), steps=1, periodic="moving", reduction=None, **settings
    )
    for _ in deform(case, mesh, progress=job.going_on, certify=True):
        pass


def _size(settings: Mapping[str, Any]) -> int:
    """Return how many cells a sample has along an axis: few, but enough for all loops to run."""
    if settings.get("method") == "elastic":
        return 16  # smaller systems are factorised
    return 8 if "relax" in settings else 4  # its hierarchy has more than one level
