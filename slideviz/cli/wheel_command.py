"""``slideviz wheel``: writes the whole wheel of a passage, deformed as a case says."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.cli.options import add_changes, add_shared, integer, read_inputs
from slideviz.cli.progress import Bar
from slideviz.cli.terminal import holding

if TYPE_CHECKING:
    from slideviz.design.wheel import Count, WheelQuality

MOST_NAMES = 20  # boundaries whose names are all printed


def add_wheel(calls: argparse._SubParsersAction) -> None:
    """Add the command ``wheel`` to the parser."""
    call = calls.add_parser(
        "wheel",
        help="write the whole wheel of a passage",
        description="Deform a passage as a case says, and write the wheel that its copies make, "
        "turned about the axis and merged at the periodic boundaries. Without motions the "
        "passages are undeformed.",
    )
    add_shared(call, "case")
    call.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="MESH",
        required=True,
        help="the wheel: .su2, or .su2b for large ones",
    )
    call.add_argument(
        "--passages",
        type=passages,
        default="all",
        metavar="N",
        help="their number; all for a whole turn (default); with commas one for each zone",
    )
    call.add_argument(
        "--numbered",
        action="store_true",
        help="boundaries of their own for each passage: blade_1, blade_2",
    )
    call.add_argument(
        "--designs",
        type=Path,
        metavar="TABLE",
        help="motions of passages (CSV, see `slideviz sweep`): one row for each passage from the "
        "first on; the others move as the case says",
    )
    add_changes(call)
    add_shared(call, "json")
    add_shared(call, "zone")
    add_shared(call, "quiet")
    call.set_defaults(command=wheel)


def passages(text: str) -> Count | list[Count]:
    """Return a number of passages, or "all"; with commas one for each zone."""
    words = [word.strip() for word in text.split(",")]
    counts: list[Count] = ["all" if word.lower() == "all" else integer(word) for word in words]
    return counts if len(counts) > 1 else counts[0]


def wheel(arguments: argparse.Namespace) -> int:
    """Write the wheel of a case; return the exit code."""
    with holding() as arguments.begun:
        return _wheel(arguments)


def _wheel(arguments: argparse.Namespace) -> int:
    from slideviz import wheel as wheel_of
    from slideviz.cli.report import limit_lines, limits_report, print_remarks, save_json
    from slideviz.cli.run_outcome import report_limits
    from slideviz.cli.terminal import INVERTED

    case, mesh = read_inputs(arguments, is_mesh=True)
    with Bar(not arguments.quiet, begun=arguments.begun) as bar:
        made = wheel_of(
            arguments.output,
            case,
            mesh,
            passages=arguments.passages,
            numbered=arguments.numbered,
            designs=arguments.designs,
            progress=bar,
        )
    limits = limits_report(made.limits)
    several = {"zones": [_numbers(zone) for zone in made.zones]} if made.zones else {}
    report = {"path": str(made.path)} | _numbers(made) | several
    report |= {"limits": limits, "warnings": list(made.warnings)}
    if not save_json(arguments.json, report) and not arguments.quiet:
        if made.zones:
            print(f"{made.path}:")
            for number, zone in enumerate(made.zones, 1):
                print(f"  zone {number}: {_passages(zone)}, {zone.cells:,} cells")
        else:
            print(f"{made.path}: {_passages(made)}")
        print(f"  {made.cells:,} cells   {made.points:,} points")
        unproven = f", {made.unproven} unproven" if made.unproven else ""
        quality = f"lowest {made.min:.6f}, mean {made.mean:.6f}, {made.inverted} inverted{unproven}"
        print(f"  quality: {quality}")
        names = made.boundaries
        few = names if len(names) <= MOST_NAMES else (names[0], "…", names[-1])
        print(f"  {len(names)} boundaries: {', '.join(few)}")
        if limits:
            print(f"limits:\n{limit_lines(limits)}")
    print_remarks(made.warnings, quiet=arguments.quiet)
    code = report_limits(limits)
    return INVERTED if made.inverted else code


def _numbers(made: WheelQuality) -> dict[str, object]:
    """Return the entry of a wheel, or of one zone's wheel, for a report."""
    left = ("path", "limits", "warnings", "zones")
    return {name: value for name, value in vars(made).items() if name not in left}


def _passages(made: WheelQuality) -> str:
    """Return the passages of one zone in words."""
    assert made.period is not None
    turn = "a whole turn" if made.is_closed else f"{made.passages * made.period:.6g}°"
    passages = "1 passage" if made.passages == 1 else f"{made.passages} passages"
    return f"{passages} of {made.period:.6g}°, {turn}"
