"""What ``slideviz section`` does."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slideviz.case.section_shapes import SECTION_SHAPES

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.mesh.model import FloatArray, Mesh
    from slideviz.mesh.periodic import Pair
    from slideviz.sections.model import Section


def section(arguments: argparse.Namespace) -> int:
    """Draw a section of a mesh."""
    from slideviz import Case, quality, read
    from slideviz.cli.exit_codes import DONE, INVERTED
    from slideviz.cli.places import Output, note_case, require_places
    from slideviz.cli.reference import NONE, reference_of, words_of
    from slideviz.cli.report import save_json
    from slideviz.errors import CaseError
    from slideviz.plots.around import surroundings
    from slideviz.plots.section_paint import paint
    from slideviz.plots.section_picture import SectionStyle, require_picture_name, section_picture
    from slideviz.sections.cut import Cutter
    from slideviz.sections.polygons import joined
    from slideviz.session.passages import show_passages

    _check_usage(arguments)
    require_picture_name(arguments.output)
    case = Case.read(arguments.case) if arguments.case else None
    if case is not None:
        note_case(arguments, case)
    require_places(arguments, Output(arguments.output, "-o"), Output(arguments.json, "--json"))
    mesh = read(arguments.mesh, zone=arguments.zone)
    known = reference_of(arguments, mesh, case)
    base = known[1] if known else None
    found = quality(mesh, reference=base, metric=arguments.metric)
    painted = paint(mesh, found, arguments.color, base)
    painted = replace(painted, colour_map=arguments.map)
    chosen, matrices = _section_and_passages(arguments, mesh, base, case)
    cutter = Cutter.of(mesh)
    pieces = show_passages(cutter, mesh.points, chosen, matrices)
    # Of the mesh itself, where it is cut: its copies have the same cells.
    ids = pieces[0].cell_ids if len(pieces[0]) else joined(list(pieces.values())).cell_ids
    if not len(ids):
        why = chosen.shape.miss(chosen, mesh.points[cutter.used])
        raise CaseError(f"{mesh.name}: the {chosen.describe(mesh.dim)} {why}")
    if arguments.range:
        painted = painted.within(*arguments.range)
    elif painted.label == "displacement":
        painted = painted.up_to(ids)
    name = Path(mesh.name).name
    note = "" if base is not None or painted.label == "skew" else NONE
    size, trimmed = arguments.size or SectionStyle.size, arguments.size is None
    style = SectionStyle(size, trimmed, arguments.edges, arguments.in_space, name, note=note)
    around = surroundings(cutter, mesh.points, matrices)
    section_picture(pieces, chosen, painted, arguments.output, style, around)
    summary = painted.summary(ids)
    report: dict[str, Any] = {
        "mesh": mesh.name,
        "section": _as_json(chosen),
        "color": painted.label,
        "reference": str(known[0]) if known else None,
    }
    report |= {"passages": len(pieces), "picture": str(arguments.output), **summary}
    text = save_json(arguments.json, report) if arguments.json else None
    if text is not None:
        print(text, end="")
    else:
        print(f"{name}: {chosen.describe(mesh.dim)}")
        print(f"  {painted.sentence(ids)}, worst is cell {summary['worst_cell']}")
        if note or known:
            print(f"  {words_of(known)}")
        print(f"  {arguments.output}")
    return INVERTED if summary["inverted"] else DONE


def _check_usage(arguments: argparse.Namespace) -> None:
    """Leave with code 2 where options contradict each other."""
    if arguments.color == "displacement" and not (arguments.reference or arguments.case):
        arguments.wrong_usage("--color displacement needs --reference UNDEFORMED")
    if arguments.unrolled and arguments.asked.section.shape.terms.flat != "unrolled":
        able = (f"--{name}" for name, row in SECTION_SHAPES.items() if row.flat == "unrolled")
        arguments.wrong_usage(f"--unrolled is for a {' or '.join(able)}; a plane is flat already")


def _section_and_passages(
    arguments: argparse.Namespace, mesh: Mesh, base: Mesh | None, case: Case | None
) -> tuple[Section, dict[int, FloatArray]]:
    """Return the section that is asked for, and the transformation of each passage."""
    import numpy as np

    from slideviz.errors import CaseError
    from slideviz.session.passages import find_period, passages

    asked = arguments.asked
    chosen = replace(
        asked.section, whole=mesh.dim == 2 if arguments.whole is None else arguments.whole
    )
    pair: Pair | None = None
    if not asked.axis or arguments.copies:
        # The undeformed mesh, for a deformed one need not repeat exactly.
        pair = find_period(base or mesh, case)
    if not asked.axis and case is not None:
        chosen = replace(chosen, direction=case.axis, origin=case.origin)
    elif not asked.axis and pair is not None and pair.kind == "rotational":
        chosen = replace(chosen, direction=pair.axis, origin=pair.origin)
    if not arguments.copies:
        return chosen, {0: np.eye(4)}
    if pair is None:
        raise CaseError(
            f"{mesh.name}: no boundaries match each other, so there is no period for --copies; "
            "name a case with MARKER_PERIODIC by --case"
        )
    return chosen, passages(pair, arguments.copies)


def _as_json(chosen: Section) -> dict[str, Any]:
    size = chosen.shape.terms.size
    own = {} if size is None else {size.field: chosen.size}
    return {
        "kind": chosen.kind,
        "origin": list(chosen.origin),
        "direction": list(chosen.direction),
        "radius": None,
        **own,
        "whole": chosen.whole,
    }
