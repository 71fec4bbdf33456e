"""``slideviz [FILE]`` opens the window."""

from __future__ import annotations

import argparse
import sys


def window(arguments: argparse.Namespace) -> int:
    """Open the window, with a file if one is given; return the exit code."""
    from slideviz.errors import CaseError, nearest
    from slideviz.export.offscreen import display_fault

    if arguments.file is not None and not arguments.file.exists():
        raise CaseError(
            f"{arguments.file}: there is no such file, and no such command "
            f"(commands: {', '.join(arguments.commands)})"
            f"{nearest(str(arguments.file), arguments.commands)}"
        )
    why = display_fault() if sys.platform.startswith("linux") else ""
    if why:
        raise CaseError(f"there is no screen ({why}); `slideviz run CASE` works without one")
    from slideviz.gui.app import launch

    return launch(arguments.file, run=arguments.run)
