"""``slideviz sweep``: a run for each row of a table of designs, and a table of results."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from slideviz import sweep
from slideviz.case.keys import FILES, KEYS, VIEW
from slideviz.case.limits import MET
from slideviz.case.words import counted, first_of
from slideviz.cli.mesh_source import read_case, read_mesh, require_mesh_file
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.report import Report, print_remarks, save_report, table
from slideviz.cli.terminal import DONE
from slideviz.design.sweeps.table import (
    RESULTS,
    DesignRow,
    Designs,
    failures,
    numbers_of,
    read_designs,
)
from slideviz.errors import CaseError, Remark
from slideviz.system.atomic import make_folder
from slideviz.system.cleanup import keep_partial
from slideviz.system.grouping import grouped

_LISTED = 5
"""Most designs that are listed in one line, and most reasons of failed designs that are printed."""
_CONNECTING = 10.0  # seconds to wait for a connection to a scheduler


def main(arguments: Namespace) -> int:
    """Deform a mesh by many designs, and write the table of results; return the exit code."""
    case = read_case(arguments)
    if arguments.columns:
        return _print_columns(case)
    if arguments.table is None:
        raise CaseError("the table of designs is missing; `--columns` lists the possible columns")
    designs = read_designs(case, arguments.table)
    mesh_file = require_mesh_file(arguments, case)
    folder = arguments.output or Path(f"{arguments.case.stem}_swept")
    mesh = None
    if not arguments.stream:
        case, mesh = read_mesh(case, mesh_file)
    make_folder(folder)
    require_output_paths(arguments, OutputPath(arguments.json, "--json"))
    with _executor(arguments) as executor:
        rows = sweep(
            case,
            designs,
            executor,
            mesh=mesh,
            workers=arguments.workers,
            folder=folder,
            meshes=arguments.meshes,
            time_step=arguments.time_step,
            stream=arguments.stream,
            resume=arguments.resume,
            force=arguments.force,
        )
        if not arguments.quiet:
            what = f"{counted(len(designs.rows), 'design')} of {', '.join(designs.columns)}"
            cells = "" if mesh is None else f", {mesh.file_counts[1]:,} cells"
            print(f"{arguments.case}{cells}: {what}", flush=True)
        begin = time.perf_counter()
        results = _pulled(arguments, rows, len(designs.rows), folder / RESULTS)
    report = _report(arguments, designs, results, time.perf_counter() - begin)
    report["results"] = str(folder / RESULTS)
    if save_report(arguments, report):
        _print_sweep(report)
    problems = {row.problem for row in results}
    if len(problems) == 1 and report["failed"] == len(results):
        raise CaseError(f"no design could be computed: {problems.pop()}")
    _warn(case.warnings, results, arguments.quiet)
    if report["failed"] == len(results):
        raise CaseError(f"no design could be computed; {folder / RESULTS} says why for each")
    return DONE


def _print_columns(case: Any) -> int:
    numbers = numbers_of(case)
    file = case.mesh_file
    if file is not None and file.exists() and read_mesh(case, file)[1].dim == 2:
        numbers = {name: place for name, place in numbers.items() if place.field != "axis"}
    if numbers:
        print("numbers of the motions, and their values in the case:")
        print(table([(name, place.of(case)) for name, place in numbers.items()]))
    print("keys of the case (`slideviz keys` explains them):")
    print("  " + ", ".join(name for name, key in KEYS.items() if key.group not in (FILES, VIEW)))
    return DONE


@contextmanager
def _executor(arguments: Namespace) -> Iterator[Executor | None]:
    """Context with the executor of ``--scheduler``, or None; CaseError if there is none."""
    if arguments.scheduler is None:
        yield None
        return
    if arguments.workers is not None:
        raise CaseError("--workers is for processes of this machine; a Dask cluster has its own")
    try:
        # Late: Dask takes 0.5 s, and need not be installed.
        from distributed import Client
    except ImportError:
        raise CaseError("--scheduler needs Dask; install slideviz[dask]") from None
    try:
        client = Client(arguments.scheduler, timeout=_CONNECTING, set_as_default=False)
    except (OSError, ValueError) as problem:
        raise CaseError(
            f"--scheduler {arguments.scheduler}: no scheduler answers ({problem}); start one "
            "with `dask scheduler`, and give the address that it prints"
        ) from problem
    try:
        if not client.nthreads():
            print("slideviz: note: the cluster has no workers yet; waiting", file=sys.stderr)
        yield client.get_executor()
    finally:
        client.close()


def _pulled(
    arguments: Namespace, rows: Iterator[DesignRow], total: int, results: Path
) -> list[DesignRow]:
    """Run all designs and return their rows in the order of the table, with a progress bar."""
    found: list[DesignRow] = []
    begin = time.monotonic()
    earlier = 0
    with Bar(not arguments.quiet) as bar:
        bar.count(0, total, "designs:")
        for row in rows:
            found.append(row)
            earlier += row.earlier
            so_far = f"{len(found)} of {counted(total, 'design')}"
            keep_partial(results, f"{results} has {so_far}, and --resume continues")
            fresh = len(found) - earlier
            left = (time.monotonic() - begin) / fresh * (total - len(found)) if fresh else None
            bar.count(len(found), total, "designs:", left)
    return sorted(found, key=lambda row: row.design)


def _report(
    arguments: Namespace, designs: Designs, rows: Sequence[DesignRow], seconds: float
) -> Report:
    done = sorted((row for row in rows if not row.problem), key=lambda row: (-row.min, row.design))
    fresh = [row for row in rows if not row.earlier]
    return {
        "case": str(arguments.case),
        "table": str(arguments.table),
        "columns": list(designs.columns),
        "designs": len(rows),
        "earlier": len(rows) - len(fresh),
        "failed": len(rows) - len(done),
        "inverted": [row.design for row in rows if row.inverted],
        "limits": _missed(rows),
        "best": _named(done[0]) if done else None,
        "worst": _named(done[-1]) if done else None,
        "lost_workers": sum(row.lost for row in fresh),
        "seconds": {"total": seconds, "designs": sum(row.seconds for row in fresh)},
    }


def _missed(rows: Sequence[DesignRow]) -> list[Report]:
    """Return the entry of a report for each limit that designs miss: limit and their numbers."""
    missed = grouped(
        (text.rpartition(": ")[0], row.design)
        for row in rows
        for text in row.limits.removesuffix(MET).split("; ")
        if text
    )
    return [{"limit": limit, "designs": designs} for limit, designs in missed.items()]


def _named(row: DesignRow) -> Report:
    return {"design": row.design, "min": row.min, "mean": row.mean, "values": dict(row.values)}


def _print_sweep(report: Report) -> None:
    seconds = report["seconds"]
    fresh = report["designs"] - report["earlier"]
    earlier = f" ({report['earlier']} were there)" if report["earlier"] else ""
    print(f"{counted(fresh, 'design')} in {seconds['total']:.1f} s{earlier}")
    lines: list[tuple[str, object]] = []
    for word in ("best", "worst"):
        if report[word]:
            one = report[word]
            lines.append((f"{word} minimum quality", f"{one['min']:.6f}  (design {one['design']})"))
    if report["inverted"]:
        lines.append(("with inverted cells", _counted(report["inverted"])))
    lines += [(f"not {one['limit']}", _counted(one["designs"])) for one in report["limits"]]
    if report["failed"]:
        lines.append(("failed", report["failed"]))
    if report["lost_workers"]:
        lines.append(("workers lost", report["lost_workers"]))
    print(table(lines))
    print(f"results: {report['results']}")


def _counted(designs: Sequence[int]) -> str:
    """Return how many designs there are, with the first of them."""
    return f"{len(designs)}  (design {first_of(designs, _LISTED)})"


def _warn(warnings: Sequence[Remark], rows: Sequence[DesignRow], quiet: bool) -> None:
    """Print the warnings of the case, and why designs failed, each reason with its designs."""
    print_remarks(warnings, quiet=quiet)
    reasons = failures(rows)
    for reason, failed in list(reasons.items())[:_LISTED]:
        word = "design" if len(failed) == 1 else "designs"
        print(f"slideviz: warning: {word} {first_of(failed, _LISTED)}: {reason}", file=sys.stderr)
    if len(reasons) > _LISTED:
        print(f"slideviz: warning: and {len(reasons) - _LISTED} more reasons", file=sys.stderr)
