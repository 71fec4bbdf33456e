"""Pictures of sections by one call, drawn by matplotlib: VTK need not be installed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from slideviz.argument_types import check_types
from slideviz.errors import CaseError, not_one_of
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import Quality, quality
from slideviz.plots.cells import surroundings
from slideviz.plots.section_paint import paint
from slideviz.plots.section_picture import (
    SectionInRun,
    SectionStyle,
    require_picture_name,
    section_picture,
)
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session.passages import show_passages
from slideviz.terms import COLOR_MAPS, NO_REFERENCE, ColorMap, Quantity


@check_types
def section(
    path: str | Path,
    mesh: Mesh,
    at: Section,
    reference: Mesh | None = None,
    *,
    rated: Quality | None = None,
    color: Quantity = "size-skew",
    color_range: tuple[float, float] | None = None,
    color_map: ColorMap = "viridis",
    passages: Mapping[int, FloatArray] | None = None,
    outer: FloatArray | None = None,
    style: SectionStyle | None = None,
) -> SectionInRun:
    """Write a picture of a section of a mesh; return what it shows.

    Parameters
    ----------
    path : str or Path
        The picture: .png, .svg or .pdf; one that exists is replaced.
    mesh : Mesh
        What to cut.
    at : Section
        Where: a plane, cylinder or cone.
    reference : Mesh, optional
        The undeformed mesh, with the same cells; needed for displacements.
    rated : Quality, optional
        The quality of the cells, if it is known already.
    color : {"size-skew", "size", "skew", "displacement"}
        What the colors say.
    color_range : (float, float), optional
        Ends of the color bar.
    color_map : {"viridis", "cividis", "plasma", "inferno", "gray"}
        The color map, which color-blind people can read.
    passages : mapping of int to (4, 4), optional
        The transformation of each passage to draw, by number; only the mesh itself (0) when left
        out.
    outer : (n, d), optional
        Points with the extent of the mesh, for messages, where ``mesh`` is only a part of it.
    style : SectionStyle, optional
        Size and parts of the picture.

    Returns
    -------
    SectionInRun
        Its ``ids`` (k,) are the numbers of the cells that are cut, ``paint`` has their values.

    Raises
    ------
    CaseError
        The section misses the mesh, the file has another ending, or a quantity or color map is
        unknown.
    SlidevizError
        The file cannot be written.

    Examples
    --------
    >>> import slideviz as sv
    >>> square = sv.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], sv.Cells.from_types([9], [0, 1, 2, 3]))
    >>> line = sv.Section("plane", (0.5, 0.0, 0.0), (1.0, 0.0, 0.0))
    >>> sv.section("middle.svg", square, line).ids
    array([0])
    """
    require_picture_name(Path(path))
    if color_map not in COLOR_MAPS:
        raise CaseError(f"color_map: {not_one_of(color_map, COLOR_MAPS)}")
    measured = quality(mesh, reference=reference) if rated is None else rated
    matrices = {0: np.eye(4)} if passages is None else passages
    painted = replace(paint(mesh, measured, color, reference), color_map=color_map)
    cutter = Cutter.of(mesh)
    pieces = show_passages(cutter, mesh.points, at, matrices)
    note = "" if reference is not None or painted.label == "skew" else NO_REFERENCE
    around = surroundings(cutter, mesh.points, matrices)
    shown = SectionInRun(pieces, painted, around, note=note)
    if not shown.drawn:
        why = at.shape.miss(at, mesh.points[mesh.cells.nodes] if outer is None else outer)
        raise CaseError(f"{mesh.name}: the {at.describe(mesh.dim)} {why}")
    if color_range:
        shown = replace(shown, paint=painted.within(*color_range))
    elif painted.label == "displacement":
        shown = replace(shown, paint=painted.up_to(shown.ids))
    style = style or SectionStyle(trimmed=True, name=Path(mesh.name).name)
    section_picture([shown], at, path, style)
    return shown
