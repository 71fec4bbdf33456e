"""``slideviz sample``: writes a sample case, or lists the samples."""

from __future__ import annotations

import argparse
from pathlib import Path

from slideviz.cli.options import add_shared, integer
from slideviz.formats.table import FILE_FORMATS


def add_sample(calls: argparse._SubParsersAction) -> None:
    """Add the command ``sample`` to the parser."""
    call = calls.add_parser("sample", help="write a sample case")
    call.add_argument("name", nargs="?", help="name of the sample; without it, list all")
    call.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder (default: NAME)")
    call.add_argument(
        "--size", type=integer, metavar="N", help="size; the list says what it counts"
    )
    call.add_argument(
        "--format",
        type=str.lower,
        choices=tuple(FILE_FORMATS),
        default="su2",
        help="of the mesh; su2b (binary) for up to 200 million cells (default: su2)",
    )
    call.add_argument("--variant", metavar="NAME", help="other motions; listed without NAME")
    call.add_argument("--force", action="store_true", help="replace files that exist")
    add_shared(call, "quiet")
    call.set_defaults(command=sample)


def sample(arguments: argparse.Namespace) -> int:
    """Write a sample case, or list the samples; return the exit code."""
    from slideviz.cli.report import table
    from slideviz.cli.terminal import DONE
    from slideviz.samples.table import SAMPLES, write_sample

    if arguments.name is None:
        print("samples (slideviz sample NAME -o DIR):")
        print(table([(name, row.words()) for name, row in SAMPLES.items()]))
        print("variants (--variant):")
        print(table([(name, ", ".join(row.variants)) for name, row in SAMPLES.items()]))
        return DONE
    folder = arguments.output or Path(arguments.name)
    paths = write_sample(
        arguments.name, folder, arguments.size, arguments.variant, arguments.force, arguments.format
    )
    if arguments.quiet:
        return DONE
    for path in paths:
        print(path)
    case = next(path for path in paths if path.suffix == ".cfg")
    print(f"now: slideviz run {case}   or: slideviz {case}")
    return DONE
