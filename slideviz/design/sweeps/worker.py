"""The work of a sweep on one design, in a process of any executor.

The mesh is sent to a process once and kept there, with what is computed once for it (boundary,
undeformed quality); a task is then the case only. A process without the mesh answers so, and is
sent the mesh with its next task.
"""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from pathlib import Path
from threading import Lock
from typing import Any

from slideviz import __version__
from slideviz.case.model import Case
from slideviz.design.sweeps.table import DesignRow
from slideviz.errors import Note, SlidevizError
from slideviz.formats.files import write
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import quality
from slideviz.solver.deform import deform
from slideviz.solver.steps import Step
from slideviz.terms import FileFormat

_KEPT = 2
"""Number of meshes that a process keeps: that of the sweep, and one of another sweep."""
_meshes: dict[str, Mesh] = {}
"""The meshes of this process, by name."""
_one_at_a_time = Lock()
"""Held during a task: Numba ends the process if loops of two threads run at once."""


@dataclass(frozen=True)
class Packed:
    """A mesh as bytes, and a name that is unique to them."""

    name: str
    content: bytes


@dataclass(frozen=True)
class Task:
    """A design as it is sent to a worker."""

    design: int
    """Its number, from 1."""
    case: Case
    mesh: str
    """Name of the packed mesh."""
    version: str = __version__
    """Of the slideviz that sends it."""
    packed: Packed | None = None
    """The mesh, for a worker that lacks it."""
    output: Path | None = None
    """Where the deformed mesh is written; None: it is not."""
    file_format: FileFormat | None = None
    """Of ``output``; None: as its ending says."""


@dataclass(frozen=True)
class TaskResult:
    """The result of a task, and the name of the worker; no row where the worker lacks the mesh."""

    worker: str
    row: DesignRow | None = None


def pack_mesh(mesh: Mesh) -> Packed:
    """Return a mesh as bytes, named by their digest."""
    content = pickle.dumps(mesh, protocol=pickle.HIGHEST_PROTOCOL)
    return Packed(blake2b(content, digest_size=16).hexdigest(), content)


def cache_mesh(mesh: Packed) -> str:
    """Keep a mesh in this process; return the name of the process."""
    if mesh.name not in _meshes:
        while len(_meshes) >= _KEPT:
            _meshes.pop(next(iter(_meshes)))
        _meshes[mesh.name] = pickle.loads(mesh.content)
    return _worker_name()


def run_task(task: Task) -> TaskResult:
    """Deform the mesh by a design; return its row. An exception becomes a row with the reason."""
    if task.version != __version__:
        reason = f"the worker {_worker_name()} has slideviz {__version__}, this is {task.version}"
        return TaskResult(
            _worker_name(), DesignRow(task.design, problem=f"{reason}; install the same version")
        )
    with _one_at_a_time:
        if task.packed is not None:
            cache_mesh(task.packed)
        mesh = _meshes.get(task.mesh)
        if mesh is None:
            return TaskResult(_worker_name())
        begin = time.perf_counter()
        try:
            with _one_thread():
                row = _result(task, mesh, begin)
        except SlidevizError as problem:
            row = DesignRow(task.design, problem="; ".join(str(problem).splitlines()))
        except MemoryError:
            row = DesignRow(task.design, problem="out of memory; a coarser mesh or fewer workers")
        except Exception as problem:
            row = DesignRow(
                task.design, problem=f"internal error ({type(problem).__name__}: {problem})"
            )
        return TaskResult(_worker_name(), row)


def _result(task: Task, mesh: Mesh, begin: float) -> DesignRow:
    """Deform the mesh as ``slideviz run`` does, and return the row."""
    last, errors = None, []
    for step in deform(task.case, mesh):
        last = step
        errors.append(step.max_error)
    assert last is not None
    measured = quality(last.mesh, reference=mesh, metric=task.case.quality_metric)
    if task.output is not None:
        write(task.output, last.mesh, base=mesh, file_format=task.file_format)
    return DesignRow(
        design=task.design,
        min=measured.min,
        mean=measured.mean,
        inverted=measured.inverted,
        max_error=max(errors),
        control_nodes=last.control_nodes,
        steps=last.total,
        seconds=time.perf_counter() - begin,
        mesh=task.output,
        warnings=_warnings(last),
    )


def _warnings(last: Step) -> tuple[str, ...]:
    """Return the warnings of a run, without notes."""
    return tuple(text for text in last.warnings if not isinstance(text, Note))


def _worker_name() -> str:
    """Return the name of this process: host and process id."""
    return f"{os.uname().nodename}, process {os.getpid()}"


@contextmanager
def _one_thread() -> Iterator[None]:
    """Context in which loops and linear algebra use one thread: designs run in parallel."""
    from numba import get_num_threads, set_num_threads

    before = get_num_threads()
    set_num_threads(1)
    try:
        with _libraries().limit(limits=1):
            yield
    finally:
        set_num_threads(before)


@cache
def _libraries() -> Any:
    """Return the libraries of linear algebra of this process; finding them takes milliseconds."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
