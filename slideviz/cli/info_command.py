"""``slideviz info``: the content of a mesh file."""

from __future__ import annotations

from argparse import Namespace

from slideviz.cli.mesh_source import open_mesh
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.report import info_report, save_report, table, zone_words
from slideviz.cli.terminal import DONE
from slideviz.errors import MeshError
from slideviz.ffd.box import Box
from slideviz.ffd.section import boxes_of
from slideviz.mesh.model import Mesh
from slideviz.mesh.periodic import find_pairs
from slideviz.mesh.polyhedra import parts_words
from slideviz.mesh.quality import Quality
from slideviz.mesh.zones import marker_zones
from slideviz.streaming.block_quality import CellCounts


def main(arguments: Namespace) -> int:
    """Print what is in a mesh file, or write it as JSON; return the exit code."""
    require_output_paths(arguments, OutputPath(arguments.json, "--json"))
    with open_mesh(arguments) as opened:
        counts = CellCounts(opened.source)
        measured = opened.quality(arguments, counts)
        return _report(arguments, opened.source.mesh, counts, measured)


def _report(arguments: Namespace, mesh: Mesh, counts: CellCounts, found: Quality) -> int:
    """Print or write what is in a mesh, and return the exit code.

    ``mesh``: the mesh, or only its skin. ``counts`` and ``found``: counts and quality of the whole
    mesh.
    """
    report = info_report(mesh, find_pairs(mesh), counts, found)
    boxes, fault = _boxes(mesh)
    if boxes:
        report["ffd_boxes"] = [
            {
                "name": box.name,
                "degrees": [box.degrees[axis] for axis in box.axes(mesh.dim)],
                "orders": box.orders and [box.orders[axis] for axis in box.axes(mesh.dim)],
            }
            for box in boxes
        ]
    if fault:
        report["ffd_fault"] = fault
    if mesh.interfaces:
        report["interfaces"] = [
            {"marker": i.marker, "zone": i.zone, "other": i.other, "nodes": len(i.nodes)}
            for i in mesh.interfaces
        ]
    if not save_report(arguments, report):
        return DONE
    zone = zone_words(mesh.zone, mesh.zones)
    print(f"{arguments.mesh}: {mesh.dim}D{zone}, {counts.points} points")
    print(table([(count, name) for name, count in report["cells_by_type"].items()]))
    extents = zip("xyz", report["extents"], strict=False)
    print("  " + ", ".join(f"{axis} {low:.6g} to {high:.6g}" for axis, (low, high) in extents))
    if report["unused_points"]:
        print(f"  {report['unused_points']} points belong to no cell")
    if words := parts_words(mesh.whole_cells):
        print(f"  {words}")
    if mesh.halo is not None:
        print(f"  {mesh.halo.describe()}")
    for remark in mesh.remarks:
        print(f"  {remark}")
    print("markers:" if mesh.markers else "no markers")
    several = len(mesh.parts) > 1
    if mesh.markers:
        rows = [(m["name"], m["elements"], "elements") for m in report["markers"]]
        zones = [f"zone {zone}" for zone in marker_zones(mesh)]
        more = [(*row, zone) for row, zone in zip(rows, zones, strict=True)]
        print(table(more if several else rows))
    zone_of = dict(zip(mesh.marker_names, marker_zones(mesh), strict=True))
    for interface in mesh.interfaces:
        if several and zone_of[interface.marker] > interface.zone:
            continue  # the same, seen from the other zone
        print(f"  {interface.marker} is {interface.describe()}")
    for pair in report["periodic_pairs"]:
        print(f"  {' and '.join(pair['markers'])} match: {pair['type']}, {pair['description']}")
    if boxes:
        print("FFD boxes:")
        print(table([(box.name, box.describe(mesh.dim)) for box in boxes]))
    if fault:
        print(f"FFD boxes: {fault}")
    print(f"quality: min {found.min:.6g}, mean {found.mean:.6g}, {found.inverted} inverted")
    return DONE


def _boxes(mesh: Mesh) -> tuple[tuple[Box, ...], str]:
    """Return the FFD boxes of a mesh, and what is wrong with them, or ""."""
    try:
        return boxes_of(mesh), ""
    except MeshError as problem:
        return (), str(problem)
