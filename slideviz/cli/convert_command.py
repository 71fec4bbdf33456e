"""``slideviz convert``: writes a mesh in another format."""

from __future__ import annotations

import argparse
from pathlib import Path

from slideviz.cli.options import add_shared


def add_convert(calls: argparse._SubParsersAction) -> None:
    """Add the command ``convert`` to the parser."""
    call = calls.add_parser("convert", help="write a mesh in another format")
    call.add_argument("mesh", type=Path, help="the mesh to read")
    call.add_argument("output", type=Path, help="the mesh to write; its ending names the format")
    add_shared(call, "zone", help="one zone, from 1 (default: all)")
    call.set_defaults(command=convert)


def convert(arguments: argparse.Namespace) -> int:
    """Write a mesh in another format, and say what the format does not hold."""
    import sys
    from dataclasses import replace

    from slideviz import quality, read
    from slideviz.cli.exit_codes import DONE
    from slideviz.cli.places import Output, require_places, tell_lost
    from slideviz.cli.report import cell_data
    from slideviz.mesh.io.convert import convert as write_converted
    from slideviz.session.formats import holds_quality, left_out

    require_places(arguments, Output(arguments.output, "OUT", is_mesh=True))
    mesh = read(arguments.mesh, zone=arguments.zone)
    binary = arguments.output.suffix.lower() == ".su2b"
    # Without --zone no zone is lost.
    tell_lost(arguments.output, mesh if arguments.zone else replace(mesh, zones=1))
    if not arguments.zone and mesh.origin.ending == ".su2" and binary:
        for zone in range(2, mesh.zones + 1):
            other = read(arguments.mesh, zone=zone)
            tell_lost(arguments.output, replace(other, zones=1, name=f"{mesh.name}, zone {zone}"))
    values = None
    if holds_quality(arguments.output) and (arguments.zone or mesh.zones == 1):
        values = cell_data(arguments.output, quality(mesh))
    write_converted(arguments.mesh, arguments.output, arguments.zone, mesh, values)
    lost = "" if binary else left_out(arguments.output, replace(mesh, zones=1))
    if lost:
        print(f"slideviz: note: {lost}", file=sys.stderr)
    print(arguments.output)
    return DONE
