"""The command line: the only package that prints or chooses an exit code.

Exit codes: 0 done; 1 the mesh or case is wrong; 2 wrong usage; 3 done, but cells are inverted; 130
cancelled; 143 ended by SIGTERM.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from mmap import mmap
from typing import TYPE_CHECKING

from slideviz.cli.output_paths import input_paths
from slideviz.cli.parser import parse
from slideviz.cli.progress import note_compilation
from slideviz.cli.terminal import CANCELLED, DONE, WRONG_INPUT, holding, terminal_streams
from slideviz.errors import OUT_OF_MEMORY, Cancelled, SlidevizError
from slideviz.system.cleanup import leftover_message
from slideviz.system.file_checks import protected

if TYPE_CHECKING:
    from slideviz.system.ranks import Ranks


def run(argv: Sequence[str]) -> int:
    """Run one command and return its exit code; an error is printed as a message."""
    with terminal_streams():
        variable = launched()
        code = _shared(argv, variable) if variable else _run(argv, None)
        try:
            sys.stdout.flush()  # here, where a failure can still be reported
        except BrokenPipeError:
            return DONE
        except SlidevizError as problem:
            return _fail(str(problem), WRONG_INPUT)
        return code


def _shared(argv: Sequence[str], variable: str) -> int:
    try:
        return run_shared(argv, variable, lambda ranks: _run(argv, ranks))
    except SlidevizError as problem:
        return _fail(str(problem), WRONG_INPUT)


def _run(argv: Sequence[str], ranks: Ranks | None) -> int:
    # With a new cache, Matplotlib logs a line for each font that it replaces in formulas.
    logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)
    try:
        arguments = parse(argv)
        mmap(-1, LEAST_BYTES).close()
        arguments.inputs = input_paths(arguments)
        arguments.ranks = ranks
        with (
            protected(lambda: arguments.inputs),
            note_compilation(arguments.quiet),
            holding() if arguments.holds else nullcontext() as arguments.begun,
        ):
            return _called(arguments)
    except SystemExit as stop:  # argparse: --help is 0, wrong usage 2
        return int(stop.code or 0)
    except (KeyboardInterrupt, Cancelled):
        return _fail(f"cancelled; {leftover_message()}", CANCELLED)
    except SlidevizError as problem:
        return _fail(str(problem), WRONG_INPUT)
    except MemoryError:
        return _fail(OUT_OF_MEMORY, WRONG_INPUT)
    except BrokenPipeError:
        # The reader of the output has ended (`slideviz info MESH | head`): that is not an error.
        return DONE
    except OSError as problem:
        text = NO_MEMORY if _NO_MEMORY.search(str(problem)) else str(problem)
        return _fail(text, WRONG_INPUT)
    except Exception as problem:
        if os.environ.get("SLIDEVIZ_DEBUG"):
            traceback.print_exc()
        if isinstance(problem, ImportError) and _NO_MEMORY.search(str(problem)):
            return _fail(NO_MEMORY, WRONG_INPUT)
        missing = (isinstance(problem, ModuleNotFoundError) and problem.name) or "slideviz"
        if not missing.startswith("slideviz"):
            module = missing.partition(".")[0]
            packages = PACKAGES.get(module, module)
            return _fail(
                f"this needs {module}, which is not installed; use `pip install {packages}`",
                WRONG_INPUT,
            )
        return _fail(
            f"internal error ({type(problem).__name__}: {problem}); please report it with the "
            "output of the same command under SLIDEVIZ_DEBUG=1",
            WRONG_INPUT,
        )


def _called(arguments: argparse.Namespace) -> int:
    """Call the command of the arguments; its errors get the lines of the case file."""
    try:
        return int(arguments.command(arguments))
    except SlidevizError as problem:
        if any(message.keys and not message.line for message in problem.messages):
            # Late: NumPy takes 0.1 s.
            from slideviz.cli.mesh_source import with_lines

            problem.args = with_lines(problem.messages, arguments)
        raise


PACKAGES = {
    "skfem": "scikit-fem",
    **dict.fromkeys(
        ("pyvista", "vtkmodules", "PIL", "imageio_ffmpeg"), "pyvista vtk pillow imageio-ffmpeg"
    ),
    **dict.fromkeys(("PySide6", "qtpy", "pyvistaqt"), "slideviz"),
}
"""What pip installs for a module: packages of another name, or all that pictures or the window
need."""

LEAST_BYTES = 1 << 30
"""Address space without which OpenBLAS may wait for memory without an end."""
NO_MEMORY = (
    "there is not enough memory to load the libraries that this needs; close other programs, or "
    "raise the limit (ulimit -v)"
)
_NO_MEMORY = re.compile("cannot allocate|failed to map|load shared object", re.IGNORECASE)
"""What the system's loader says, and llvmlite, where a library finds no room in memory."""


def _fail(message: str, code: int) -> int:
    print(f"slideviz: {message}", file=sys.stderr)
    return code


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
    count = _number(variable)
    rank = _number(dict(_LAUNCHERS)[variable])
    if rank:
        _silence()
    if argv[:1] != ["run"] or "--stream" not in argv:
        if rank:
            return DONE  # no error here: mpirun would end rank 0 before it has printed why
        raise SlidevizError(
            f"{count} processes of one command were started, but only `slideviz run` with --stream "
            "(for SU2 meshes) shares its work among several; add --stream, or start one "
            f"(unset {variable} where a program with MPI calls slideviz)"
        )
    # Late: NumPy and pickles, only for several processes, take 0.1 s.
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
    """Send all output of this process, libraries included, to the null device."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    if not os.environ.get("SLIDEVIZ_DEBUG"):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.dup2(nothing, 2)
