"""Parses the command line: by a parser for each command of ``COMMANDS``, and one for the window."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from slideviz import __version__
from slideviz.cli import command_parsers
from slideviz.cli.section_options import glued
from slideviz.errors import CaseError, nearest


def window(arguments: argparse.Namespace) -> int:
    """Open the window, with a file if one is given; return the exit code."""
    # Late: VTK takes 0.6 s.
    from slideviz.export.offscreen import display_fault

    if arguments.file is not None and not arguments.file.exists():
        raise CaseError(
            f"{arguments.file}: there is no such file or command (commands: "
            f"{', '.join(arguments.commands)}){nearest(str(arguments.file), arguments.commands)}"
        )
    why = display_fault() if sys.platform.startswith("linux") else ""
    if why:
        raise CaseError(f"there is no screen ({why}); `slideviz run CASE` works without one")
    # Late: the window takes 2 s.
    from slideviz.gui.app import launch

    return launch(arguments.file, run=arguments.run)


COMMANDS = {
    "run": "run_command.run",
    "info": "info_command.info",
    "quality": "quality_command.quality",
    "repair": "repair_command.repair",
    "film": "film_command.film",
    "section": "section_command.section",
    "gap": "gap_command.gap",
    "compare": "compare_command.compare",
    "sweep": "sweep_command.sweep",
    "convert": "convert_command.convert",
    "wheel": "wheel_command.wheel",
    "def": "def_command.run_def",
    "dot": "dot_command.run_dot",
    "sample": "sample_command.sample",
    "keys": "keys_command.keys",
}
"""Where the function of each command is, in the order of the help; ``add_NAME`` adds its parser."""

_DESCRIPTION = """\
Deform CFD meshes with radial basis functions.

  slideviz                    open the window
  slideviz FILE               open the window with a mesh or a case (.cfg)
  slideviz COMMAND ...        without a window; see `slideviz COMMAND --help`
"""

_EPILOG = """\
exit codes: 0 done; 1 the mesh or case is wrong; 2 wrong usage; 3 done, but cells are inverted;
4 done, but a limit of the case is not met; 130 cancelled; 143 ended by SIGTERM.

a first try:  slideviz sample passage -o try && slideviz run try/passage.cfg
"""


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Return the arguments, with ``command`` the function to call; or raise SystemExit."""
    if not any(word in (*COMMANDS, "-h", "--help", "help") for word in argv[:1]):
        parser = _window_parser()
        if argv[1:] and not argv[0].startswith("-") and not Path(argv[0]).exists():
            meant = nearest(argv[0], COMMANDS)
            parser.error(f"there is no command or file {argv[0]!r}{meant}")
        return parser.parse_args(argv)
    called = argv[:1] if argv[0] in COMMANDS else COMMANDS
    return _parser(called).parse_args(glued(argv))


def _command(place: str, arguments: argparse.Namespace) -> int:
    """Run the command at a place, whose module is loaded only now; return the exit code."""
    module, _, function = place.partition(".")
    return int(getattr(import_module(f"slideviz.cli.{module}"), function)(arguments))


class _Parser(argparse.ArgumentParser):
    """A parser that accepts options in full only: ``--steps`` is not short for ``--steps-dir``."""

    def __init__(self, **options: object) -> None:
        super().__init__(allow_abbrev=False, **options)  # type: ignore[arg-type]

    def parse_known_args(self, *given: Any, **named: Any) -> Any:
        """Return the arguments and no others, which end the command with a message."""
        found, others = super().parse_known_args(*given, **named)
        if others:
            options = [flag for flag in self._option_string_actions if flag.startswith("--")]
            asked = [word.partition("=")[0] for word in others if word.startswith("-")]
            meant = nearest(asked[0], options) if asked else ""
            self.error(f"unrecognized arguments: {' '.join(others)}{meant}")
        return found, others

    def error(self, message: str) -> NoReturn:
        """Exit with code 2 and one sentence, without the list of options."""
        self.exit(2, f"{self.prog}: {message}; see `{self.prog} --help`\n")


def _base(**options: object) -> _Parser:
    return _Parser(
        prog="slideviz",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        **options,
    )


def _window_parser() -> argparse.ArgumentParser:

    parser = _base(usage="slideviz [FILE] | slideviz {%s} ..." % ",".join(COMMANDS))  # noqa: UP031
    parser.add_argument("--version", action="version", version=f"slideviz {__version__}")
    parser.add_argument("file", nargs="?", type=Path, help="mesh or case (.cfg) to open")
    parser.add_argument("--run", action="store_true", help="deform the case at once")
    # Quiet on the terminal: the window itself shows when it compiles.
    parser.set_defaults(command=window, commands=tuple(COMMANDS), quiet=True)
    return parser


def _parser(names: Iterable[str]) -> argparse.ArgumentParser:
    parser = _base()
    parser.add_argument("--version", action="version", version=f"slideviz {__version__}")
    calls = parser.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=_Parser
    )
    for name in names:
        getattr(command_parsers, f"add_{name}")(calls)
        calls.choices[name].set_defaults(command=partial(_command, COMMANDS[name]))
    return parser
