"""Reports: the JSON objects, and the tables printed on the terminal."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import orjson

from slideviz.case.keys import automatic_radius, get_reduction
from slideviz.case.limits import NUMBERS, LimitResult, check_case_limits, value_words
from slideviz.case.model import Case
from slideviz.case.motions.onto import Remaining
from slideviz.case.words import counted, first_of
from slideviz.cli.terminal import DONE, INVERTED, LIMIT_MISSED
from slideviz.errors import CaseError, Message, Remark, messages_of
from slideviz.mesh.elements import CELL_NAMES
from slideviz.mesh.metrics import MetricValues
from slideviz.mesh.model import IntArray, Mesh
from slideviz.mesh.quality import Quality
from slideviz.mesh.walls import statistics_of, wall_words
from slideviz.mesh.zones import marker_zones
from slideviz.rbf.problem import Relaxed
from slideviz.solver.deform import Step, folded_at
from slideviz.solver.layers import height_warnings
from slideviz.solver.remedies import beyond_pitch, fixed_beside, remedies
from slideviz.solver.steps import MeshRepair, RunResult
from slideviz.streaming.block_quality import CellCounts
from slideviz.system.atomic import atomic_write, write_whole
from slideviz.system.csv_table import write_csv
from slideviz.terms import NO_REFERENCE, WALL_VALUES, Metric, Quantity, field_of

Report = dict[str, Any]
ReportPart = Mapping[str, Any]
LISTED = 100  # most inverted cells listed in a report
MOST_WALLS = 6  # most boundaries whose layers a summary has
WORST = 10  # cells of lowest quality listed in a report

PHASES = (
    *("read", "classify", "select", "solve", "evaluate", "project", "correct"),
    *("layers", "relax", "repair"),
    *("quality", "write"),
)
TRIAL_KEYS = ("planned", "steps", "min", "mean", "inverted")
"""The fields of `Trial` that a report has, under the same keys."""
CYCLE_KEYS = ("cycle", "level", "error", "control_nodes", "seconds")
"""The fields of `Cycle` that a report has, under the same keys."""


def run_report(case: Case, done: RunResult, seconds: Mapping[str, float]) -> Report:
    """Return the JSON object of ``run --json``; ``seconds``: by phase, besides the steps' own."""
    mesh = done.mesh
    steps = done.steps
    walls = done.walls
    last = steps[-1]
    changed = [] if walls is None else height_warnings(case, walls, last.mesh, last.kept_layers)
    each = [step.relaxed for step in steps if step.relaxed is not None]
    spent = dict.fromkeys(PHASES, 0.0) | dict(seconds)
    for step in steps:
        for phase, value in step.seconds.items():
            spent[phase] = spent.get(phase, 0.0) + value
    return {
        "case": str(case.source or ""),
        "mesh": str(case.mesh_file or ""),
        "zone": mesh.zone,
        "zones": mesh.zones,
        "method": case.method,
        "sliding": case.sliding,
        "periodic": case.periodic,
        "steps": last.total,
        "quality": {
            **done.quality.summary(),
            "metric": done.quality.metric,
            "inverted_cells": list(done.folded),
            "inverted_at_step": [step for _, step in done.folded.values()],
            "undeformed": {"min": done.undeformed.min, "mean": done.undeformed.mean},
        },
        "limits": limits_report(
            check_case_limits(case, done.quality, last.mesh, mesh),
            check_case_limits(case, done.undeformed, mesh, mesh),
            mesh.file_cells,
        ),
        "walls": None if walls is None else walls.summary(),
        **({} if done.safe is None else done.safe.report()),
        "safe_fractions": [step.safe.fraction for step in steps if step.safe is not None],
        "tried": [_fields(trial, TRIAL_KEYS) for trial in last.tried],
        "control_nodes": [step.control_nodes for step in steps],
        "control_candidates": last.candidates,
        "data_reduction": {
            "asked": get_reduction(case),
            "used": last.tolerance is not None,
            "tolerance": last.tolerance,
        },
        "support_radius": {"automatic": automatic_radius(case), "used": last.support_radius},
        "condition": [s.condition if isfinite(s.condition) else None for s in steps],
        "max_error": max(step.max_error for step in steps),
        "periodic_misfit": max(
            (step.periodic_misfit for step in steps if step.periodic_misfit is not None),
            default=None,
        ),
        "relax": None if (relaxed := Relaxed.joined(each)) is None else asdict(relaxed),
        "targets": [one.report for one in last.messages if isinstance(one, Remaining)],
        "repair": None if (mended := _repaired(steps)) is None else mended.report(),
        "layers": None if last.kept_layers is None else last.kept_layers.report(),
        "seconds": {name: round(value, 6) for name, value in spent.items()},
        "node_counts": dict(last.node_counts),
        "warnings": [*last.messages, *changed],
        "convergence": [
            {"step": step.index, **_fields(cycle, CYCLE_KEYS)}
            for step in steps
            for cycle in step.history
        ],
    }


def limits_report(
    results: Sequence[LimitResult],
    before: Sequence[LimitResult] = (),
    cells: Callable[[IntArray], IntArray] = lambda cells: cells,
) -> list[Report]:
    """Return the JSON array of limits, with ``before`` deforming if known, and the worst cells.

    ``cells``: returns the numbers of cells in the file.
    """

    def actual(result: LimitResult | None) -> float | None:
        return float(result.actual) if result is not None and isfinite(result.actual) else None

    return [
        {
            "limit": str(result.limit),
            "name": result.limit.name,
            "marker": result.limit.marker or None,
            "op": result.limit.sign,
            "value": result.limit.value,
            "actual": actual(result),
            "undeformed": actual(old),
            "undeformed_passed": None if old is None else old.passed,
            "passed": result.passed,
            "boundaries": list(result.boundaries),
            "failing": len(result.cells),
            "cells": cells(result.cells[:LISTED]).tolist(),
        }
        for result, old in zip_longest(results, before)
    ]


def metrics_report(mesh: Mesh, found: Mapping[Metric, MetricValues]) -> Report:
    """Return the summaries of metrics of a mesh, by the names of their fields."""
    report = {field_of(name): values.summary() for name, values in found.items()}
    for one in report.values():
        if one["of"] == "cells":
            one["worst_at"] = int(mesh.file_cells(np.array(one["worst_at"])))
    return report


def metric_lines(
    names: Sequence[Quantity],
    after: ReportPart,
    before: ReportPart | None = None,
    walls: ReportPart | None = None,
) -> str:
    """Return the metrics of a mesh and of the undeformed one: a heading and a table.

    ``after``, ``before``: from `metrics_report`. ``walls``: the summary of `Walls`, for those of
    ``names`` that are numbers of walls: they are of boundaries with layers.
    """
    rows: list[tuple[str, ...]] = [("", "min", "mean", "max", "worst at", "beyond limit")]
    for name, entry in after.items():
        for label, one in ((name, entry), ("  undeformed", (before or {}).get(name))):
            if one is not None:
                beyond = "" if one["limit"] is None else f"{one['beyond']} ({one['limit']:g})"
                unit = f" [{one['unit']}]" if one["unit"] and one is entry else ""
                worst = f"{one['of'][:-1]} {one['worst_at']}"
                rows.append((f"{label}{unit}", *_ends(one), worst, beyond))
    layered = {marker: row for marker, row in (walls or {}).items() if row["layered"]}
    numbers = [field_of(name) for name in names if name in WALL_VALUES]
    for number in numbers:
        for marker, row in layered.items():
            now, old = statistics_of(row, number)
            rows += [(f"{number} at {marker}", *_ends(now))] if now else []
            rows += [("  undeformed", *_ends(old))] if old else []
    lines = [table(rows)] if len(rows) > 1 else []
    if numbers and not layered:
        lines.append(f"  {', '.join(numbers)}: no boundary layers at {first_of([*(walls or ())])}")
    return "\n".join(["metrics:", *lines])


def _ends(one: ReportPart) -> tuple[str, ...]:
    return tuple("inf" if one[k] is None else f"{one[k]:.6g}" for k in ("min", "mean", "max"))


def limit_lines(report: Sequence[ReportPart]) -> str:
    """Return the limits of a report as a text table."""
    rows = [(entry["limit"], *limit_words(entry)) for entry in report]
    return table(rows if any(row[2] for row in rows) else [(*row[:2], row[3]) for row in rows])


def limit_words(entry: ReportPart) -> tuple[str, str, str]:
    """Return the words on a limit of a report: ``0.2``, ``undeformed 0.4`` or "", ``not met``."""
    names = entry["boundaries"]
    value = value_words(entry["actual"], entry["failing"], names)
    before = "" if entry["undeformed"] is None else f"undeformed {entry['undeformed']:.6g}"
    if before and not entry["passed"] and not entry["undeformed_passed"]:
        before = f"the undeformed mesh misses it, too: {entry['undeformed']:.6g}"
    place = f" at {first_of(names)}" if names and entry["failing"] else ""
    cells = f", in {counted(entry['failing'], 'cell')}" if entry["failing"] else ""
    return value, before, "met" if entry["passed"] else f"not met{place}{cells}"


def _repaired(steps: Sequence[Step]) -> MeshRepair | None:
    """Return the repair of the last step, with all cells and nodes of the steps before, too."""
    each = [step.repaired for step in steps if step.repaired is not None]
    if len(each) < 2:
        return each[0] if each else None
    return replace(
        each[-1],
        cells=np.unique(np.concatenate([one.cells for one in each])),
        folded=np.unique(np.concatenate([one.folded for one in each])),
        nodes=np.unique(np.concatenate([one.nodes for one in each])),
        largest_move=max(one.largest_move for one in each),
    )


def folded_cells(steps: Sequence[Step], mesh: Mesh, quality: Quality) -> dict[int, tuple[int, int]]:
    """Return VTK type and first inverted step of the first ``LISTED`` inverted cells, by number."""
    cells = quality.inverted_cells(LISTED)
    numbers = mesh.file_cells(cells)
    types = mesh.file_types[numbers].tolist()
    when = folded_at(steps, mesh, cells).tolist()
    return dict(zip(numbers.tolist(), zip(types, when, strict=True), strict=True))


def _fields(value: object, keys: Iterable[str]) -> Report:
    return {key: getattr(value, key) for key in keys}


def quality_report(mesh: Mesh, quality: Quality, worst: IntArray, types: Sequence[int]) -> Report:
    """Return the JSON object of ``quality --json``; ``worst`` are cells of ``types`` (k,)."""
    counts, edges = quality.histogram()
    return {
        "mesh": mesh.name,
        **quality.summary(),
        "metric": quality.metric,
        "inverted_cells": mesh.file_cells(quality.inverted_cells(LISTED)).tolist(),
        "worst": [
            {"cell": number, "type": CELL_NAMES[vtk], "quality": float(quality.values[cell])}
            for cell, number, vtk in zip(worst, mesh.file_cells(worst).tolist(), types, strict=True)
        ],
        "histogram": {"counts": counts.tolist(), "edges": edges.tolist()},
    }


def info_report(mesh: Mesh, pairs: Sequence[Any], counts: CellCounts, quality: Quality) -> Report:
    """Return the JSON object of ``info --json``; ``mesh`` may be only the skin of the mesh."""
    low = mesh.points.min(axis=0)
    high = mesh.points.max(axis=0)
    halo = mesh.halo
    return {
        "mesh": mesh.name,
        "dimension": mesh.dim,
        "zone": mesh.zone,
        "zones": mesh.zones,
        "points": counts.points,
        "unused_points": counts.unused,
        "cells": sum(counts.types.values()),
        "cells_by_type": {CELL_NAMES[vtk]: count for vtk, count in counts.types.items()},
        "extents": [[float(a), float(b)] for a, b in zip(low, high, strict=True)],
        "markers": [
            {"name": m.name, "elements": len(m.cells), "nodes": len(m.nodes)}
            | ({"zone": zone} if len(mesh.parts) > 1 else {})
            for zone, m in zip(marker_zones(mesh), mesh.markers, strict=True)
        ],
        "periodic_pairs": [
            {
                "markers": [pair.first, pair.second],
                "type": pair.kind,
                "period": pair.period,
                "description": pair.describe(),
            }
            for pair in pairs
        ],
        "halo": None
        if halo is None
        else {
            "cells": int(halo.cells.sum()),
            "nodes": len(halo.outer),
            "sides": [list(pair) for pair in halo.sides],
        },
        "remarks": list(mesh.remarks),
        "quality": quality.summary(),
    }


def reference_words(reference: Path | None) -> str:
    """Return the line on the undeformed mesh that the quality refers to, or that there is none."""
    remedy = f"{NO_REFERENCE}; give --reference UNDEFORMED"
    return remedy if reference is None else f"reference: {reference}"


def zone_words(zone: int | None, zones: int) -> str:
    """Return which zone of a file a mesh is, after a comma; "" where it has only one."""
    if zones == 1:
        return ""
    return f", zone {zone} of {zones}" if zone else f", all {zones} zones"


def print_remarks(remarks: Iterable[Remark], *, quiet: bool) -> None:
    """Print warnings to stderr, and notes too unless ``quiet``."""
    for message in messages_of(remarks):
        if not quiet or message.level != "note":
            print(f"slideviz: {message.level}: {message}", file=sys.stderr)


def _text(value: object) -> str:
    """Return the text of a message in a report."""
    if isinstance(value, Message):
        return str(value)
    raise TypeError(f"a report cannot have {value!r}")


def save_report(arguments: Namespace, report: ReportPart) -> bool:
    """Write a report to the file of --json, or print it; return whether words are printed, too."""
    path = arguments.json
    text = json.dumps(report, indent=2, default=_text) + "\n" if path else ""
    if str(path) == "-":
        print(text, end="")
        return False
    if path:
        write_whole(path, text, CaseError)
    return not arguments.quiet


def save_history(path: Path, report: ReportPart) -> None:
    """Write the convergence of the data reduction as CSV, a row for each cycle."""
    columns = ("step", *CYCLE_KEYS)
    rows = [[repr(row[name]) for name in columns] for row in report["convergence"]]
    write_csv(path, [columns, *rows], CaseError)


def table(rows: Sequence[Sequence[object]], indent: int = 2) -> str:
    """Return rows as text in aligned columns; numbers are aligned to the right."""
    cells = [[_cell(value) for value in row] for row in rows]
    widths = [max(len(row[i]) for row in cells if i < len(row)) for i in range(len(cells[0]))]
    lines = []
    for row, given in zip(cells, rows, strict=True):
        parts = [
            text.rjust(width) if isinstance(value, (int, float)) else text.ljust(width)
            for text, value, width in zip(row, given, widths, strict=False)
        ]
        lines.append(" " * indent + "  ".join(parts).rstrip())
    return "\n".join(lines)


def _cell(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def wall_lines(walls: Mapping[str, dict] | None) -> str:
    """Return a line for each boundary with layers of ``walls``, a summary of `Walls`, or ""."""
    layered = {name: row for name, row in (walls or {}).items() if row["layered"]}
    rows = [(f"layers at {name}", wall_words(row)) for name, row in layered.items()]
    more = len(rows) - MOST_WALLS
    rows[MOST_WALLS:] = [(f"and at {more} more boundaries", "")] if more > 0 else []
    return f"\n{table(rows)}" if rows else ""


def histogram_lines(quality: Quality, bins: int = 10, width: int = 40) -> str:
    """Return the histogram of qualities as text, the lowest bin first."""
    counts, edges = quality.histogram(bins)
    top = max(1, int(counts.max()))
    rows = []
    for count, low, high in zip(counts, edges[:-1], edges[1:], strict=True):
        bar = "█" * round(width * int(count) / top) or ("▏" if count else "")
        rows.append((f"{low:.1f} to {high:.1f}", int(count), bar))
    return table(rows)


def quality_lines(
    quality: Quality, reference: Quality | None = None, named: str = "undeformed"
) -> str:
    """Return minimum, mean and counts of cells as a text table, beside a ``named`` reference."""

    def beside(value: float) -> tuple[str, ...]:
        return () if reference is None else (f"{named} {_cell(value)}",)

    before = reference or quality
    rows: list[tuple[object, ...]] = [
        ("minimum quality", quality.min, *beside(before.min)),
        ("mean quality", quality.mean, *beside(before.mean)),
        ("cells", quality.cells),
        ("valid", quality.valid),
        ("inverted", quality.inverted),
    ]
    if quality.halo is not None:
        rows.insert(2, ("halo cells, not counted", len(quality) - quality.cells))
    if quality.unproven:
        rows.append(("unproven", quality.unproven))
    return table(rows)


CELLS = "quality of each cell"  # what the summary calls the file of qualities
QUALITY_BYTES = 20  # most bytes of a line in the file of qualities: 16 or 17 digits
_ROWS = 1 << 18


def report_outcome(
    arguments: Namespace, case: Case, done: RunResult, report: dict, files: dict[str, Path | None]
) -> int:
    """Write the report of a run, print its summary and warnings, and return the exit code.

    ``files``: the files written so far, by their words in the summary.
    """
    advice = _advice(case, done, report["limits"])
    if arguments.history:
        save_history(arguments.history, report)
    if save_report(arguments, report):
        files |= {"report": arguments.json, "picture": arguments.picture}
        files |= {"convergence": arguments.history, "mesh of every step": arguments.steps_dir}
        files |= {"all steps": arguments.steps_file}
        _print_run(report, done, files, arguments.metrics)
    print_remarks(report["warnings"], quiet=arguments.quiet)
    if report["quality"]["inverted"]:
        report_limits(report["limits"])
        print(f"slideviz: {_inverted_sentence(report, done, advice)}", file=sys.stderr)
        return INVERTED
    return report_limits(report["limits"], advice)


def report_limits(limits: Sequence[ReportPart], advice: str = "") -> int:
    """Print the limits of a report that are not met to stderr, and advice; return the exit code."""
    missed = [entry for entry in limits if not entry["passed"]]
    for entry in missed:
        named = ", ".join(map(str, entry["cells"][:5]))
        more = " ..." if entry["failing"] > 5 else ""
        value, before, outcome = limit_words(entry)
        cells = f" ({named}{more})" if named + more else ""
        sentence = f"the limit {entry['limit']} is {outcome}{cells}: {value}"
        print(f"slideviz: {sentence}{f', {before}' if before else ''}", file=sys.stderr)
    if missed and advice:
        print(f"slideviz: {advice}", file=sys.stderr)
    return LIMIT_MISSED if missed else DONE


def write_qualities(path: Path, found: Quality) -> None:
    """Write a line with the size-skew quality of each cell, as RBF-SliDe's GENERATE_QUALITY."""
    values = found.values[found.file_rows]
    with atomic_write(path, CaseError) as file:
        for first in range(0, len(values), _ROWS):
            part = np.asarray(values[first : first + _ROWS])
            text = orjson.dumps(part, option=orjson.OPT_SERIALIZE_NUMPY)
            file.write(text[1:-1].replace(b",", b"\n") + b"\n")


def _print_run(
    report: dict, done: RunResult, files: dict[str, Path | None], metrics: Sequence[Quantity]
) -> None:
    counts = report["node_counts"]
    spent = report["seconds"]
    method = "" if report["method"] == "rbf" else f"method {report['method']}, "
    auto = " (AUTO)" if report["tried"] else ""
    print(f"{report['case']}: {counted(report['steps'], 'step')}{auto}, {method}", end="")
    zone = zone_words(report["zone"], report["zones"])
    slides = counts["sliding_edge"] + counts["sliding_surface"]
    sliding = report["sliding"] if slides else "none"
    print(f"sliding {sliding}, periodic {report['periodic']}{zone}")
    print(quality_lines(done.quality, done.undeformed) + wall_lines(report["walls"]))
    rows = [(name.replace("_", " ") + " nodes", count) for name, count in counts.items()]
    rows.append(("control nodes", report["control_nodes"][-1]))
    rows.append(("control candidates", report["control_candidates"]))
    reduction = report["data_reduction"]
    if reduction["used"]:
        chosen = " (AUTO)" if reduction["asked"] == "AUTO" else ""
        rows.append((f"tolerance{chosen}", float(reduction["tolerance"])))
    radius = report["support_radius"]
    if radius["used"] is not None:
        chosen = " (AUTO)" if radius["automatic"] else ""
        rows.append((f"support radius{chosen}", radius["used"]))
    if (relax := report["relax"]) is not None:
        words = f"{counted(relax['rounds'], 'iteration')}, to {relax['residual']:.1g}"
        rows.append(("relaxation", words))
    mended = report["repair"]
    if mended is not None and (mended["cells_before"] or mended["nodes_moved"]):
        counts = "; ".join(
            f"{counted(mended[f'{key}_before'], what)} before, {mended[f'{key}_after']} after"
            for key, what in (("folded", "folded cell"), ("cells", "bad cell"))
            if mended[f"{key}_before"]
        )
        counts = counts or "lowest qualities raised"
        far = f"up to {mended['largest_move']:.3g}"
        rows.append(("repair", f"{counts}; {counted(mended['nodes_moved'], 'node')} moved, {far}"))
    elif mended is not None:
        rows.append(("repair", "no cell needs it"))
    if (layers := report["layers"]) is not None:
        walls = layers["walls"]
        reach = max(wall["thickness"] for wall in walls)
        where = f"at {counted(len(walls), 'wall')}, up to {reach:.3g} away"
        rows.append(("nodes carried by walls", f"{layers['nodes']} {where}"))
    if report["periodic_misfit"] is not None:
        rows.append(("periodic misfit", report["periodic_misfit"]))
    print(table(rows))
    if done.safe is not None:
        mended = bool(mended and mended["nodes_moved"])
        print(f"  {done.safe.words}{done.safe.ending(done.quality.inverted, mended)}")
    if report["limits"]:
        print(f"limits:\n{limit_lines(report['limits'])}")
    if rated := report.get("metrics"):
        print(metric_lines(metrics, rated["after"], rated["before"], report["walls"]))
    if report["tried"]:
        print(f"  steps tried: {', '.join(map(_trial_words, report['tried']))}")
    parts = {k: v for k, v in spent.items() if k != "total"}
    parts["start and others"] = spent["total"] - sum(parts.values())
    phases = ", ".join(f"{k} {v:.2f}" for k, v in parts.items() if v >= 0.005)
    print(f"  {spent['total']:.2f} s ({phases or 'all phases below 0.01'})")
    for name, path in files.items():
        if path:
            print(f"{name}: {path}")


def _trial_words(trial: ReportPart) -> str:
    halved = f", halved to {trial['steps']}" if trial["steps"] != trial["planned"] else ""
    result = f"{trial['inverted']} inverted" if trial["inverted"] else f"minimum {trial['min']:.3g}"
    return f"{trial['planned']} ({result}{halved})"


def _advice(case: Case, done: RunResult, limits: Sequence[ReportPart]) -> str:
    """Return what may help against inverted cells or missed limits: remedies, with keys.

    ``limits`` are those of the report. Of a mesh in a file neither the pitch nor boundaries beside
    the cells are named.
    """
    found = done.quality
    missed = [entry for entry in limits if not entry["passed"] and entry["undeformed_passed"]]
    if not found.inverted and not missed:
        return ""  # what the undeformed mesh misses, no other deformation mends

    beside: tuple[str, ...] = ()
    pitch = ""
    if done.walls is not None:
        cells = found.inverted_cells()
        if not found.inverted:
            numbers = [cell for entry in missed for cell in entry["cells"]]
            cells = np.flatnonzero(np.isin(done.mesh.numbering.cells, numbers))
        beside = fixed_beside(case, done.mesh, cells)
        pitch = beyond_pitch(case, done.mesh)
    last = done.steps[-1]
    every = [r.keys for r in remedies(case, beside, pitch, last, found.inverted > 0)]
    if not found.inverted and case.method == "rbf":
        walls = any(NUMBERS[entry["name"]].on_boundary for entry in missed)
        if walls and case.layers == "no":
            every.insert(0, "LAYERS= AUTO")
    ideas = "; ".join(every)
    return f"{pitch[:1].lower()}{pitch[1:]}; what may help: {ideas}".removeprefix("; ")


def _inverted_sentence(report: dict, done: RunResult, advice: str) -> str:
    inverted = report["quality"]["inverted"]
    cells = report["quality"]["cells"]
    named = ", ".join(
        f"{cell} ({CELL_NAMES[vtk]}, step {step})"
        for cell, (vtk, step) in list(done.folded.items())[:5]
    )
    more = f" and {inverted - 5} more" if inverted > 5 else ""
    safe = done.safe
    reach = "" if safe is None or safe.fraction >= 1 else f"{safe.words}; "
    return f"{inverted} of {cells} cells are inverted: {named}{more}; {reach}{advice}"
