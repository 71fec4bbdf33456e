"""What each command does; ``run`` has a module of its own."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.cli.run_command import cell_data, run

if TYPE_CHECKING:
    from slideviz.mesh.quality import Quality

COMMANDS = ("run", "info", "quality", "section", "film", "compare", "sample", "keys", "shots")

__all__ = ["info", "keys", "quality", "run", "sample", "shots", "window"]


def window(arguments: argparse.Namespace) -> int:
    """Open the window, with a file if one is given."""
    from slideviz.errors import CaseError
    from slideviz.export.screen import missing_screen

    if arguments.file is not None and not arguments.file.exists():
        raise CaseError(
            f"{arguments.file}: there is no such file, and no such command "
            f"(commands: {', '.join(COMMANDS)})"
        )
    why = missing_screen() if sys.platform.startswith("linux") else ""
    if why:
        raise CaseError(f"there is no screen ({why}); `slideviz run CASE` works without one")
    from slideviz.gui.app import launch

    return launch(arguments.file, run=arguments.run)


def info(arguments: argparse.Namespace) -> int:
    """Tell what is in a mesh file."""
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


def quality(arguments: argparse.Namespace) -> int:
    """Tell the quality of a mesh, compared with the undeformed one if it is given."""
    from slideviz import Case, read, write
    from slideviz import quality as rate
    from slideviz.cli.exit_codes import DONE, INVERTED
    from slideviz.cli.places import Output, note_case, require_places
    from slideviz.cli.reference import reference_of, words_of
    from slideviz.cli.report import (
        histogram_lines,
        quality_lines,
        quality_report,
        save_json,
        table,
    )

    is_table = arguments.output is not None and arguments.output.suffix.lower() == ".csv"
    case = Case.read(arguments.case) if arguments.case else None
    if case is not None:
        note_case(arguments, case)
    require_places(
        arguments,
        Output(arguments.output, "-o", is_mesh=not is_table),
        Output(arguments.json, "--json"),
    )
    mesh = read(arguments.mesh, zone=arguments.zone)
    base = reference_of(arguments, mesh, case)
    found = rate(mesh, reference=base[1] if base else None, metric=arguments.metric)
    report = quality_report(mesh, found) | {"reference": str(base[0]) if base else None}
    if is_table:
        _write_csv(arguments.output, found)
    elif arguments.output:
        write(arguments.output, mesh, cell_data=cell_data(arguments.output, found))
    text = save_json(arguments.json, report) if arguments.json else None
    if text is not None:
        print(text, end="")
    else:
        print(f"{arguments.mesh}: size-skew, metric {found.metric}")
        print(f"  {words_of(base)}")
        print(quality_lines(found))
        print("worst cells:")
        print(table([(w["cell"], w["type"], f"{w['quality']:.6f}") for w in report["worst"]]))
        print("cells by quality:")
        print(histogram_lines(found))
    return INVERTED if found.inverted else DONE


def _write_csv(path: Path, found: Quality) -> None:
    """Write id, size-skew, size, skew and status of each cell."""
    from slideviz.errors import CaseError
    from slideviz.mesh.io.atomic import atomic_write
    from slideviz.terms import CELL_STATES

    columns = zip(found.values, found.size, found.skew, found.status, strict=True)
    lines = ["cell,size_skew,size,skew,status"]
    for cell, (value, size, skew, status) in enumerate(columns):
        numbers = f"{float(value)!r},{float(size)!r},{float(skew)!r}"
        lines.append(f"{cell},{numbers},{CELL_STATES[status]}")
    with atomic_write(path, CaseError) as file:
        file.write(("\n".join(lines) + "\n").encode())


def sample(arguments: argparse.Namespace) -> int:
    """Write a sample case, or list the samples."""
    from slideviz.cli.exit_codes import DONE
    from slideviz.cli.report import table
    from slideviz.samples.table import SAMPLES, VARIANTS, write_sample

    if arguments.name is None:
        print("samples (slideviz sample NAME -o DIR):")
        print(table([(name, about) for name, about in SAMPLES.items()]))
        print("variants (--variant):")
        print(table([(name, ", ".join(kinds)) for name, kinds in VARIANTS.items()]))
        return DONE
    folder = arguments.output or Path(arguments.name)
    paths = write_sample(arguments.name, folder, arguments.size, arguments.variant, arguments.force)
    for path in paths:
        print(path)
    case = next(path for path in paths if path.suffix == ".cfg")
    print(f"now: slideviz run {case}   or: slideviz {case}")
    return DONE


def shots(arguments: argparse.Namespace) -> int:
    """Draw the window in typical states."""
    from slideviz.cli.exit_codes import DONE
    from slideviz.gui.shots import shots as draw

    folder = arguments.output
    if folder is None:
        if not _is_checkout(Path.cwd()):
            arguments.wrong_usage(
                "this folder is no checkout of slideviz, whose screenshots/ are drawn again; "
                "name another folder with -o DIR"
            )
        folder = Path("screenshots")
    print(f"drawing into {folder}/; pictures of the same names there are replaced", flush=True)
    for path in draw(folder):
        print(path)
    return DONE


def _is_checkout(folder: Path) -> bool:
    """Tell whether a folder has slideviz's own sources, and so the pictures of its README."""
    try:
        return 'name = "slideviz"' in (folder / "pyproject.toml").read_text(encoding="utf-8")
    except (OSError, ValueError):
        return False


def keys(_: argparse.Namespace) -> int:
    """Print the reference of all case keys."""
    from slideviz.case.cfg import describe_keys
    from slideviz.cli.exit_codes import DONE

    print(describe_keys())
    return DONE
