"""``slideviz quality``: the size-skew quality of a mesh."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.cli.options import add_reference, add_shared, optional_case, reference_words
from slideviz.formats.table import own_endings
from slideviz.terms import SKEW_METRICS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from slideviz.case.limits import Limit, MeasuredMesh
    from slideviz.case.model import Case
    from slideviz.mesh.metrics import MetricValues
    from slideviz.mesh.model import Mesh
    from slideviz.mesh.quality import Quality
    from slideviz.terms import Metric


def add_quality(calls: argparse._SubParsersAction) -> None:
    """Add the command ``quality`` to the parser."""
    call = calls.add_parser("quality", help="size-skew quality of a mesh")
    call.add_argument("mesh", type=Path)
    add_reference(call, "case that made it: its MESH_FILENAME is the reference")
    call.add_argument(
        "--metric",
        choices=tuple(SKEW_METRICS),
        default="knupp",
        help="rbf-slide: hexahedra as that program measures them (default: knupp)",
    )
    call.add_argument(
        "--limits",
        type=limits,
        default=(),
        metavar="LIMITS",
        help='limits as of the key LIMITS, as "min > 0.3, inverted = 0": exit code 4 if one is '
        "not met",
    )
    add_shared(call, "metrics")
    add_shared(call, "zone")
    add_shared(call, "json")
    call.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help=f"mesh with quality ({own_endings('quality')}), or .csv",
    )
    add_shared(call, "stream")
    call.set_defaults(command=quality)


def limits(text: str) -> tuple[Limit, ...]:
    """Return the limits of a text."""
    from slideviz.case.limits import read_limits
    from slideviz.errors import CaseError

    try:
        return read_limits(text)
    except CaseError as problem:
        raise argparse.ArgumentTypeError("; ".join(str(problem).splitlines())) from None


def quality(arguments: argparse.Namespace) -> int:
    """Print or write the quality of a mesh, relative to the undeformed one if it is given.

    Returns the exit code.
    """
    from slideviz import metrics, write
    from slideviz.case.limits import MeasuredMesh, require_streamed
    from slideviz.cli.mesh_source import open_mesh
    from slideviz.cli.output_paths import OutputPath, require_output_paths
    from slideviz.cli.report import WORST
    from slideviz.errors import CaseError
    from slideviz.formats.files import quality_data

    output = arguments.output
    if arguments.stream and output is not None:
        raise CaseError("-o needs the mesh in memory; leave it out, or --stream")
    if arguments.stream and arguments.metrics:
        raise CaseError("--metrics needs the mesh in memory; leave it out, or --stream")
    if arguments.stream:
        require_streamed(arguments.limits)
    is_table = output is not None and output.suffix.lower() == ".csv"
    case = optional_case(arguments)
    require_output_paths(
        arguments,
        OutputPath(output, "-o", is_mesh=not is_table),
        OutputPath(arguments.json, "--json"),
    )
    with open_mesh(arguments, case) as opened:
        mesh, found = opened.source.mesh, opened.quality(arguments)
        if is_table:
            extra = metrics(mesh, arguments.metrics, opened.read_base())
            _write_csv(output, found, extra)
        elif output:
            write(output, mesh, cell_data=quality_data(output, found))
        worst = found.worst(WORST)
        rows = list(zip(worst.tolist(), opened.source.types(worst).tolist(), strict=True))
        base = opened.read_base()
        names = case.walls(mesh.marker_names) if case else None
        measured, layers = MeasuredMesh(found, mesh, base, names), _walls(mesh, base, case)
        return _report(arguments, mesh.name, measured, rows, opened.reference, layers)


def _report(
    arguments: argparse.Namespace,
    name: str,
    measured: MeasuredMesh,
    worst: Sequence[tuple[int, int]],
    reference: Path | None,
    walls: dict[str, dict],
) -> int:
    """Print the quality of a mesh or write it as JSON, and return the exit code.

    ``worst`` are numbers and VTK types of the worst cells, ``reference`` is the undeformed mesh,
    ``walls`` a summary of `Walls`.
    """
    from slideviz.case.limits import check_limits
    from slideviz.cli.report import (
        histogram_lines,
        limit_lines,
        limits_report,
        metric_lines,
        metrics_report,
        quality_lines,
        quality_report,
        save_json,
        table,
        wall_lines,
    )
    from slideviz.cli.run_outcome import report_limits
    from slideviz.cli.terminal import INVERTED

    found = measured.quality
    report = quality_report(name, found, worst)
    report |= {"walls": walls, "reference": str(reference) if reference else None}
    assert measured.mesh is not None
    report["metrics"] = metrics_report(measured.mesh, arguments.metrics, measured.reference)
    report["limits"] = limits_report(check_limits(arguments.limits, measured))
    if not save_json(arguments.json, report):
        print(f"{arguments.mesh}: size-skew, metric {found.metric}")
        print(f"  {reference_words(reference)}")
        print(quality_lines(found) + wall_lines(walls))
        print("worst cells:")
        print(table([(w["cell"], w["type"], f"{w['quality']:.6f}") for w in report["worst"]]))
        print("cells by quality:")
        print(histogram_lines(found))
        if report["metrics"]:
            print(f"metrics:\n{metric_lines(report['metrics'])}")
        if report["limits"]:
            print(f"limits:\n{limit_lines(report['limits'])}")
    code = report_limits(report["limits"])
    return INVERTED if found.inverted else code


def _walls(mesh: Mesh, reference: Mesh | None, case: Case | None) -> dict[str, dict]:
    from slideviz import walls
    from slideviz.errors import MeshError

    if mesh.part is not None:
        return {}
    try:
        found = walls(mesh, reference, case.walls(mesh.marker_names) if case else None)
    except MeshError:  # of a mesh with a mistake the quality is of use still
        return {}
    return found.summary()


def _write_csv(path: Path, found: Quality, metrics: Mapping[Metric, MetricValues]) -> None:
    from slideviz.errors import CaseError
    from slideviz.system.atomic import atomic_write
    from slideviz.terms import CELL_STATES, SIZE_SKEW, field_of

    more = {field_of(k): one.of_cells for k, one in metrics.items() if k not in SIZE_SKEW}
    columns = zip(found.values, found.size, found.skew, found.status, *more.values(), strict=True)
    lines = [",".join(("cell,size_skew,size,skew,status", *more))]
    for cell, (value, size, skew, status, *others) in enumerate(columns):
        numbers = f"{float(value)!r},{float(size)!r},{float(skew)!r}"
        lines.append(
            ",".join((f"{cell},{numbers},{CELL_STATES[status]}", *(repr(float(v)) for v in others)))
        )
    with atomic_write(path, CaseError) as file:
        file.write(("\n".join(lines) + "\n").encode())
