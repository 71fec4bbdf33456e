"""``slideviz info``: the content of a mesh file."""

from __future__ import annotations

import argparse
from pathlib import Path

from slideviz.cli.options import add_shared


def add_info(calls: argparse._SubParsersAction) -> None:
    """Add the command ``info`` to the parser."""
    call = calls.add_parser("info", help="what is in a mesh file")
    call.add_argument("mesh", type=Path)
    add_shared(call, "zone")
    add_shared(call, "json")
    call.set_defaults(command=info)


def info(arguments: argparse.Namespace) -> int:
    """Print the content of a mesh file."""
    from slideviz import quality, read
    from slideviz.cli.exit_codes import DONE
    from slideviz.cli.places import Output, require_places
    from slideviz.cli.report import info_report, save_json, table
    from slideviz.mesh.check import unused_nodes
    from slideviz.mesh.periodic import find_pairs

    require_places(arguments, Output(arguments.json, "--json"))
    mesh = read(arguments.mesh, zone=arguments.zone)
    found = quality(mesh)
    report = info_report(mesh, find_pairs(mesh), len(unused_nodes(mesh)), found)
    if arguments.json:
        text = save_json(arguments.json, report)
        if text is not None:
            print(text, end="")
            return DONE
    zone = f", zone {mesh.zone} of {mesh.zones}" if mesh.zones > 1 else ""
    print(f"{arguments.mesh}: {mesh.dim}D{zone}, {len(mesh.points)} points")
    print(table([(count, name) for name, count in report["cells_by_type"].items()]))
    extents = zip("xyz", report["extents"], strict=False)
    print("  " + ", ".join(f"{axis} {low:.6g} to {high:.6g}" for axis, (low, high) in extents))
    if report["unused_points"]:
        print(f"  {report['unused_points']} points belong to no cell")
    if mesh.halo is not None:
        print(f"  {mesh.halo.describe()}")
    for remark in mesh.remarks:
        print(f"  {remark}")
    print("markers:" if mesh.markers else "no markers")
    if mesh.markers:
        print(table([(m["name"], m["elements"], "elements") for m in report["markers"]]))
    for pair in report["periodic_pairs"]:
        print(f"  {' and '.join(pair['markers'])} match: {pair['type']}, {pair['description']}")
    print(f"quality: min {found.min:.6g}, mean {found.mean:.6g}, {found.inverted} inverted")
    return DONE
