"""Several processes of one command, as mpirun or srun start them: one of them speaks for all."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from slideviz.cli.exit_codes import DONE
from slideviz.errors import SlidevizError

if TYPE_CHECKING:
    from slideviz.mesh.ranks import Ranks

_LAUNCHERS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)
"""What Open MPI, MPICH and its relatives, and srun tell each process: how many, and which."""


def launched() -> str:
    """Return the variable that says how many processes were started, nothing where one was.

    A single one needs no MPI at all.
    """
    for size, rank in _LAUNCHERS:
        if _number(size) > 1 and os.environ.get(rank):
            return size
    return ""


def run_shared(argv: Sequence[str], variable: str, run: Callable[[Ranks], int]) -> int:
    """Return the exit code of a command that several processes share: ``run`` is for rank 0.

    Raises
    ------
    SlidevizError
        It is none that they can share, or MPI does not connect them.
    """
    count, rank = _number(variable), _number(dict(_LAUNCHERS)[variable])
    if rank:
        _silence()
    if argv[:1] != ["run"] or not {"--stream", "--resume"} & set(argv):
        if rank:
            return DONE  # mpirun ends all at the first error: rank 0 must have said why
        raise SlidevizError(
            f"{count} processes of one command were started, but only `slideviz run` with --stream "
            "(for SU2 meshes) shares its work among several; add --stream, or start one "
            f"(unset {variable} where a program with MPI calls slideviz)"
        )
    from slideviz.mesh.ranks import Ranks

    try:
        ranks = Ranks.joined(count)
    except SlidevizError:
        if rank:
            time.sleep(1.0)  # as above, where rank 0 has the same error
        raise
    if not ranks.rank:
        with ranks:
            return run(ranks)
    try:
        ranks.serve()
    except BaseException:
        ranks.comm.Abort(1)  # rank 0 would wait for this one
    return DONE


def _number(variable: str) -> int:
    text = os.environ.get(variable, "")
    return int(text) if text.isdecimal() else 0


def _silence() -> None:
    """Let this process print nothing, libraries and signals included."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    if not os.environ.get("SLIDEVIZ_DEBUG"):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
