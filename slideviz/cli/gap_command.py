"""``slideviz gap``: throat, tip gap and other smallest distances, before and after a run."""

from __future__ import annotations

from argparse import Namespace
from itertools import zip_longest
from math import isfinite
from pathlib import Path

from slideviz import deform, gaps, quality
from slideviz.cli.mesh_source import read_inputs
from slideviz.cli.progress import Bar
from slideviz.cli.report import print_remarks, save_report, table
from slideviz.cli.terminal import DONE, INVERTED
from slideviz.design.blade_gaps import TOUCHING, Gap
from slideviz.errors import CaseError, Remark

LISTED = (0.1, 0.3, 0.5, 0.7, 0.9)  # the places that the summary has


def main(arguments: Namespace) -> int:
    """Measure the smallest distances of a case; return the exit code."""
    if arguments.output is not None:
        # Late: matplotlib takes 0.4 s.
        from slideviz.plots.section_picture import require_picture_name

        require_picture_name(arguments.output)
    case, mesh = read_inputs(arguments)
    mesh_file = case.mesh_file
    before = gaps(case, mesh, arguments.between)
    if not before:
        names = dict.fromkeys((*case.markers_with("moving"), *mesh.marker_names))
        none = "there is no gap at its ends"
        if mesh.dim == 2:
            none = "tip gaps by span are for 3D meshes"
        raise CaseError(
            f"{mesh_file}: there is one blade, which does not repeat, and {none}, so there is "
            f"nothing to measure; name boundaries, e.g. --between {','.join([*names][:2])}"
        )
    after: tuple[Gap, ...] = ()
    warnings: tuple[Remark, ...] = ()
    inverted = 0
    if case.motions:
        with Bar(not arguments.quiet, begun=arguments.begun) as bar:
            *_, last = deform(case, mesh, bar)
        after = gaps(case, last.mesh, arguments.between, reference=mesh)
        warnings = last.messages
        inverted = quality(last.mesh, mesh).inverted
    report = {
        "case": str(case.source or ""),
        "mesh": str(mesh_file),
        "inverted": inverted,
        "gaps": [
            {
                **({} if one.zone is None else {"zone": one.zone}),
                "name": one.name,
                "between": [one.first, one.second],
                "along": one.along or None,
                "places": one.places.tolist(),
                "undeformed": one.summary(),
                "deformed": None if other is None else other.summary(),
            }
            for one, other in zip_longest(before, after)
        ],
    }
    if arguments.output is not None:
        if not any(one.along for one in before):
            why = (
                "in 2D each distance is one number, not a curve; leave out -o"
                if mesh.dim == 2
                else "there are no curves over the span; set SPAN, or leave out -o"
            )
            raise CaseError(f"{mesh_file}: {why}")
        _draw(arguments.output, before, after)
    if save_report(arguments, report):
        for one, other in zip_longest(before, after):
            print(_lines(one, other))
        if arguments.output is not None:
            print(f"  {arguments.output}")
    print_remarks(warnings, quiet=arguments.quiet)
    return INVERTED if inverted else DONE


def _lines(before: Gap, after: Gap | None) -> str:
    """Return the lines on a gap: its smallest distance, and a table of those by place."""
    measured = [one for one in (before, after) if one is not None]
    words = before.words
    if not any(one.distance for one in measured):
        words += f": {TOUCHING}"
        if not any(isfinite(value) for one in measured for value in one.distances):
            return words
    listed: list[tuple[str, int | None]] = [("smallest", None)]
    listed += [
        (f"{100 * place:.0f} %", int(abs(before.places - place).argmin()))
        for place in LISTED
        if before.along
    ]
    rows: list[tuple[object, ...]] = [(before.along, "before")]
    rows[0] += ("after", "change") if after is not None else ()
    for word, k in listed:
        both = [float(one.distance if k is None else one.distances[k]) for one in measured]
        if not all(map(isfinite, both)):  # no blade there
            rows.append((word, *("-" for _ in both)))
            continue
        change = (f"{100 * (both[1] / both[0] - 1):+.2f} %",) if len(both) > 1 and both[0] else ()
        rows.append((word, *both, *change))
    return f"{words}\n{table(rows)}"


def _draw(path: Path, before: tuple[Gap, ...], after: tuple[Gap, ...]) -> None:
    # Late: matplotlib takes 0.4 s.
    from slideviz.plots.figure_io import empty_figure, write_figure
    from slideviz.plots.gap_curves import draw_gaps
    from slideviz.plots.session_plots import UNDEFORMED

    plots = len({one.name for one in before})
    figure = empty_figure((3.4 * plots, 3.0), 300.0, "constrained")
    measured = [("undeformed", UNDEFORMED, before)] + ([("deformed", 0, after)] if after else [])
    draw_gaps(figure, measured)
    write_figure(figure, path)
