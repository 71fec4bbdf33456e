"""``slideviz sample``: writes a sample case, or lists the samples."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from slideviz.cli.report import table
from slideviz.cli.terminal import DONE
from slideviz.samples.table import SAMPLES, write_sample


def main(arguments: Namespace) -> int:
    """Write a sample case, or list the samples; return the exit code."""
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
