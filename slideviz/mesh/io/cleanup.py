"""Clean-up of what must not outlive the program: drafts of files, and programs it started.

A draft is a temporary file or folder beside what it is to become. Its name tells the machine and
the process that it belongs to, so that the next one that writes to the same folder can remove
what a process left that was killed.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

PREFIX = ".slideviz-"
_SUFFIX = ".tmp"


class Process(Protocol):
    """A program that was started, as of `subprocess.Popen`."""

    def kill(self) -> None:
        """End it at once."""

    def wait(self) -> int:
        """Return its exit code when it has ended."""


NOTHING_LEFT = "nothing half-written is left"
_drafts: set[Path] = set()
_processes: set[Process] = set()
_kept: dict[Path, str] = {}


@contextmanager
def draft(folder: Path, is_folder: bool = False) -> Iterator[Path]:
    """Return a new path in a folder for a draft; what is there at the end is removed.

    Drafts that dead processes of this machine left in the folder are removed, too.

    Parameters
    ----------
    folder : Path
        Where the draft is to be.
    is_folder : bool
        Whether the draft is a folder, which is made then.

    Raises
    ------
    OSError
        The folder of drafts cannot be made.
    """
    _sweep(folder)
    path = folder / f"{_owned(os.getpid())}{os.urandom(8).hex()}{_SUFFIX}"
    _drafts.add(path)
    try:
        if is_folder:
            path.mkdir(mode=0o700)
        yield path
    finally:
        _remove(path)
        _drafts.discard(path)


@contextmanager
def ended(process: Process) -> Iterator[None]:
    """Return a context after which, however it ends, the program does not run any more."""
    _processes.add(process)
    try:
        yield
    finally:
        process.kill()
        process.wait()
        _processes.discard(process)


def clean_up() -> None:
    """Kill the programs that were started and remove all drafts, before the end of the process."""
    for process in list(_processes):
        with suppress(OSError):
            process.kill()
    for path in list(_drafts):
        _remove(path)


@contextmanager
def removed_at_stop(path: Path) -> Iterator[None]:
    """Return a context in which a file is removed at the end of the process, until it is kept."""
    _drafts.add(path)
    try:
        yield
    finally:
        _drafts.discard(path)
        _kept.pop(path, None)


def keep(path: Path, words: str) -> None:
    """Leave a partial file when the process ends, and say so in these words."""
    _drafts.discard(path)
    _kept[path] = words


def left() -> str:
    """Return in words what is left when the process ends now."""
    return next(reversed(_kept.values()), NOTHING_LEFT)


def is_alive(pid: str) -> bool:
    """Tell whether a process of that number runs; what is no number is none."""
    try:
        os.kill(int(pid), 0)
    except (ValueError, OverflowError, ProcessLookupError):
        return False
    except OSError:
        return True
    return True


def _owned(pid: int | str) -> str:
    """Return the beginning of the names of a process's drafts."""
    return f"{PREFIX}{_machine()}-{pid}-"


def _machine() -> str:
    """Return what tells apart machines, and containers with process numbers of their own.

    They may see the same folder, and a process of another machine is not dead for being unknown
    on this one.
    """
    name = "".join(sign if sign.isalnum() else "_" for sign in os.uname().nodename)[:40]
    try:
        return f"{name}-{os.stat('/proc/self/ns/pid').st_ino:x}"  # noqa: PTH116
    except OSError:  # no Linux
        return f"{name}-0"


def _sweep(folder: Path) -> None:
    """Remove the drafts of dead processes of this machine; those of others are not ours."""
    mine = _owned("").removesuffix("-")
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not (entry.name.startswith(mine) and entry.name.endswith(_SUFFIX)):
                continue
            pid = entry.name.removeprefix(mine).partition("-")[0]
            if pid.isdecimal() and not is_alive(pid):
                _remove(Path(entry.path))


def _remove(path: Path) -> None:
    with suppress(OSError):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
