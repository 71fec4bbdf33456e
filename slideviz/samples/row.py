"""The sample ``turbine-row``: a linear supersonic cascade (thesis section 4.1.3).

A layer of quadrilaterals lies around the vane, and triangles fill the rest of the channel. At
the default size the numbers are those of thesis Table 4.7, to a few per cent.
"""

from __future__ import annotations

import numpy as np

from slideviz.case.model import Case, Reduction, Scale, Translate
from slideviz.errors import CaseError
from slideviz.mesh.model import Cells, FloatArray, IntArray, Marker, Mesh
from slideviz.samples.sizing import Sizing, find_sizing
from slideviz.samples.triangles import relax
from slideviz.samples.vane import AHEAD, LENGTH, camber_line, pitch, vane_layers

LINE, TRIANGLE, QUADRILATERAL = 3, 5, 9
CELLS, AROUND, LAYERS = 224_180, 1315, 25
"""Thesis Tables 4.7 and 4.8; the layers follow from their numbers by Euler's formula."""
SIZES = (5_000, 5_000_000)
CALIBRATION = 1.035
"""Equilateral triangles to ask for, over those that the advancing front then makes."""
TOLERANCE = 1e-6
"""Of the data reduction: half the height of the thinnest cells at the default size."""
MANY = 50_000
"""Cells from which on the case asks for data reduction."""


def row_mesh(size: int) -> Mesh:
    """Return the mesh of about ``size`` cells.

    Raises
    ------
    CaseError
        ``size`` is not within ``SIZES``.
    """
    from slideviz.samples.front import front_points

    if not SIZES[0] <= size <= SIZES[1]:
        raise CaseError(f"size {size} is out of range; a turbine row has {SIZES[0]} to {SIZES[1]}")
    scale = float(np.sqrt(size / CELLS))
    around, layers = round(AROUND * scale), round(LAYERS * scale)
    rings = vane_layers(around, layers)
    wanted = CALIBRATION * (size - around * layers)
    sizing = find_sizing(rings[-1], wanted)
    sides, outline = _channel(sizing)
    ring = len(outline) + np.arange(around)
    rim = np.concatenate([*sides.values(), _loop(ring)[:, ::-1]])
    fixed = np.concatenate([outline, rings[-1]])
    points = np.concatenate([fixed, front_points(fixed, rim, sizing, wanted)])
    points, triangles = relax(points, len(fixed), rim)
    inner = len(points) + np.arange(around * layers).reshape(layers, around)
    points = np.concatenate([points, rings[:-1].reshape(-1, 2)])
    numbers = np.concatenate([inner, ring[None]])
    after = np.roll(numbers, -1, axis=1)
    quads = np.stack([numbers[:-1], numbers[1:], after[1:], after[:-1]], axis=2).reshape(-1, 4)
    cells = Cells.from_blocks([(QUADRILATERAL, quads), (TRIANGLE, triangles)])
    named = {"BLADE": _loop(numbers[0]), **sides}
    markers = [Marker(name, Cells.from_blocks([(LINE, side)])) for name, side in named.items()]
    return Mesh(points, cells, tuple(markers), name="turbine-row")


def row_case(size: int) -> Case:
    """Return the case of thesis Figure 4.11: the vane 7 % larger, and 0.001 lower.

    A mesh of many cells gets data reduction.
    """
    return Case(
        roles={
            "BLADE": "moving",
            "INFLOW": "sliding",
            "OUTFLOW": "sliding",
            "PER1": "periodic",
            "PER2": "periodic",
        },
        motions=(Scale("BLADE", (1.07,), (0.0, 0.0)), Translate("BLADE", (0.0, -0.001))),
        sliding="ps",
        periodic="moving",
        periodic_type="translational",
        steps=2,
        reduction=Reduction(tolerance=TOLERANCE) if size > MANY else None,
    )


def _channel(sizing: Sizing) -> tuple[dict[str, IntArray], FloatArray]:
    """Return the edges of each side (e, 2), the domain on their left, and the nodes (n, 2).

    PER2 is PER1 shifted by the pitch, node by node.
    """
    _, xs, ys, _ = camber_line()
    ends = np.array([-AHEAD, LENGTH - AHEAD])
    x = np.concatenate([ends[:1], xs[(xs > ends[0]) & (xs < ends[1])], ends[1:]])
    line = np.column_stack([x, np.interp(x, xs, ys)])
    half = np.array([0.0, pitch() / 2])
    below = _spread(line - half, sizing)
    inflow, outflow = (
        _spread(np.linspace(end - half, end + half, 501), sizing) for end in line[[0, -1]]
    )
    sides = [below, outflow, (below + 2 * half)[::-1], inflow[::-1]]
    outline = np.concatenate([side[:-1] for side in sides])
    loop = _loop(np.arange(len(outline)))
    parts = np.split(loop, np.cumsum([len(side) - 1 for side in sides])[:-1])
    order = {"INFLOW": 3, "OUTFLOW": 1, "PER1": 0, "PER2": 2}
    return {name: parts[k] for name, k in order.items()}, outline


def _spread(curve: FloatArray, sizing: Sizing) -> FloatArray:
    """Return points on a fine curve (m, 2), as far apart as wanted there, ends included."""
    steps = np.hypot(*np.diff(curve, axis=0).T)
    density = 1 / sizing.at((curve[1:] + curve[:-1]) / 2)
    place = np.concatenate([[0.0], np.cumsum(steps * density)])
    at = np.linspace(0.0, place[-1], max(round(place[-1]), 2) + 1)
    points = np.column_stack([np.interp(at, place, column) for column in curve.T])
    points[[0, -1]] = curve[[0, -1]]
    return points


def _loop(nodes: IntArray) -> IntArray:
    """Return the edges around a closed row of nodes: (k, 2)."""
    return np.column_stack([nodes, np.roll(nodes, -1)])
