"""``slideviz quality``: the size-skew quality of a mesh."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path

from slideviz import walls, write
from slideviz.case.limits import LimitResult, MeasuredMesh, check_limits, require_streamed
from slideviz.cli.mesh_source import OpenMesh, open_mesh, optional_case
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.report import (
    WORST,
    histogram_lines,
    limit_lines,
    limits_report,
    metric_lines,
    metrics_report,
    quality_lines,
    quality_report,
    reference_words,
    report_limits,
    save_report,
    table,
    wall_lines,
)
from slideviz.cli.terminal import INVERTED
from slideviz.errors import CaseError, MeshError
from slideviz.formats.files import metric_data, quality_data
from slideviz.formats.table import holds_quality, own_endings
from slideviz.mesh.metrics import MetricValues
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.periodic import find_pairs
from slideviz.mesh.quality import Quality
from slideviz.mesh.walls import Walls
from slideviz.session.opening import guess_by_name
from slideviz.system.csv_table import write_csv
from slideviz.terms import CELL_STATES, METRICS, RATED, WALL_VALUES, Metric, field_of


def main(arguments: Namespace) -> int:
    """Print or write the quality of a mesh, relative to the undeformed one if it is given.

    Returns the exit code.
    """
    output = arguments.output
    _require_streamed(arguments)
    is_table = output is not None and output.suffix.lower() == ".csv"
    case = optional_case(arguments)
    require_output_paths(
        arguments,
        OutputPath(output, "-o", is_mesh=not is_table),
        OutputPath(arguments.json, "--json"),
    )
    if output is not None and not is_table and not holds_quality(output):
        raise CaseError(
            f"-o {output}: that format has no quality of cells; use "
            f"{own_endings('quality')} or .csv"
        )
    with open_mesh(arguments, case) as opened:
        if opened.reference is None and arguments.metrics == tuple(RATED):
            arguments.metrics = tuple(k for k, term in RATED.items() if not term.compares)
        for name in arguments.metrics:
            if name in WALL_VALUES and RATED[name].compares and opened.reference is None:
                raise CaseError(f"{name} compares with the undeformed mesh; give a reference")
        rated: dict[Metric, MetricValues | None]
        rated = dict.fromkeys(name for name in METRICS if name in arguments.metrics)
        mesh = opened.source.mesh
        found = opened.quality(arguments, metrics=rated)
        values = {name: one for name, one in rated.items() if one is not None}
        base = opened.read_base()
        case = opened.case
        names = case.walls(mesh.marker_names) if case else _not_periodic(base or mesh)
        layers = _walls(mesh, base, names)
        results = check_limits(arguments.limits, MeasuredMesh(found, mesh, base, names))
        cells, points = metric_data(values, layers, arguments.metrics)
        if is_table:
            _write_csv(output, found, cells)
        elif output:
            data = quality_data(output, found) or {}
            write(output, mesh, cell_data=data | cells, point_data=points)
        return _report(arguments, opened, found, values, layers, results)


def _require_streamed(arguments: Namespace) -> None:
    """Raise CaseError for what needs the mesh in memory, where ``--stream`` is set."""
    if not arguments.stream:
        return
    if arguments.output is not None:
        raise CaseError("-o needs the mesh in memory; leave it out, or --stream")
    several = [name for name in arguments.metrics if name not in METRICS or not METRICS[name].alone]
    if several:
        usable = [k for k, one in METRICS.items() if arguments.reference or not one.compares]
        known = ",".join(field_of(name) for name in usable if METRICS[name].alone)
        raise CaseError(
            f"--metrics {','.join(map(field_of, several))} needs the mesh in memory, since a "
            f"stream has one cell at a time; use --metrics {known}, or leave out --stream"
        )
    require_streamed(arguments.limits)


def _report(
    arguments: Namespace,
    opened: OpenMesh,
    found: Quality,
    metrics: Mapping[Metric, MetricValues],
    layers: Walls | None,
    limits: Sequence[LimitResult],
) -> int:
    """Print the quality of a mesh or write it as JSON, and return the exit code."""
    worst = found.worst(WORST)
    reference = opened.reference
    mesh = opened.source.mesh
    report = quality_report(mesh, found, worst, opened.source.types(worst).tolist())
    walls = None if layers is None else layers.summary()
    report |= {"walls": walls, "reference": str(reference) if reference else None}
    report |= {
        "metrics": metrics_report(mesh, metrics),
        "limits": limits_report(limits, cells=mesh.file_cells),
    }
    if save_report(arguments, report):
        print(f"{arguments.mesh}: size-skew, metric {found.metric}")
        print(f"  {reference_words(reference)}")
        print(quality_lines(found) + wall_lines(walls))
        print("worst cells:")
        print(table([(w["cell"], w["type"], f"{w['quality']:.6f}") for w in report["worst"]]))
        print("cells by quality:")
        print(histogram_lines(found))
        if arguments.metrics:
            print(metric_lines(arguments.metrics, report["metrics"], walls=walls))
        if report["limits"]:
            print(f"limits:\n{limit_lines(report['limits'])}")
    code = report_limits(report["limits"])
    return INVERTED if found.inverted else code


def _not_periodic(mesh: Mesh) -> Sequence[str] | None:
    """Return the boundaries without those that match and whose names say that they are periodic.

    None, which means all, if there are none such.
    """
    guesses = {name: guess_by_name(name) for name in mesh.marker_names}
    hinted = {name for name, guess in guesses.items() if guess and guess.role == "periodic"}
    if not hinted:
        return None
    try:
        pairs = find_pairs(mesh)
    except MeshError:
        return None
    periodic = hinted & {name for pair in pairs for name in (pair.first, pair.second)}
    return [name for name in mesh.marker_names if name not in periodic] if periodic else None


def _walls(mesh: Mesh, reference: Mesh | None, names: Sequence[str] | None) -> Walls | None:
    """Return the layers at the boundaries ``names`` of a mesh; None for one in a file."""
    try:
        return walls(mesh, reference, names)
    except MeshError:  # of a mesh with a mistake the quality is of use still
        return None


def _write_csv(path: Path, found: Quality, more: Mapping[str, FloatArray]) -> None:
    """Write number, size-skew, size, skew, status and ``more`` of each cell as CSV."""
    measured = found.values, found.size, found.skew, *more.values()
    texts = [map(repr, one[found.file_rows].tolist()) for one in measured]
    status = map(CELL_STATES.__getitem__, found.status[found.file_rows].tolist())
    rows = ((at, *row) for at, row in enumerate(zip(*texts[:3], status, *texts[3:], strict=True)))
    write_csv(
        path, chain([("cell", "size_skew", "size", "skew", "status", *more)], rows), CaseError
    )
