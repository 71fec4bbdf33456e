"""Folders and files that only their owner may read."""

from __future__ import annotations

import os
from pathlib import Path

from slideviz.system.cleanup import open_temporary


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
        It cannot be made, is somebody else's, or a symbolic link.
    """
    with open_temporary(path, new=True) as file:
        os.fchmod(file.fileno(), 0o600)
