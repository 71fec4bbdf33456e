"""``slideviz section``: draws a section of a mesh."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.argument_types import record
from slideviz.case.model import Case
from slideviz.case.section_shapes import SECTION_SHAPES
from slideviz.cli.mesh_source import open_mesh, optional_case, progress_of
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.report import Report, reference_words, save_report
from slideviz.cli.terminal import DONE, INVERTED
from slideviz.errors import CaseError
from slideviz.export.flat_section import section as draw
from slideviz.mesh.model import FloatArray, Mesh, Skin
from slideviz.mesh.periodic import Pair
from slideviz.mesh.quality import Quality
from slideviz.plots.figure_io import empty_figure, write_figure
from slideviz.plots.meridional import draw_meridional, meridional_bins
from slideviz.plots.section_paint import paint
from slideviz.plots.section_picture import SectionInRun, SectionStyle, require_picture_name
from slideviz.sections.model import Section
from slideviz.sections.span import SpanWalls, between_walls, find_walls
from slideviz.session.passages import find_period, find_periods, keeps, passages
from slideviz.streaming.block_quality import quality_blocks
from slideviz.streaming.source import cut_cells

WALLS_OPTION = "--between HUB,SHROUD"


@record
class _Scene:
    mesh: Mesh
    base: Mesh | None
    """`mesh`, `base`: the mesh and, where there is a reference, the undeformed one; with
    ``--stream`` only the cells that the section can cut."""
    quality: Quality  # quality of the cells of ``mesh``
    chosen: Section
    matrices: dict[int, FloatArray]
    """dict of int to (4, 4) float64: the transformation of each passage, by number."""
    outer: FloatArray  # (n, d): points that have the extent of the whole mesh
    reference: Path | None  # the file of the undeformed mesh


def main(arguments: Namespace) -> int:
    """Draw a section of a mesh to a file; return the exit code."""
    _check_usage(arguments)
    require_picture_name(arguments.output)
    case = optional_case(arguments)
    require_output_paths(
        arguments, OutputPath(arguments.output, "-o"), OutputPath(arguments.json, "--json")
    )
    if arguments.meridional:
        return _meridional(arguments, case)
    scene = _scene(arguments, case)
    style = SectionStyle(
        size=arguments.size or SectionStyle.size,
        trimmed=arguments.size is None,
        edges=arguments.edges,
        in_space=arguments.in_space,
        name=Path(scene.mesh.name).name,
        title=arguments.title,
        axes=arguments.axes,
    )
    shown = draw(
        arguments.output,
        scene.mesh,
        scene.chosen,
        scene.base,
        rated=scene.quality,
        color=arguments.color,
        color_range=arguments.range,
        color_map=arguments.map,
        passages=scene.matrices,
        outer=scene.outer,
        style=style,
    )
    return _report(arguments, scene, shown)


def _scene(arguments: Namespace, case: Case | None) -> _Scene:
    """Return the cells that the section can cut; of a 2D mesh all, which are shown around it."""
    with open_mesh(arguments, case) as opened:
        mesh = opened.source.mesh
        path = opened.reference
        case = opened.case
        if mesh.dim == 2 and arguments.stream:
            raise CaseError(
                f"{mesh.name} is 2D, where all cells are shown around the cut; leave out --stream"
            )
        chosen, matrices = _section_and_passages(arguments, mesh, opened.read_base, case)
        moves = [matrix for matrix in matrices.values() if not keeps(chosen, matrix)]
        if len(moves) < len(matrices):
            moves.append(np.eye(4))
        with progress_of(arguments, "quality") as tick:
            blocks = quality_blocks(opened.source, arguments.metric, tick)
            if isinstance(mesh, Skin):
                near = cut_cells(blocks, chosen, moves).part_of(mesh)
                outer = mesh.points
            else:
                [near] = blocks
                outer = mesh.points[mesh.cells.nodes]
    assert near.quality is not None
    return _Scene(near.mesh, near.base, near.quality, chosen, matrices, outer, path)


def _report(arguments: Namespace, scene: _Scene, shown: SectionInRun) -> int:
    """Print the numbers of the cut or write them as JSON, and return the exit code."""
    mesh = scene.mesh
    chosen = scene.chosen
    summary = shown.paint.summary(shown.ids)
    summary["worst_cell"] = mesh.cell_number(int(summary["worst_cell"]))
    report: Report = {
        "mesh": mesh.name,
        "section": _as_json(chosen),
        "color": shown.paint.label,
        "reference": str(scene.reference) if scene.reference else None,
        "passages": len(shown.pieces),
        "picture": str(arguments.output),
        **summary,
    }
    if save_report(arguments, report):
        print(f"{Path(mesh.name).name}: {chosen.describe(mesh.dim)}")
        print(f"  {shown.paint.sentence(shown.ids)}, worst is cell {summary['worst_cell']}")
        if shown.note or scene.reference:
            print(f"  {reference_words(scene.reference)}")
        print(f"  {arguments.output}")
    return INVERTED if summary["inverted"] else DONE


def _meridional(arguments: Namespace, case: Case | None) -> int:
    """Draw the meridional view of a mesh to a file; return the exit code."""
    with open_mesh(arguments, case) as opened:
        mesh = opened.source.mesh
        reference = opened.reference
        case = opened.case
        base = opened.read_base()
        quality = opened.quality(arguments)
    undeformed = base or mesh
    periods = find_periods(undeformed, case)
    walls = find_walls(undeformed, case, periods, arguments.between, remedy=WALLS_OPTION)
    painted = paint(mesh, quality, arguments.color, base)
    painted = painted.within(*arguments.range) if arguments.range else painted
    bins = meridional_bins(undeformed, walls)
    wide, high = arguments.size or (1600, 1000)
    figure = empty_figure((8.0, 8.0 * high / wide), wide / 8.0, "constrained")
    draw_meridional(figure, bins, replace(painted, color_map=arguments.map))
    if not arguments.axes:
        figure.axes[0].set_axis_off()
    summary = painted.summary(np.arange(len(mesh.cells))[quality.file_rows])
    name = Path(mesh.name).name
    facts = f"{painted.label}: {painted.worst} {summary[painted.worst]:.4g}, "
    facts += f"mean {summary['mean']:.4g}; {summary['cells']:,} cells"
    if arguments.title:
        figure.suptitle(f"{name}: from {walls.words}\n{facts}", fontsize=10.0)
    write_figure(figure, arguments.output, figure.dpi)
    zones = [
        {
            "between": list(one.walls),
            "places": one.places.tolist(),
            "means": [
                [None if np.isnan(x) else x for x in row]
                for row in one.means(painted.values).tolist()
            ],
        }
        for one in bins
    ]
    report: Report = {
        "mesh": mesh.name,
        "color": painted.label,
        "reference": str(reference) if reference else None,
        "picture": str(arguments.output),
        **(zones[0] if len(zones) == 1 else {"zones": zones}),
        **summary,
    }
    if save_report(arguments, report):
        print(f"{name}: from {walls.words}\n  {facts}")
        print(f"  {reference_words(reference)}\n  {arguments.output}")
    return INVERTED if summary["inverted"] else DONE


def _check_usage(arguments: Namespace) -> None:
    if arguments.color == "displacement" and not (arguments.reference or arguments.case):
        arguments.wrong_usage("--color displacement needs --reference UNDEFORMED")
    if arguments.meridional:
        for option in ("stream", "copies", "unrolled", "in_space", "whole"):
            if getattr(arguments, option):
                name = "3d" if option == "in_space" else option
                arguments.wrong_usage(f"--meridional shows no section, so leave out --{name}")
        return
    if arguments.unrolled and arguments.asked.section.terms.flat != "unrolled":
        able = (f"--{name}" for name, row in SECTION_SHAPES.items() if row.flat == "unrolled")
        arguments.wrong_usage(f"--unrolled is for a {' or '.join(able)}; a plane is flat already")
    if arguments.between and arguments.asked.section.kind != "span":
        arguments.wrong_usage("--between names the walls of --span and --meridional; give one")


def _section_and_passages(
    arguments: Namespace,
    mesh: Mesh,
    read_base: Callable[[], Mesh | None],
    case: Case | None,
) -> tuple[Section, dict[int, FloatArray]]:
    """Return the section, and the transformation (4, 4) of each passage."""
    asked = arguments.asked
    chosen = replace(
        asked.section, whole_cells=mesh.dim == 2 if arguments.whole is None else arguments.whole
    )
    pair: Pair | None = None
    if not asked.axis or arguments.copies or chosen.kind == "span":
        # Of the undeformed mesh: a deformed one need not be exactly periodic.
        pair = find_period(read_base() or mesh, case)
    if not asked.axis and case is not None:
        chosen = replace(chosen, direction=case.axis, origin=case.origin)
    elif not asked.axis and pair is not None and pair.kind == "rotational":
        chosen = replace(chosen, direction=pair.axis, origin=pair.origin)
    if chosen.kind == "span":
        about = chosen.direction, chosen.origin
        base = read_base() or mesh
        periods = find_periods(base, case)
        walls = find_walls(base, case, periods, arguments.between, about, WALLS_OPTION)
        chosen = between_walls(chosen, walls)
    if not arguments.copies:
        return chosen, {0: np.eye(4)}
    if pair is None:
        if find_periods(read_base() or mesh, case):
            raise CaseError(
                f"{mesh.name}: its zones have different periods, so there are no copies of all "
                "together; choose one with --zone, or leave out --copies"
            )
        raise CaseError(
            f"{mesh.name}: no boundaries match each other, so there is no period for --copies; "
            "name a case with MARKER_PERIODIC by --case"
        )
    return chosen, passages(pair, arguments.copies)


def _between(walls: SpanWalls | None) -> Report:
    """Return hub and shroud of each zone with a span."""
    pairs = [[one.hub, one.shroud] for one in walls.channels] if walls is not None else []
    if not pairs:
        return {}
    return {"between": pairs[0] if len(pairs) == 1 else pairs}


def _as_json(chosen: Section) -> Report:
    size = chosen.terms.size
    sizes = {} if size is None else {size.field: chosen.size}
    return {
        "kind": chosen.kind,
        "origin": list(chosen.origin),
        "direction": list(chosen.direction),
        "radius": None,
        **sizes,
        **_between(chosen.walls),
        "whole": chosen.whole_cells,
    }
