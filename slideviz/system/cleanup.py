"""Clean-up of what must not outlive the program: drafts of files, and processes it started.

A draft is a temporary file or folder in the folder of the file it is to become. Its name has the
machine and the process that it belongs to. So drafts of a process that was killed are removed by
the next one that writes to the same folder.
"""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import BinaryIO, Protocol

from slideviz.system.platform import is_alive, open_unlinked, process_space, set_mode


def private_folder(folder: Path) -> Path:
    """Make a folder that only its owner may enter, and return it; OSError if it is another's."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    return folder


def private_file(path: Path) -> None:
    """Make an empty file for its owner only; OSError if it is another's, or a link."""
    with open_temporary(path, new=True) as file:
        set_mode(file.fileno(), path, 0o600)


PREFIX = ".slideviz-"  # beginning of the names of all drafts
_SUFFIX = ".tmp"  # ending of the names of all drafts


class Process(Protocol):
    """A running process that this program started, as `subprocess.Popen`."""

    def kill(self) -> None:
        """End it at once."""

    def wait(self) -> int:
        """Return its exit code when it has ended."""


NOTHING_LEFT = "it leaves nothing half-written"
"""The answer of `leftover_message` where no file is kept."""
_drafts: set[Path] = set()  # files and folders to remove when the program ends early
_processes: set[Process] = set()  # processes to kill when the program ends early
starting = Lock()
"""Held while a process is started, whose beginning would fail with a traceback if it were cut off.
"""
_PATIENCE = 2.0  # longest time that an early end waits for it, in seconds
_partial: dict[Path, str] = {}
"""Files that stay then, not yet complete, and the sentence on each for the user."""


@contextmanager
def draft(folder: Path, is_folder: bool = False) -> Iterator[Path]:
    """Context with a new path in a folder for a draft; what is at that path is removed at the end.

    At the beginning, drafts of dead processes of this machine are removed from the folder. Raises
    OSError if the draft is a folder, and cannot be made. ``folder``: where the draft is to be.
    ``is_folder``: whether the draft is a folder, which is made then.
    """
    _sweep(folder)
    path = folder / f"{_owned(os.getpid())}{os.urandom(8).hex()}{_SUFFIX}"
    with removed_at_stop(path):
        try:
            if is_folder:
                path.mkdir(mode=0o700)
            yield path
        finally:
            _remove(path)


def open_temporary(path: Path, *, new: bool = False, brief: bool = False) -> BinaryIO:
    """Return a temporary file, open for reading and writing; never through a symbolic link.

    With ``new`` it is made if there is none, for its owner only. ``brief``: as of `open_unlinked`.
    Raises OSError if it cannot be opened, or is a symbolic link, a device or a pipe.
    """
    try:
        opened = open_unlinked(path, os.O_RDWR | os.O_CREAT * new, brief=brief)
    except OSError as problem:
        if problem.errno != errno.ELOOP:
            raise
        message = f"{path} is a symbolic link, whose target would be overwritten; remove the link"
        raise OSError(errno.EINVAL, message, str(path)) from problem
    if not stat.S_ISREG(os.fstat(opened).st_mode):
        os.close(opened)
        raise OSError(errno.EINVAL, f"{path} is a device or pipe; remove it", str(path))
    return open(opened, "r+b")  # noqa: PTH123


@contextmanager
def killed_at_end(process: Process) -> Iterator[None]:
    """Context at whose end the process is killed, if it still runs, and waited for."""
    _processes.add(process)
    try:
        yield
    finally:
        process.kill()
        process.wait()
        _processes.discard(process)


def clean_up() -> None:
    """Kill the programs that were started and remove all drafts, before the end of the process."""
    starting.acquire(timeout=_PATIENCE)
    for process in list(_processes):
        with suppress(OSError):
            process.kill()
    for path in list(_drafts):
        _remove(path)


@contextmanager
def removed_at_stop(path: Path) -> Iterator[None]:
    """Context in which a file is removed if the program ends."""
    _drafts.add(path)
    try:
        yield
    finally:
        _drafts.discard(path)


def keep_partial(path: Path, words: str) -> None:
    """Say ``words`` on a file that is not yet complete, if the program ends early."""
    _partial[path] = words


def leftover_message() -> str:
    """Return the words of `keep_partial` on the latest file that stays, else `NOTHING_LEFT`."""
    sentences = (words for path, words in reversed(_partial.items()) if path.exists())
    return next(sentences, NOTHING_LEFT)


def _owned(pid: int | str) -> str:
    """Return the prefix of the names of unfinished files of process ``pid`` on this machine."""
    return f"{PREFIX}{process_space()}-{pid}-"


def _sweep(folder: Path) -> None:
    """Remove the drafts of dead processes of this machine, and no others, from a folder."""
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
