"""Arguments that several commands share, and the values that their texts mean."""

from __future__ import annotations

import argparse
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from slideviz.errors import CaseError, not_one_of
from slideviz.terms import NO_REFERENCE, RATED, Quantity, field_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from slideviz.scene.overview import Zoom

Read = TypeVar("Read")

REMEDY = "give --reference UNDEFORMED"  # the advice after that remark


def add_reference(call: argparse.ArgumentParser, case_help: str) -> None:
    """Add the options ``--reference`` and ``--case``."""
    call.add_argument(
        "--reference",
        type=Path,
        metavar="UNDEFORMED",
        help="mesh to compare with; without it only the shape of cells is measured",
    )
    call.add_argument("--case", type=Path, metavar="CASE", help=case_help)


def reference_words(reference: Path | None) -> str:
    """Return the line on the undeformed mesh that the quality refers to, or that there is none."""
    return f"{NO_REFERENCE}; {REMEDY}" if reference is None else f"reference: {reference}"


def metric_names(text: str) -> tuple[Quantity, ...]:
    """Return metrics and numbers of walls of a text: "all", or names with commas, with - or _."""
    fields = {field_of(name): name for name in RATED}
    wanted = [field_of(word.strip().lower()) for word in text.split(",")]
    if wanted == ["all"]:
        return tuple(RATED)
    for word in wanted:
        if word not in fields:
            raise argparse.ArgumentTypeError(not_one_of(word, ("all", *fields)))
    return tuple(fields[word] for word in wanted)


SHARED: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "case": (("case",), {"type": Path, "help": "the case file (.cfg)"}),
    "zone": (("--zone",), {"type": int, "metavar": "N", "help": "zone of the mesh file, from 1"}),
    "quiet": (
        ("-q", "--quiet"),
        {"action": "store_true", "help": "print nothing but warnings and errors"},
    ),
    "json": (
        ("--json",),
        {"type": Path, "metavar": "FILE", "help": "report as JSON; - is the terminal"},
    ),
    "metrics": (
        ("--metrics",),
        {
            "type": metric_names,
            "default": (),
            "metavar": "NAMES",
            "help": "other numbers too, also in a .vtu, .vtkhdf or .csv file: all, or names with "
            "commas, e.g. skewness,expansion,growth",
        },
    ),
    "force": (
        ("--force",),
        {"action": "store_true", "help": "allow writing over the input mesh"},
    ),
    "stream": (
        ("--stream",),
        {"action": "store_true", "help": "for meshes larger than memory (SU2)"},
    ),
    "set": (
        ("--set",),
        {
            "action": "append",
            "default": [],
            "metavar": "KEY=VALUE",
            "help": "change a key of the case; may be repeated; paths are relative to the current "
            "folder",
        },
    ),
}
"""Arguments that several commands have, by name: flags and keywords for ``add_argument``."""


def add_shared(call: argparse.ArgumentParser, *names: str, **other: Any) -> None:
    """Add arguments of `SHARED`; ``other`` replaces some of their keywords."""
    for name in names:
        flags, usual = SHARED[name]
        call.add_argument(*flags, **usual | other)


def add_changes(call: argparse.ArgumentParser) -> None:
    """Add the options ``--set`` and ``--steps``, which change the case for one run."""
    add_shared(
        call,
        "set",
        help="change a key of the case for this run; may be repeated; paths "
        "are relative to the current folder",
    )
    call.add_argument(
        "--steps", dest="step_count", metavar="N", help="number of steps, or auto (--set STEPS=N)"
    )


def add_zoom(call: argparse.ArgumentParser) -> None:
    """Add the option ``--zoom`` of pictures and films."""
    call.add_argument(
        "--zoom",
        type=zoom,
        default="auto",
        metavar="X,Y[,Z],WIDTH",
        help="center and width of the picture; `all` is the whole mesh, as is `auto` (default), "
        "unless the moving body is tiny in it",
    )


def zoom(text: str) -> Zoom:
    """Return the detail for ``X,Y,WIDTH`` or ``X,Y,Z,WIDTH``; ``auto`` and ``all`` as they are."""
    if text == "auto":
        return "auto"
    if text == "all":
        return "all"
    # Late: NumPy takes 0.1 s, and help does not need it.
    from slideviz.scene.overview import Detail

    try:
        *centre, width = map(float, text.split(","))
    except ValueError:
        centre = []
        width = 0.0
    if len(centre) not in (2, 3) or not (all(map(isfinite, centre)) and 0.0 < width < inf):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither X,Y,WIDTH (X,Y,Z,WIDTH in 3D; WIDTH above 0) nor `all` nor `auto`"
        )
    return Detail(tuple(centre), width)


def checked(read: Callable[[str], Read]) -> Callable[[str], Read]:
    """Return the type of an argument that ``read`` reads: its CaseError means wrong usage."""

    def argument(text: str) -> Read:
        try:
            return read(text)
        except CaseError as problem:
            raise argparse.ArgumentTypeError("; ".join(map(str, problem.messages))) from None

    return argument


def integer(text: str) -> int:
    """Parse a whole number, written like ``20000`` or ``1e8``."""
    try:
        number = float(text)
    except ValueError:
        number = 0.5
    if not number.is_integer():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number; write e.g. 20000 or 1e8")
    return int(text) if text.strip().lstrip("+-").isdigit() else int(number)


def size(text: str) -> tuple[int, int]:
    """Return width and height of a text like ``1280x800``."""
    width, sign, height = text.lower().partition("x")
    if not (sign and width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not of the form WIDTHxHEIGHT; write e.g. 1280x800"
        )
    return int(width), int(height)
