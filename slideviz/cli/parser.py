"""What the command line accepts."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from slideviz import __version__
from slideviz.cli import commands
from slideviz.cli.compare_command import add_compare
from slideviz.cli.film_command import add_film, add_zoom, size
from slideviz.cli.reference import add_reference
from slideviz.cli.section_options import add_section, glued
from slideviz.terms import METRICS

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
    if not any(word in commands.COMMANDS for word in argv[:1]) and not _asks_help(argv):
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
    parser = _base(usage="slideviz [FILE] | slideviz {%s} ..." % ",".join(commands.COMMANDS))  # noqa: UP031
    parser.add_argument("--version", action="version", version=f"slideviz {__version__}")
    parser.add_argument("file", nargs="?", type=Path, help="mesh or case (.cfg) to open")
    parser.add_argument("--run", action="store_true", help="deform the case at once")
    # Quiet on the terminal: the window itself shows when it compiles.
    parser.set_defaults(command=commands.window, quiet=True)
    return parser


def _parser() -> argparse.ArgumentParser:
    parser = _base()
    parser.add_argument("--version", action="version", version=f"slideviz {__version__}")
    calls = parser.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=_Parser
    )
    _add_run(calls)
    _add_info(calls)
    _add_quality(calls)
    add_film(calls)
    add_section(calls)
    add_compare(calls)
    _add_sample(calls)
    keys = calls.add_parser("keys", help="reference of all case keys")
    keys.set_defaults(command=commands.keys)
    shots = calls.add_parser(
        "shots",
        help="for developers: draw the README's pictures of the window again",
        description="Draw the window in typical states, as the README of slideviz shows it.",
    )
    shots.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder (in a checkout: screenshots)"
    )
    shots.set_defaults(command=commands.shots, wrong_usage=shots.error)
    return parser


def _add_run(calls: argparse._SubParsersAction) -> None:
    run = calls.add_parser("run", help="deform a mesh as a case file says")
    run.add_argument("case", type=Path, help="the case file (.cfg)")
    run.add_argument("-o", "--output", type=Path, metavar="MESH", help="deformed mesh to write")
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a key of the case for this run; may be repeated",
    )
    run.add_argument(
        "--steps", dest="step_count", metavar="N", help="number of steps, or auto (--set STEPS=N)"
    )
    run.add_argument("--json", type=Path, metavar="FILE", help="report as JSON; - is the terminal")
    run.add_argument(
        "--history", type=Path, metavar="FILE", help="convergence of the data reduction (CSV)"
    )
    run.add_argument("--steps-dir", type=Path, metavar="DIR", help="write the mesh of every step")
    run.add_argument("--picture", type=Path, metavar="FILE", help="picture of the quality (PNG)")
    run.add_argument("--picture-size", type=size, metavar="WxH", help="pixels (1600x1000)")
    add_zoom(run)
    run.add_argument("--zone", type=int, metavar="N", help="zone of the mesh file, from 1")
    run.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")
    run.add_argument("--force", action="store_true", help="allow writing over the input mesh")
    run.set_defaults(command=commands.run)


def _add_info(calls: argparse._SubParsersAction) -> None:
    info = calls.add_parser("info", help="what is in a mesh file")
    info.add_argument("mesh", type=Path)
    info.add_argument("--zone", type=int, metavar="N", help="zone of the mesh file, from 1")
    info.add_argument("--json", type=Path, metavar="FILE", help="as JSON; - is the terminal")
    info.set_defaults(command=commands.info)


def _add_quality(calls: argparse._SubParsersAction) -> None:
    quality = calls.add_parser("quality", help="size-skew quality of a mesh")
    quality.add_argument("mesh", type=Path)
    add_reference(quality, "case that made it: its MESH_FILENAME is the reference")
    quality.add_argument(
        "--metric",
        choices=tuple(METRICS),
        default="knupp",
        help="rbf-slide: hexahedra as that program rates them (default: knupp)",
    )
    quality.add_argument("--zone", type=int, metavar="N", help="zone of the mesh file, from 1")
    quality.add_argument("--json", type=Path, metavar="FILE", help="as JSON; - is the terminal")
    quality.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="mesh with quality (.vtu), or .csv"
    )
    quality.set_defaults(command=commands.quality)


def _add_sample(calls: argparse._SubParsersAction) -> None:
    sample = calls.add_parser("sample", help="write a sample case")
    sample.add_argument("name", nargs="?", help="which one; none: list them")
    sample.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder (default: NAME)")
    sample.add_argument("--size", type=int, metavar="N", help="size; what it counts is in the list")
    sample.add_argument("--variant", metavar="NAME", help="other motions; listed without NAME")
    sample.add_argument("--force", action="store_true", help="replace files that exist")
    sample.set_defaults(command=commands.sample)
