"""Subprocess reader: meshes of other formats than SU2 are read in a process of their own.

Some readers of meshio run for hours on a wrong count, allocate all memory, or crash in a C library.
A process of its own has limits of time and memory, can be stopped at any moment, and leaves the
window responsive.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from slideviz.errors import MeshError, path_error
from slideviz.formats.table import MESHIO, format_for
from slideviz.mesh.model import Cells, Marker, Mesh
from slideviz.system.cleanup import killed_at_end
from slideviz.system.threads import Tick

# Limits of the process: several times what the slowest of meshio's readers needs.
_SECONDS = 20
_SECONDS_PER_BYTE = 20e-6
_MEMORY = 8 << 30
_MEMORY_PER_BYTE = 200
_TICK_SECONDS = 0.05
"""Seconds between two calls of the progress function."""
_BYTES_PER_SECOND = 5e6
"""Speed of reading that the progress assumes."""
_CHUNK_BYTES = 1 << 20
"""Most bytes that are read from the process at a time."""
_SET_DEATH_SIGNAL = 1
"""``PR_SET_PDEATHSIG`` of Linux's ``prctl``."""


def read_in_subprocess(path: Path, progress: Tick) -> Mesh:
    """Return the mesh of a file, read by the isolated reader of its format.

    Raises MeshError as the reader does, and if the process takes too long, crashes or does not
    start.
    """
    begun = time.monotonic()
    expected = 1.0 + path.stat().st_size / _BYTES_PER_SECOND
    # Without -P a file numpy.py in the folder of the mesh would be run.
    command = [sys.executable, "-P", "-c", f"from {__name__} import main; main()"]
    command += [*map(str, (os.getpid(), *_limits(path.stat().st_size))), str(path)]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(part for part in sys.path if part),
        # Threads reserve memory, which counts against the limit.
        "OPENBLAS_NUM_THREADS": "1",
    }
    answer = bytearray()
    with _started(path, command, environment) as reader, killed_at_end(reader):
        assert reader.stdout is not None
        while True:
            spent = time.monotonic() - begun
            progress(0.9 * spent / (spent + expected))
            if not select.select([reader.stdout], [], [], _TICK_SECONDS)[0]:
                continue
            chunk = os.read(reader.stdout.fileno(), _CHUNK_BYTES)
            if not chunk:
                break
            answer += chunk
        code = reader.wait()
    mesh = _unpacked(path, bytes(answer), code)
    progress(1.0)
    return mesh


def _started(
    path: Path, command: list[str], environment: dict[str, str]
) -> subprocess.Popen[bytes]:
    """Return the process of a command, its output a pipe; raise MeshError if it does not start."""
    try:
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
    except OSError as problem:
        raise path_error(
            path,
            f"cannot be read: its reader does not start: {problem.strerror}; close other programs",
        ) from problem


def _limits(size: int) -> tuple[int, int]:
    """Return the limits, seconds and bytes of memory, for reading a file of ``size`` bytes."""
    present = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    memory = min(_MEMORY + _MEMORY_PER_BYTE * size, 0.8 * present)
    return int(_SECONDS + _SECONDS_PER_BYTE * size), int(memory)


def _unpacked(path: Path, answer: bytes, code: int) -> Mesh:
    """Return the mesh that the process sent, or raise MeshError with its message or exit code."""
    if code == -signal.SIGXCPU:
        raise path_error(
            path,
            "cannot be read: it takes longer than a file of this size should; check its counts, "
            "or use another format, such as .su2 or .vtu",
        )
    if code or not answer:
        raise path_error(
            path,
            f"cannot be read: {_library(path)} crashed on it (code {code}); check the file, "
            "or use another format, such as .su2 or .vtu",
        )
    content = pickle.loads(answer)
    if isinstance(content, str):
        raise MeshError(content)
    assert isinstance(content, Mesh)
    return content


def _library(path: Path) -> str:
    """Return the name of the library that reads a file, for messages."""
    return "meshio" if format_for(path).reader == MESHIO.reader else "HDF5"


def main() -> None:
    """Read a mesh and write it, pickled, to the standard output: the program of the subprocess.

    Its command-line arguments are the parent's process number, the limits (seconds and bytes of
    memory), and the path. If the file cannot be read, it writes the message of the error instead.
    """
    _die_with(int(sys.argv[1]))
    # Whatever prints must not get into the answer.
    with os.fdopen(os.dup(1), "wb") as channel:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        seconds, memory, path = int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])
        _limit(seconds, memory)
        try:
            mesh = format_for(path).function("reader")(path)
        except MeshError as problem:
            pickle.dump(str(problem), channel)
        except MemoryError:
            pickle.dump(str(_too_large(path)), channel)
        else:
            # Without what they have cached; by protocol 5 read-only arrays stay read-only.
            markers = tuple(Marker(one.name, _bare(one.cells)) for one in mesh.markers)
            pickle.dump(replace(mesh, cells=_bare(mesh.cells), markers=markers), channel, 5)


def _bare(cells: Cells) -> Cells:
    return Cells(cells.types, cells.offsets, cells.connectivity)


def _limit(seconds: int, memory: int) -> None:
    """Let the system end this process after ``seconds`` of CPU time; limit its memory (bytes)."""
    import resource  # POSIX only

    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


def _die_with(parent: int) -> None:
    """Let the system end this process when the process ``parent`` ends; end now if it has."""
    with suppress(OSError, AttributeError):  # other systems than Linux have no such call
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:  # it was killed before
        sys.exit(1)


def _too_large(path: Path) -> MeshError:
    """Return the error for a file whose reading needs more memory than the limit."""
    return path_error(
        path,
        "cannot be read: it needs more memory than a file of this size should; check its counts, "
        "or use another format, such as .su2 or .vtu",
    )
