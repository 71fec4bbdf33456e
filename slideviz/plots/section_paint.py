"""The values by which a section's cells are colored, and a summary of those that are cut."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, cast

import numpy as np

from slideviz.argument_types import record
from slideviz.color_scheme import COLOR_MAP
from slideviz.errors import CaseError, not_one_of
from slideviz.mesh.metrics import rated_metric
from slideviz.mesh.model import FloatArray, IntArray, Mesh, row_norms
from slideviz.mesh.quality import INVERTED, Quality
from slideviz.mesh.walls import walls
from slideviz.plots.ticks import rounded_out
from slideviz.session.colors import with_drawable_colors
from slideviz.session.state import Session, StepFrame
from slideviz.terms import (
    QUANTITIES,
    RANKED,
    RATED,
    WALL_VALUES,
    ColorBy,
    Metric,
    Quantity,
    Range,
    field_of,
    quantity_of,
)


def clipped(values: FloatArray, limits: Range) -> FloatArray:
    """Return values (k,) clipped to limits; NaN and inf stay (inverted, at no wall)."""
    return np.where(np.isinf(values), values, np.clip(values, *limits))


@record
class Paint:
    """A value for every cell of a mesh, with limits and color map."""

    label: ColorBy  # the quantity
    values: FloatArray  # (m,): its value in every cell
    inverted: np.ndarray
    """(m,): whether each cell is inverted, and drawn in the color of inverted cells."""
    limits: Range  # (float, float): the values at the ends of the color map
    color_map: str = COLOR_MAP  # a color map of matplotlib

    def within(self, low: float, high: float) -> Paint:
        """Return the paint with other limits.

        Raises CaseError if they are not finite or not in order.
        """
        if not (np.isfinite([low, high]).all() and low < high):
            raise CaseError(
                f"color range {low:.6g} to {high:.6g}: the first number must be the smaller one"
            )
        return replace(self, limits=(low, high))

    def up_to(self, cells: IntArray) -> Paint:
        """Return the paint with limits up to the largest finite value of cells (c,)."""
        low = self.limits[0]
        values = self.values[cells]
        high = float(values[np.isfinite(values)].max(initial=low))
        return replace(self, limits=(low, high if high > low else low + 1.0))

    @property
    def unbounded(self) -> bool:
        """Return whether the quantity has no largest value, so that limits follow the cells."""
        if self.label == "displacement":
            return True
        if self.label in WALL_VALUES:
            return False
        term = RANKED[self.label]
        return term.colors is None and np.isinf(term.range[1])

    def shown(self, cells: IntArray) -> FloatArray:
        """Return the values (c,) of cells (c,), clipped to the limits.

        Of an inverted cell NaN, of one without a number of walls inf.
        """
        values = np.clip(self.values[cells], *self.limits)
        if self.label in WALL_VALUES:
            values[np.isnan(values)] = np.inf
        return np.where(self.inverted[cells], np.nan, values)

    @property
    def worst(self) -> Literal["min", "max"]:
        """Return the end that counts: the worst values, or the largest displacement."""
        if self.label == "displacement" or RANKED[self.label].best == "low":
            return "max"
        return "min"

    def summary(self, cells: IntArray) -> dict[str, float | int]:
        """Return number, min, mean, max, inverted and worst cell of cells (c,), c > 0."""
        count = len(cells)
        bad = int(np.count_nonzero(self.inverted[cells]))
        if self.label in WALL_VALUES and not np.isnan(self.values[cells]).all():
            cells = cells[~np.isnan(self.values[cells])]
        mine = self.values[cells]
        rated = -mine if self.worst == "max" and self.label != "displacement" else mine
        worst = cells[np.argmin(np.where(self.inverted[cells], -np.inf, rated))]
        return {
            "cells": count,
            "min": float(mine.min()),
            "mean": float(mine.mean()),
            "max": float(mine.max()),
            "inverted": bad,
            "worst_cell": int(worst),
        }

    def sentence(self, cells: IntArray, of: int | None = None, shown: str = "") -> str:
        """Return the label, with the `numbers` of cells (c,)."""
        return f"{self.label}: {self.numbers(cells, of, shown)}"

    def numbers(self, cells: IntArray, of: int | None = None, shown: str = "") -> str:
        """Return the summary of cells (c,) in words.

        If they are only those of ``of`` cells that a threshold leaves, ``shown`` is its text.
        """
        facts = self.summary(cells)
        end = self.worst
        number = ".4g" if end == "max" else ".4f"
        count = f"{len(cells):,} cell{'s' if len(cells) > 1 else ''} cut"
        if of is not None:
            count = f"{len(cells):,} of {of:,} cells cut (shown: {shown})"
        if facts["inverted"]:
            count += f", {facts['inverted']:,} inverted"
        if np.isnan(facts["min"]) and self.label in WALL_VALUES:
            return f"no cell at a wall; {count}"
        return f"{end} {facts[end]:{number}}, mean {facts['mean']:{number}}; {count}"


def shown_paint(session: Session, frame: StepFrame | None = None) -> Paint:
    """Return the values of the shown frame, or another one, in the colors of the view.

    A view in the colors of roles has size-skew.
    """
    frame = frame or session.frame
    session = with_drawable_colors(session)
    assert frame is not None
    what = quantity_of(session.view.color_by)
    inverted = frame.quality.status == INVERTED
    values = frame.values(what, session.reference)
    return Paint(what, values, inverted, session.color_range, session.color_map)


def paint(mesh: Mesh, quality: Quality, by: Quantity, reference: Mesh | None = None) -> Paint:
    """Return the paint of a mesh: a quantity of every cell, with its usual limits.

    Raises CaseError if the quantity is unknown, or the displacement is wanted without the mesh that
    it is measured from, or with another. ``quality``: that of the mesh. ``by``: the displacement of
    a cell is the mean of the lengths by which its nodes moved. ``reference``: the undeformed mesh;
    the displacement needs it.
    """
    if by not in QUANTITIES:
        raise CaseError(f"color: {not_one_of(by, QUANTITIES)}")
    inverted = quality.status == INVERTED
    if by in WALL_VALUES:
        name = field_of(by)
        layers = walls(mesh, reference).with_layers()
        if name not in layers.values:
            raise CaseError(f"{by} compares with the undeformed mesh; give that mesh as reference")
        values = layers.at_cells(name)
        known = values[np.isfinite(values)]
        ends = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        return Paint(by, values, inverted, rounded_out(*ends))
    if by != "displacement":
        values = rated_metric(mesh, cast(Metric, by), reference, quality).of_cells
        painted = Paint(by, values, inverted, RATED[by].colors or RATED[by].range)
        return painted.up_to(np.arange(len(values))) if painted.unbounded else painted
    if reference is None or reference.points.shape != mesh.points.shape:
        raise CaseError(
            "the displacement is measured from the undeformed mesh; give that mesh as reference"
        )
    length = row_norms(mesh.points - reference.points)
    values = mesh.cells.means(length)
    return Paint(by, values, inverted, (0.0, 1.0)).up_to(np.arange(len(values)))
