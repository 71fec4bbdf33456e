"""Folders and files that only their owner may read."""

from __future__ import annotations

from pathlib import Path


def private_folder(folder: Path) -> Path:
    """Return a folder that only its owner may enter; it is made where there is none.

    Raises
    ------
    OSError
        It cannot be made, or is somebody else's.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    return folder


def private_file(path: Path) -> None:
    """Let only the owner read and write a file; it is made, empty, where there is none.

    Raises
    ------
    OSError
        It cannot be made, or is somebody else's.
    """
    path.touch(mode=0o600)
    path.chmod(0o600)
