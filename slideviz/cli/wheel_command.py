"""``slideviz wheel``: writes the whole wheel of a passage, deformed as a case says."""

from __future__ import annotations

from argparse import Namespace

from slideviz import wheel
from slideviz.cli.mesh_source import read_inputs
from slideviz.cli.progress import Bar
from slideviz.cli.report import (
    limit_lines,
    limits_report,
    print_remarks,
    report_limits,
    save_report,
)
from slideviz.cli.terminal import INVERTED
from slideviz.design.deformed_wheel import WheelQuality

MOST_NAMES = 20  # boundaries whose names are all printed


def main(arguments: Namespace) -> int:
    """Write the wheel of a case; return the exit code."""
    case, mesh = read_inputs(arguments, is_mesh=True)
    with Bar(not arguments.quiet, begun=arguments.begun) as bar:
        made = wheel(
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
    report |= {"limits": limits, "warnings": list(made.messages)}
    if save_report(arguments, report):
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
    print_remarks(made.messages, quiet=arguments.quiet)
    code = report_limits(limits)
    return INVERTED if made.inverted else code


def _numbers(made: WheelQuality) -> dict[str, object]:
    """Return the entry of a wheel, or of one zone's wheel, for a report."""
    left = ("path", "limits", "messages", "zones")
    return {name: value for name, value in vars(made).items() if name not in left}


def _passages(made: WheelQuality) -> str:
    """Return the passages of one zone in words."""
    assert made.period is not None
    turn = "a whole turn" if made.is_closed else f"{made.passages * made.period:.6g}°"
    passages = "1 passage" if made.passages == 1 else f"{made.passages} passages"
    return f"{passages} of {made.period:.6g}°, {turn}"
