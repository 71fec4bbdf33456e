"""The outcome of a run: its report, the file of the quality of each cell, the printed summary."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import orjson

from slideviz.case.limits import NUMBERS
from slideviz.case.words import counted
from slideviz.cli.report import (
    limit_lines,
    limit_words,
    metric_lines,
    print_remarks,
    quality_lines,
    save_history,
    save_json,
    table,
    wall_lines,
    zone_words,
)
from slideviz.cli.terminal import DONE, INVERTED, LIMIT_MISSED
from slideviz.errors import CaseError
from slideviz.mesh.elements import ELEMENTS
from slideviz.solver.remedies import beyond_pitch, fixed_beside, remedies
from slideviz.system.atomic import atomic_write

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.mesh.quality import Quality
    from slideviz.solver.steps import RunResult
    from slideviz.terms import Quantity

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
    if not save_json(arguments.json, report) and not arguments.quiet:
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


def report_limits(limits: Sequence[Mapping[str, Any]], advice: str = "") -> int:
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
    with atomic_write(path, CaseError) as file:
        for first in range(0, len(found), _ROWS):
            part = np.asarray(found.values[first : first + _ROWS])
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
        words = f"{relax['rounds']} rounds, residual {relax['residual']:.2g}"
        if relax["limited"]:
            words += f", held back at {counted(relax['limited'], 'node')}"
        rows.append(("relaxation", words))
    if (mended := report["repair"]) is not None and mended["cells_before"]:
        counts = "; ".join(
            f"{counted(mended[f'{key}_before'], what)} before, {mended[f'{key}_after']} after"
            for key, what in (("folded", "folded cell"), ("cells", "bad cell"))
            if mended[f"{key}_before"]
        )
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


def _trial_words(trial: Mapping[str, Any]) -> str:
    halved = f", halved to {trial['steps']}" if trial["steps"] != trial["planned"] else ""
    result = f"{trial['inverted']} inverted" if trial["inverted"] else f"minimum {trial['min']:.3g}"
    return f"{trial['planned']} ({result}{halved})"


def _advice(case: Case, done: RunResult, limits: Sequence[Mapping[str, Any]]) -> str:
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
            cells = np.array([cell for entry in missed for cell in entry["cells"]], np.int64)
        beside = fixed_beside(case, done.mesh, cells)
        pitch = beyond_pitch(case, done.mesh)
    last = done.steps[-1]
    every = [r.keys for r in remedies(case, beside, pitch, last, found.inverted > 0)]
    if not found.inverted and case.method == "rbf":
        walls = any(NUMBERS[entry["name"]].on_boundary for entry in missed)
        if case.relax == "no":
            every.insert(0, "RELAX= YES")
        if walls and case.layers == "no":
            every.insert(0, "LAYERS= AUTO")
    ideas = "; ".join(every)
    return f"{pitch[:1].lower()}{pitch[1:]}; what may help: {ideas}".removeprefix("; ")


def _inverted_sentence(report: dict, done: RunResult, advice: str) -> str:
    inverted = report["quality"]["inverted"]
    cells = report["quality"]["cells"]
    named = ", ".join(
        f"{cell} ({ELEMENTS[vtk].name}, step {step})"
        for cell, (vtk, step) in list(done.folded.items())[:5]
    )
    more = f" and {inverted - 5} more" if inverted > 5 else ""
    safe = done.safe
    reach = "" if safe is None or safe.fraction >= 1 else f"{safe.words}; "
    return f"{inverted} of {cells} cells are inverted: {named}{more}; {reach}{advice}"
