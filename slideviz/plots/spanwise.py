"""Quality along the span: minimum and mean of the cells in layers of equal height.

Layers are along the radius about an axis (blades; thesis Figure 6.19), or along a direction. A
cell belongs to the layer in which its middle (the mean of its nodes) lies.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from slideviz.argument_types import record
from slideviz.errors import SlidevizError
from slideviz.mesh.axis_frame import in_axis_frame
from slideviz.mesh.model import FloatArray, IntArray, Mesh, frozen_array
from slideviz.plots.style import PRINT, Style, add_legend, style_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_LAYERS = 40  # most layers, if their number is not given


@record
class Profile:
    """Quality in layers from one end of the span to the other."""

    label: str  # name of the run
    coordinate: str  # of the layers: r, x, y, z or span
    edges: FloatArray  # (k + 1,): borders of the layers, in the mesh's length unit
    minimum: FloatArray
    mean: FloatArray
    """`minimum`, `mean` (k,): minimum and mean in each layer; NaN in a layer without cells."""
    count: IntArray  # (k,): cells in each layer
    series: int = 0  # series number (see `slideviz.plots.style.Style.series`)

    @property
    def position(self) -> FloatArray:
        """Return the middles of the layers (k,), in the mesh's length unit."""
        return (self.edges[1:] + self.edges[:-1]) / 2.0


def along(
    mesh: Mesh,
    values: FloatArray,
    coordinate: Literal["r", "x", "y", "z"],
    axis: Sequence[float] = (0.0, 0.0, 1.0),
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    layers: int | None = None,
    label: str = "",
) -> Profile:
    """Return the quality in layers of equal height along x, y or z, or along the radius.

    ``mesh``: the deformed mesh, or the undeformed one to keep layers of cells together. ``axis``
    and ``origin``: of the radius, a direction and a point. The rest is as of `in_layers`, as are
    its errors; raises SlidevizError, too, if the mesh has no such direction, and MeshError if the
    axis has length zero.
    """
    if coordinate == "r":
        local = in_axis_frame(mesh.points, axis, origin)
        height = np.hypot(local[:, 0], local[:, 1])
    elif "xyz".index(coordinate) < mesh.dim:
        height = mesh.points[:, "xyz".index(coordinate)]
    else:
        raise SlidevizError(
            f"direction {coordinate!r} has no length in this {mesh.dim}D mesh; choose another"
        )
    return in_layers(mesh, values, height, coordinate, layers=layers, label=label)


def in_layers(
    mesh: Mesh,
    values: FloatArray,
    height: FloatArray,
    coordinate: str,
    *,
    layers: int | None = None,
    label: str,
) -> Profile:
    """Return the quality in layers of equal height, of nodal coordinates ``height`` (n,).

    ``values`` (m,): one for each cell. ``layers``: at least 1; by default one for each layer of
    cells of usual height, 40 at most. Raises SlidevizError if there is not a value for each cell,
    no layer, or the mesh has no span.
    """
    cells = mesh.cells
    if len(values) != len(cells):
        raise SlidevizError(
            f"{len(values)} values for {len(cells)} cells; give one value for each cell"
        )
    if layers is not None and layers < 1:
        raise SlidevizError(f"{layers} layers; at least 1 is needed")
    used = height[cells.nodes]
    low = float(used.min())
    high = float(used.max())
    if not high > low:
        raise SlidevizError(f"{mesh.name} has no extent along {coordinate}; choose another")
    at = height[cells.connectivity]
    first = cells.offsets[:-1]
    middle = cells.means(height)
    usual = np.median(np.maximum.reduceat(at, first) - np.minimum.reduceat(at, first))
    layers = layers or round(min(max((high - low) / max(usual, 1e-300), 1.0), MOST_LAYERS))
    layer = np.clip(((middle - low) / (high - low) * layers).astype(np.int64), 0, layers - 1)
    count = np.bincount(layer, minlength=layers)
    minimum = np.full(layers, np.inf)
    np.minimum.at(minimum, layer, values)
    total = np.bincount(layer, weights=values, minlength=layers)
    empty = count == 0
    return Profile(
        label,
        coordinate,
        frozen_array(np.linspace(low, high, layers + 1)),
        frozen_array(np.where(empty, np.nan, minimum)),
        frozen_array(np.where(empty, np.nan, total / np.maximum(count, 1))),
        frozen_array(count),
    )


def spanwise(
    axes: Axes,
    profiles: Sequence[Profile],
    what: Literal["minimum", "mean"] = "minimum",
    style: Style = PRINT,
) -> None:
    """Draw the minimum or mean quality along the span, which is the vertical axis."""
    coordinate = profiles[0].coordinate if profiles else "r"
    style_axes(axes, style, f"{what} quality [-]", f"{coordinate} [mesh units]")
    ends = []
    for index, profile in enumerate(profiles):
        values: FloatArray = getattr(profile, what)
        there = np.isfinite(values)
        axes.plot(
            values[there],
            profile.position[there],
            # Shifted, so that markers of coinciding lines are side by side.
            markevery=(index, max(len(profiles), int(there.sum()) // 8)),
            label=profile.label,
            **(style.line(profile.series) | {"markersize": 4}),
        )
        ends += [profile.edges[0], profile.edges[-1]]
    axes.set_xlim(0.0, 1.02)
    if ends:
        axes.set_ylim(min(ends), max(ends))
    add_legend(axes, style)
