"""Folders and files that only their owner may read."""

from __future__ import annotations

from pathlib import Path


def private_folder(folder: Path) -> Path:
    """Make a folder if there is none, let only its owner enter it, and return it.

    Raises
    ------
    OSError
        It cannot be made, or is somebody else's.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    return folder


def private_file(path: Path) -> None:
    """Make an empty file if there is none, and let only its owner read and write it.

    Raises
    ------
    OSError
        It cannot be made, or is somebody else's.
    """
    path.touch(mode=0o600)
    path.chmod(0o600)
