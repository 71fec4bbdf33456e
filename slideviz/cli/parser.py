"""The arguments of the command line: a row of ``COMMANDS`` for each command, and the window's."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from slideviz import __version__
from slideviz.cli.compare_command import add_compare
from slideviz.cli.convert_command import add_convert
from slideviz.cli.def_command import add_def
from slideviz.cli.dot_command import add_dot
from slideviz.cli.film_command import add_film
from slideviz.cli.info_command import add_info
from slideviz.cli.keys_command import add_keys
from slideviz.cli.quality_command import add_quality
from slideviz.cli.run_command import add_run
from slideviz.cli.sample_command import add_sample
from slideviz.cli.section_command import add_section
from slideviz.cli.section_options import glued
from slideviz.cli.sweep_command import add_sweep
from slideviz.cli.window_command import add_shots, window

COMMANDS: dict[str, Callable[[argparse._SubParsersAction], None]] = {
    "run": add_run,
    "info": add_info,
    "quality": add_quality,
    "film": add_film,
    "section": add_section,
    "compare": add_compare,
    "sweep": add_sweep,
    "convert": add_convert,
    "def": add_def,
    "dot": add_dot,
    "sample": add_sample,
    "keys": add_keys,
    "shots": add_shots,
}
"""What adds the arguments of each command, in the order of the help."""

_DESCRIPTION = """\
Deform CFD meshes with radial basis functions.

  slideviz                    open the window
  slideviz FILE               open the window with a mesh or a case (.cfg)
  slideviz COMMAND ...        without a window; see `slideviz COMMAND --help`
"""

_EPILOG = """\
exit codes: 0 done; 1 the mesh or case is wrong; 2 wrong usage; 3 done, but cells are inverted;
130 cancelled; 143 ended by SIGTERM.

a first try:  slideviz sample passage -o try && slideviz run try/passage.cfg
"""


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Return the arguments, with ``command`` set to the function to call.

    Raises
    ------
    SystemExit
        Wrong usage (code 2), or help was asked for (code 0).
    """
    if not any(word in COMMANDS for word in argv[:1]) and not _asks_help(argv):
        return _window_parser().parse_args(argv)
    return _parser().parse_args(glued(argv))


def _asks_help(argv: Sequence[str]) -> bool:
    return bool(argv) and argv[0] in ("-h", "--help", "help")


class _Parser(argparse.ArgumentParser):
    """A parser whose options are written in full: ``--steps`` is not ``--steps-dir``."""

    def __init__(self, **options: object) -> None:
        super().__init__(allow_abbrev=False, **options)  # type: ignore[arg-type]

    def error(self, message: str) -> NoReturn:
        """Leave with code 2 and a sentence, instead of all options."""
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


def _parser() -> argparse.ArgumentParser:
    parser = _base()
    parser.add_argument("--version", action="version", version=f"slideviz {__version__}")
    calls = parser.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=_Parser
    )
    for add in COMMANDS.values():
        add(calls)
    return parser
