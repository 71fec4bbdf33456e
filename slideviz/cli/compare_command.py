"""``slideviz compare``: one case by several methods, in a table, plots and pictures."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path

from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.cli.mesh_source import read_case, read_mesh, require_mesh_file
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.terminal import DONE
from slideviz.errors import CaseError
from slideviz.mesh.model import Mesh
from slideviz.study.combinations import (
    COMPARED_METHODS,
    MODES,
    STEPS,
    Combination,
    CombinationRow,
    announcement,
    bounded,
    combinations,
    compare,
    csv_text,
    history_text,
    refused,
    terminal_head,
    terminal_line,
    wanted_methods,
    wanted_modes,
    warm,
)
from slideviz.system.atomic import make_folder, write_whole
from slideviz.terms import PERIODIC_MODES

TABLE = "compare.csv"
HISTORY = "convergence.csv"
KEPT_BYTES = 1_500_000_000
"""Most bytes of deformed meshes that are kept in memory, for the pictures."""


def main(arguments: Namespace) -> int:
    """Deform a mesh by several methods, write table, plots and pictures; return the exit code."""
    for name in ("matplotlib",) if arguments.no_pictures else ("matplotlib", "pyvista"):
        import_module(name)  # else it would be missed only after all is computed
    case = read_case(arguments)
    mesh_file = require_mesh_file(arguments, case)
    wanted = _wanted(arguments, case)
    folder = arguments.output or Path(f"{arguments.case.stem}_compared")
    case, mesh = read_mesh(case, mesh_file)
    make_folder(folder)
    tables = [folder / TABLE, folder / HISTORY]
    require_output_paths(
        arguments, *(OutputPath(table, "compare", named=False) for table in tables)
    )
    cannot = refused(case, mesh, wanted)

    known = {"methods": tuple(COMPARED_METHODS), "periodic": tuple(MODES)}
    more = {option: names for option, names in known.items() if getattr(arguments, option) is None}
    _say(
        arguments,
        f"{arguments.case}, {mesh.file_counts[1]:,} cells: {announcement(wanted, cannot, more)}",
    )
    warm({one.method for one in wanted if one not in cannot})
    _say(arguments, terminal_head())
    rows, files = _computed(arguments, case, mesh, wanted, cannot, folder)
    _say(arguments, "drawing plots" + ("" if arguments.no_pictures else " and pictures"))
    files += _drawn(arguments, case, mesh, rows, folder)
    _say(arguments, "\n".join(map(str, files)))
    if not any(row.result for row in rows):
        raise CaseError(f"no combination could be computed; {files[0]} says why for each")
    return DONE


def _say(arguments: Namespace, text: str) -> None:
    if not arguments.quiet:
        print(text, flush=True)


def _wanted(arguments: Namespace, case: Case) -> tuple[Combination, ...]:
    """Return the combinations that the arguments ask for; CaseError if an item is not valid."""

    def names(option: str, known: Sequence[str], usual: Sequence[str]) -> list[str]:
        text = getattr(arguments, option)
        items = _items(text) if text is not None else list(usual)
        if items == ["all"]:
            return list(known)
        for name in items:
            if name not in known:
                raise CaseError(f"--{option}: {name!r} is not one of {', '.join(known)} (or all)")
        if not items:
            raise CaseError(f"--{option} names none of {', '.join(known)}")
        return items

    methods = names("methods", tuple(COMPARED_METHODS), wanted_methods(case))
    modes = names("periodic", tuple(PERIODIC_MODES), wanted_modes(case))

    steps = list(STEPS)
    if arguments.steps is not None:
        steps = []
        for item in _items(arguments.steps):
            try:
                steps.append(KEYS["STEPS"].kind.read(item))
            except CaseError as problem:
                raise CaseError(f"--steps: {problem}") from None
        if not steps:
            raise CaseError("--steps names no number; give some, such as 1,5,20")
    return combinations(methods, [mode for mode in PERIODIC_MODES if mode in modes], steps)


def _items(text: str) -> list[str]:
    """Return the words of a list with commas, in lower case, each once."""
    return list(dict.fromkeys(word.strip().lower() for word in text.split(",") if word.strip()))


def _computed(
    arguments: Namespace,
    case: Case,
    mesh: Mesh,
    wanted: Sequence[Combination],
    cannot: Mapping[Combination, str],
    folder: Path,
) -> tuple[list[CombinationRow], list[Path]]:
    """Compute all combinations; return their rows, the tables, and reasons why some cannot be."""
    table = folder / TABLE
    histories = folder / HISTORY
    files = [table]
    rows: list[CombinationRow] = []
    reasons: list[str] = []
    count = len(wanted) - len(cannot)
    bars: list[Bar] = []
    rows_one_by_one = compare(case, mesh, wanted, lambda _, now: bars[-1](now))
    pulled = bounded(rows_one_by_one, 0 if arguments.no_pictures else KEPT_BYTES)
    for tried in wanted:
        number = 1 + sum(row.combination not in cannot for row in rows)
        head = f"{number} of {count}: {tried.method}, {tried.periodic}, "
        # Wiped away before the row is printed.
        with Bar(not arguments.quiet, head, _expected(rows, tried)) as bar:
            bars.append(bar)
            rows.append(next(pulled))
        write_whole(table, csv_text(rows), CaseError)
        if any(row.result is not None and row.result.history for row in rows):
            write_whole(histories, history_text(rows), CaseError)
            files = [table, histories]
        if tried not in cannot:  # those were announced before
            _say(arguments, terminal_line(rows[-1], reasons))
    return rows, files


def _expected(rows: Sequence[CombinationRow], tried: Combination) -> float | None:
    """Return the seconds that a combination may take, by earlier rows of its method; or None."""
    known = [row for row in rows if row.result and row.combination.method == tried.method]
    alike = [row for row in known if row.combination.periodic == tried.periodic] or known
    if not alike or not tried.steps:
        return None
    last = alike[-1].result
    return last.seconds / last.steps * tried.steps if last else None


def _drawn(
    arguments: Namespace,
    case: Case,
    mesh: Mesh,
    rows: Sequence[CombinationRow],
    folder: Path,
) -> list[Path]:
    # Late: matplotlib takes 0.4 s.
    from slideviz.study.plots import figures, profiler, save_figure, steps_name

    span = None if arguments.span == "none" else profiler(case, mesh, arguments.span)
    files = []
    for name, figure in figures(rows, span):
        files += save_figure(figure, folder, name)
    if not arguments.no_pictures:
        # Late: VTK takes 0.6 s, and is not needed without pictures.
        from slideviz.study.montage import DPI, montage

        for steps in dict.fromkeys(row.combination.steps for row in rows):
            pictures = montage([row for row in rows if row.combination.steps == steps], mesh)
            if pictures is not None:
                name = f"quality_{steps_name(steps)}"
                files += save_figure(pictures, folder, name, DPI, (".png",))
    return files
