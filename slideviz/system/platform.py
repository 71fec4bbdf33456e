"""All that differs between operating systems: what is used where it exists, and what else happens.

The table is on the page of systems (``docs/reference/systems.md``). Everything else in slideviz
calls the functions here, and none of the names in it (``tests/system/test_platform.py``).
"""

from __future__ import annotations

import ctypes
import errno
import mmap
import os
import platform
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]


_PEACE = threading.Lock()  # held while a file is at one place, where there is no `pread`
_SHARING = (32, 33)  # errors of Windows: a file, or a part of it, is in use
_SET_DEATH_SIGNAL = 1  # ``PR_SET_PDEATHSIG`` of Linux's ``prctl``
_QUERY = 0x1000  # ``PROCESS_QUERY_LIMITED_INFORMATION`` of Windows
_STILL_ACTIVE = 259  # exit code of a process of Windows that runs
ENDING_SIGNALS = {signal.SIGINT: "cancelled", signal.SIGTERM: "ended by SIGTERM"}
"""Signals that end any command at any moment, with words for a message; the exit code is 128 plus
the number of the signal."""
if hasattr(signal, "SIGHUP"):
    ENDING_SIGNALS[signal.SIGHUP] = "ended by SIGHUP"


# Files -----------------------------------------------------------------------------------
def open_unlinked(
    path: Path | str, flags: int, *, synced: bool = False, brief: bool = False
) -> int:
    """Return a descriptor of a file, which is not opened through a symbolic link; else OSError.

    ``synced``: what is written is on the disk when a write returns, where the system can do that.
    ``brief``: the file is removed while it is mapped; Windows does so when the map ends.
    """
    if not hasattr(os, "O_NOFOLLOW") and os.path.islink(path):  # noqa: PTH114
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    for name in ("O_NOFOLLOW", "O_BINARY", *["O_DSYNC"] * synced, *["O_TEMPORARY"] * brief):
        flags |= getattr(os, name, 0)
    return os.open(path, flags, 0o600)


def set_mode(file: int, path: Path, mode: int) -> None:
    """Set the permissions of an open file."""
    if hasattr(os, "fchmod"):
        os.fchmod(file, mode)
    else:
        path.chmod(mode)


def is_in_use(problem: OSError) -> bool:
    """Return whether a file could not be changed because it is open: Windows refuses that."""
    return getattr(problem, "winerror", None) in _SHARING


def read_at(file: int, count: int, place: int) -> bytes:
    """Return up to ``count`` bytes from byte ``place`` of a file that nothing else reads."""
    if hasattr(os, "pread"):
        return os.pread(file, count, place)
    with _PEACE:
        os.lseek(file, place, os.SEEK_SET)
        return os.read(file, count)


def write_at(file: int, content: NDArray, place: int) -> None:
    """Write an array to byte ``place`` of a file that nothing else writes."""
    _write(file, content.view("u1").data, place)


def _write(file: int, left: memoryview, place: int) -> None:
    while left:
        if hasattr(os, "pwrite"):
            written = os.pwrite(file, left, place)
        else:
            with _PEACE:
                os.lseek(file, place, os.SEEK_SET)
                written = os.write(file, left)
        place += written
        left = left[written:]


def copied(source: int, target: int, place: int, count: int) -> int:
    """Copy up to ``count`` bytes at ``place``, in the kernel if possible; return how many."""
    with suppress(OSError, AttributeError):
        moved = os.copy_file_range(source, target, count, place, place)
        if moved:
            return moved
    block = read_at(source, count, place)
    _write(target, memoryview(block), place)
    return len(block)


def allocate(file: int, size: int) -> None:
    """Make an empty file ``size`` bytes long; OSError where a full disk is noticed."""
    os.ftruncate(file, size)
    if hasattr(os, "posix_fallocate"):  # else a full disk would end the process
        os.posix_fallocate(file, 0, size)


def release_pages(pages: mmap.mmap) -> None:
    """Give the memory of a mapped file back to the system; its values stay in the file."""
    if hasattr(mmap, "MADV_DONTNEED"):
        pages.madvise(mmap.MADV_DONTNEED)


# Memory and processors -------------------------------------------------------------------
def total_memory() -> float:
    """Return the bytes of memory of this machine; infinite where the system does not say."""
    with suppress(AttributeError, ValueError, OSError):
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    return float("inf")


def free_memory() -> float:
    """Return the bytes a process may still take; infinite where the system does not say."""
    with suppress(OSError), open("/proc/meminfo", encoding="ascii") as lines:  # noqa: PTH123
        for line in lines:
            if line.startswith("MemAvailable:"):
                return float(line.split()[1]) * 1024
    return float("inf")


def give_back() -> None:
    """Return freed memory to the system; the C library of Linux would keep it for later use."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def usable_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(_affinity()) or os.cpu_count() or 1


def _affinity() -> set[int]:
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()


def cores_of_all(near: Any) -> int:
    """Return the number of cores that any of the MPI ranks ``near`` may use; all may use them then.

    A launcher binds each to a few, but rank 0 needs all where it works alone.
    """
    every = set[int]().union(*near.allgather(_affinity()))
    if not every:
        return os.cpu_count() or 1
    os.sched_setaffinity(0, every)
    return len(every)


def lower_priority(thread: int, by: int) -> None:
    """Lower the priority of a thread of this process, and of those that it starts."""
    # On other systems than Linux a priority is that of the whole process.
    if platform.system() == "Linux" and hasattr(os, "setpriority"):
        with suppress(OSError):
            before = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, before + by)


def thread_names() -> dict[int, str]:
    """Return the names of the threads of this process, also of those of libraries, by number."""
    found = {}
    with suppress(OSError):
        for task in Path("/proc/self/task").iterdir():
            # A thread may have ended meanwhile.
            with suppress(OSError):
                found[int(task.name)] = (task / "comm").read_text("utf-8")
    return found


# Processes -------------------------------------------------------------------------------
def machine_name() -> str:
    """Return the name of this machine in its network."""
    return platform.node()


def process_space() -> str:
    """Return a name of this machine and its process namespace, that of a container.

    Several machines may use the same folder, and a process that does not exist on this one may run
    on another.
    """
    name = "".join(sign if sign.isalnum() else "_" for sign in machine_name())[:40]
    try:
        return f"{name}-{os.stat('/proc/self/ns/pid').st_ino:x}"  # noqa: PTH116
    except OSError:
        return f"{name}-0"


def is_alive(pid: str) -> bool:
    """Return whether a process with the number ``pid`` runs; False if it is not a number."""
    try:
        if os.name == "nt":  # where the signal 0 would end it
            return _is_active(int(pid))
        os.kill(int(pid), 0)
    except (ValueError, OverflowError, ProcessLookupError):
        return False
    except OSError:
        return True
    return True


def _is_active(pid: int) -> bool:
    kernel = ctypes.windll.kernel32  # type: ignore[attr-defined]
    process = kernel.OpenProcess(_QUERY, False, pid)
    code = ctypes.c_ulong()
    running = bool(process) and bool(kernel.GetExitCodeProcess(process, ctypes.byref(code)))
    if process:
        kernel.CloseHandle(process)
    return running and code.value == _STILL_ACTIVE


def limit_process(seconds: int, memory: int) -> None:
    """Limit the processor time and the memory in bytes of this process."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))


def limits_time() -> bool:
    """Return whether `limit_process` limits the time."""
    return resource is not None


def ran_out_of_time(code: int) -> bool:
    """Return whether a process with this exit code was ended by `limit_process`, for its time."""
    return code == -getattr(signal, "SIGXCPU", 0) != 0


def end_with(parent: int) -> bool:
    """Let the system end this process when ``parent`` ends; return whether that still runs."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    return os.getppid() == parent


# Signals ---------------------------------------------------------------------------------
@contextmanager
def interrupt_blocked() -> Iterator[None]:
    """Context in which started processes do not react to Ctrl+C: they inherit the signal mask."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, masked)


def termination_waits() -> list[Callable[[], object]]:
    """Block SIGTERM, and return what waits for it: a function, or none where it ends at once."""
    if not hasattr(signal, "sigwait"):
        return []
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    return [lambda: signal.sigwait({signal.SIGTERM})]


def wakeup_pipe() -> int:
    """Return the end of a pipe to read, into which the numbers of arriving signals are written."""
    read, write = os.pipe()
    if hasattr(os, "set_blocking"):
        os.set_blocking(write, False)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    return read


# The screen ------------------------------------------------------------------------------
def needs_server() -> bool:
    """Return whether windows are shown by a server that may be missing: X11 or Wayland."""
    return platform.system() == "Linux"


def has_x_server() -> bool:
    """Return whether the X server named by ``DISPLAY`` accepts connections."""
    if not os.environ.get("DISPLAY"):
        return False
    try:
        library = ctypes.CDLL("libX11.so.6")
    except OSError:
        return True  # without libX11 it cannot be tested
    library.XOpenDisplay.restype = ctypes.c_void_p
    library.XOpenDisplay.argtypes = [ctypes.c_char_p]
    library.XCloseDisplay.argtypes = [ctypes.c_void_p]
    server = library.XOpenDisplay(None)
    if server:
        library.XCloseDisplay(server)
    return bool(server)


def has_wayland() -> bool:
    """Return whether the compositor named by ``WAYLAND_DISPLAY`` accepts connections."""
    name = os.environ.get("WAYLAND_DISPLAY")
    if not name:
        return False
    place = Path(os.environ.get("XDG_RUNTIME_DIR", "/"), name)
    try:
        with closing(socket.socket(socket.AF_UNIX)) as line:
            line.connect(str(place))
    except (OSError, AttributeError):
        return False
    return True
