"""``slideviz [FILE]`` opens the window; ``slideviz shots`` draws it in typical states."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def window(arguments: argparse.Namespace) -> int:
    """Open the window, with a file if one is given; return the exit code."""
    from slideviz.case.words import nearest
    from slideviz.errors import CaseError
    from slideviz.export.offscreen import missing_screen

    if arguments.file is not None and not arguments.file.exists():
        raise CaseError(
            f"{arguments.file}: there is no such file, and no such command "
            f"(commands: {', '.join(arguments.commands)})"
            f"{nearest(str(arguments.file), arguments.commands)}"
        )
    why = missing_screen() if sys.platform.startswith("linux") else ""
    if why:
        raise CaseError(f"there is no screen ({why}); `slideviz run CASE` works without one")
    from slideviz.gui.app import launch

    return launch(arguments.file, run=arguments.run)


def add_shots(calls: argparse._SubParsersAction) -> None:
    """Add the command ``shots`` to the parser."""
    call = calls.add_parser(
        "shots",
        help="for developers: draw the README's pictures of the window again",
        description="Draw the window in typical states, as the README of slideviz shows it.",
    )
    call.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder (in a checkout: screenshots)"
    )
    call.set_defaults(command=shots, wrong_usage=call.error)


def shots(arguments: argparse.Namespace) -> int:
    """Draw the window in typical states as pictures; return the exit code."""
    from slideviz.cli.exit_codes import DONE
    from slideviz.gui.shots import shots as draw

    folder = arguments.output
    if folder is None:
        if not _is_checkout(Path.cwd()):
            arguments.wrong_usage(
                "this folder is no checkout of slideviz, whose screenshots/ are drawn again; "
                "name another folder with -o DIR"
            )
        folder = Path("screenshots")
    print(f"drawing into {folder}/; pictures of the same names there are replaced", flush=True)
    for path in draw(folder):
        print(path)
    return DONE


def _is_checkout(folder: Path) -> bool:
    """Return whether a folder has slideviz's own sources, and so the pictures of its README."""
    try:
        return 'name = "slideviz"' in (folder / "pyproject.toml").read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False
