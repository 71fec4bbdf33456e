"""Several processes of one command, started by mpirun or srun: only rank 0 prints."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from slideviz.cli.terminal import DONE
from slideviz.errors import SlidevizError

if TYPE_CHECKING:
    from slideviz.system.ranks import Ranks

_LAUNCHERS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)
"""Variables with the number of processes, and the rank of this one: of Open MPI, MPICH (and those
made from it), and srun."""


def launched() -> str:
    """Return the name of the variable with the number of processes; "" where it is one or none."""
    for size, rank in _LAUNCHERS:
        if _number(size) > 1 and os.environ.get(rank):
            return size
    return ""


def run_shared(argv: Sequence[str], variable: str, run: Callable[[Ranks], int]) -> int:
    """Run a command that several processes share, and return its exit code.

    Raises SlidevizError if processes cannot share this command, or MPI does not connect them.
    ``argv``: the words of the command line. ``variable``: the variable with the number of
    processes, of `launched`. ``run``: runs the command; called on rank 0 only, while the others
    serve it.
    """
    count, rank = _number(variable), _number(dict(_LAUNCHERS)[variable])
    if rank:
        _silence()
    if argv[:1] != ["run"] or not {"--stream", "--resume"} & set(argv):
        if rank:
            return DONE  # no error here: mpirun would end rank 0 before it has printed why
        raise SlidevizError(
            f"{count} processes of one command were started, but only `slideviz run` with --stream "
            "(for SU2 meshes) shares its work among several; add --stream, or start one "
            f"(unset {variable} where a program with MPI calls slideviz)"
        )
    from slideviz.system.ranks import Ranks

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
    """Send all output of this process to the null device, that of libraries, too."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    if not os.environ.get("SLIDEVIZ_DEBUG"):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
