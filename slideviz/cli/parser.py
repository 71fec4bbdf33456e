"""Parses the command line: by a parser for each command of ``COMMANDS``, and one for the window."""

from __future__ import annotations

from argparse import ArgumentParser, HelpFormatter, Namespace, RawDescriptionHelpFormatter
from collections.abc import Iterable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from slideviz import __version__
from slideviz.cli.argument_readers import glued
from slideviz.cli.commands import COMMANDS, add_arguments
from slideviz.errors import CaseError, nearest
from slideviz.formats.openfoam_paths import mesh_path
from slideviz.system.missing_libraries import apt_install, missing_for_window

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

_USUAL: dict[str, Any] = {
    **dict.fromkeys(("history", "picture", "reference", "step_count", "steps_dir", "steps_file")),
    "metric": "knupp",
    "metrics": (),
    "quiet": False,
}
"""The values of arguments that a command does not have."""


def parse(argv: Sequence[str]) -> Namespace:
    """Return the arguments, with ``command`` the function to call; or raise SystemExit."""
    if not any(word in (*COMMANDS, "-h", "--help", "help") for word in argv[:1]):
        parser = _window_parser()
        if argv[1:] and not argv[0].startswith("-") and not Path(argv[0]).exists():
            meant = nearest(argv[0], COMMANDS)
            parser.error(f"there is no command or file {argv[0]!r}{meant}")
        return _placed(parser.parse_args(argv))
    called = argv[:1] if argv[0] in COMMANDS else COMMANDS
    return _placed(command_parser(called).parse_args(glued(argv)))


def _placed(arguments: Namespace) -> Namespace:
    """Return arguments with the file of an OpenFOAM mesh for a folder that stands for it."""
    for name in ("file", "mesh", "reference"):
        if isinstance(path := getattr(arguments, name, None), Path):
            setattr(arguments, name, mesh_path(path))
    return arguments


class _Parser(ArgumentParser):
    """A parser that accepts options in full only: ``--steps`` is not short for ``--steps-dir``."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)
        self.set_defaults(**_USUAL)

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


def _base(**options: Any) -> _Parser:
    parser = _Parser(
        prog="slideviz",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=RawDescriptionHelpFormatter,
        **options,
    )
    parser.add_argument("--version", action="version", version=f"slideviz {__version__}")
    return parser


def _window_parser() -> ArgumentParser:
    parser = _base(usage="slideviz [FILE] | slideviz {%s} ..." % ",".join(COMMANDS))  # noqa: UP031
    parser.add_argument(
        "file", nargs="?", type=Path, help="mesh, case (.cfg) or session (.slideviz) to open"
    )
    parser.add_argument("--run", action="store_true", help="deform the case at once")
    # Quiet on the terminal: the window itself shows when it compiles.
    parser.set_defaults(command=_window, holds=False, quiet=True)
    return parser


def _window(arguments: Namespace) -> int:
    """Open the window, with a file if one is given; return the exit code."""
    # Late: VTK takes 0.6 s.
    from slideviz.export.offscreen import display_fault

    if arguments.file is not None and not arguments.file.exists():
        raise CaseError(
            f"{arguments.file}: there is no such file or command (commands: "
            f"{', '.join(COMMANDS)}){nearest(str(arguments.file), COMMANDS)}"
        )
    why = display_fault()
    if why:
        raise CaseError(f"there is no screen ({why}); `slideviz run CASE` works without one")
    if packages := missing_for_window():
        raise CaseError(
            "the window needs libraries of the system that are not installed; on Debian or Ubuntu "
            f"use `{apt_install(packages)}`"
        )
    # Late: the window takes 2 s.
    from slideviz.gui.app import launch

    return launch(arguments.file, run=arguments.run)


def _command(name: str, arguments: Namespace) -> int:
    """Run a command, whose module is loaded only now; return the exit code."""
    return int(import_module(f"slideviz.cli.{name}_command").main(arguments))


def command_parser(names: Iterable[str]) -> ArgumentParser:
    """Return a parser of some commands."""
    parser = _base()
    calls = parser.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=_Parser
    )
    for name in names:
        row = COMMANDS[name]
        call = calls.add_parser(
            name,
            help=row.help,
            description=row.description,
            epilog=row.examples or row.epilog,
            formatter_class=RawDescriptionHelpFormatter if row.examples else HelpFormatter,
        )
        add_arguments(call, row.arguments)
        run = partial(_command, name)
        call.set_defaults(command=run, holds=row.holds, wrong_usage=call.error)
        if not row.compiles:
            call.set_defaults(quiet=True)
    return parser
