"""VTK objects for the parts of a mesh, made once and changed in place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk

from slideviz.color_scheme import COLOUR_MAP, INVERTED_COLOUR
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.surfaces import Surface, facet_connectivity, lifted, padded

VALUES = "values"
CELL, POINT = "vtkOriginalCellIds", "vtkOriginalPointIds"
"""Names under which VTK's surfaces keep where cells and points come from."""
LIFT = 1e-4
"""Lines of a 2D mesh are drawn this part of its extent above the cells."""


@dataclass(frozen=True, eq=False)
class DrawnBoundary:
    """A boundary in the scene: its surface, its geometry and its actors.

    Attributes
    ----------
    surface : Surface
    shape : pyvista.PolyData
        Its facets.
    actor : pyvista.Actor
    """

    surface: Surface
    shape: Any
    actor: Any


@dataclass(frozen=True, eq=False)
class Band:
    """The lines that highlight a boundary, and their actor."""

    shape: Any
    actor: Any


def surface_shape(surface: Surface, points: FloatArray, lift: float = 0.0) -> Any:
    """Return a boundary as PolyData at the mesh's points (n, d); lines if the mesh is 2D."""
    at = lifted(points[surface.nodes], lift)
    flat = facet_connectivity(surface.facets)
    if surface.facets.shape[1] == 2:
        shape = pv.PolyData(at, lines=flat)
    else:
        shape = pv.PolyData(at, faces=flat)
    shape.cell_data[VALUES] = np.zeros(len(surface.facets))
    return shape


def rim_shape(surface: Surface, points: FloatArray, lift: float = 0.0) -> Any:
    """Return the lines that highlight a boundary: the boundary in 2D, its border in 3D."""
    at = lifted(points[surface.nodes], lift)
    lines = surface.facets if surface.facets.shape[1] == 2 else surface.rim
    if not len(lines):
        # A closed surface, a blade for example, has no border: its own edges show it.
        lines = np.concatenate([surface.facets[:, [0, 1]], surface.facets[:, [1, 2]]])
    return pv.PolyData(at, lines=facet_connectivity(lines))


def cell_shape(mesh: Mesh) -> Any:
    """Return all cells of a 2D mesh as PolyData, in the order of the cells."""
    cells = mesh.cells
    flat = np.insert(cells.connectivity, cells.offsets[:-1], np.diff(cells.offsets))
    shape = pv.PolyData(padded(mesh.points), faces=flat)
    shape.cell_data[VALUES] = np.zeros(len(cells))
    return shape


def set_order(shape: Any, mesh: Mesh, order: IntArray) -> None:
    """Give the data set of the cells of a 2D mesh its cells in another order, (m,)."""
    sizes = np.diff(mesh.cells.offsets)[order]
    offsets = np.concatenate(([0], np.cumsum(sizes)))
    starts = np.repeat(mesh.cells.offsets[order] - offsets[:-1], sizes)
    corners = mesh.cells.connectivity[starts + np.arange(offsets[-1])]
    shape.SetPolys(pv.CellArray.from_arrays(offsets, corners))  # type: ignore[arg-type]


def part_shape(mesh: Mesh, cells: IntArray) -> Any:
    """Return some cells (k,) of a mesh as PolyData: the cells in 2D, their outside in 3D.

    Its cell data ``CELL`` are the owners of the polygons, numbers in the mesh; its point data
    ``POINT`` the nodes.
    """
    offsets, corners, nodes = _corners_of(mesh, cells)
    points = lifted(mesh.points[nodes], 0.0)
    table = pv.CellArray.from_arrays(offsets, corners)  # type: ignore[arg-type]
    if mesh.dim == 2 or not len(cells):
        shape = pv.PolyData()
        shape.points = points
        shape.SetPolys(table)
        shape.point_data[POINT], shape.cell_data[CELL] = nodes, cells
        return shape
    grid = pv.UnstructuredGrid()
    grid.points = points
    grid.SetCells(numpy_to_vtk(mesh.cells.types[cells], deep=True), table)
    shape = grid.extract_surface(algorithm="geometry", pass_pointid=True, pass_cellid=True)
    shape.point_data[POINT] = nodes[shape.point_data[POINT]]
    shape.cell_data[CELL] = cells[shape.cell_data[CELL]]
    return shape


def _corners_of(mesh: Mesh, cells: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return offsets (k + 1,) and corners of some cells in new numbers of nodes, and the nodes."""
    every = mesh.cells
    sizes = every.offsets[cells + 1] - every.offsets[cells]
    offsets = np.concatenate(([0], np.cumsum(sizes)))
    ramp = np.arange(offsets[-1]) - np.repeat(offsets[:-1], sizes)
    old = every.connectivity[np.repeat(every.offsets[cells], sizes) + ramp]
    used = np.zeros(len(mesh.points), bool)
    used[old] = True
    return offsets, (np.cumsum(used) - 1)[old], np.flatnonzero(used)


def place(shape: Any, points: FloatArray, lift: float = 0.0) -> None:
    """Move the points of a shape, in place."""
    shape.points[:] = lifted(points, lift)
    shape.GetPoints().Modified()


def lookup_table() -> Any:
    """Return the colours of 0 to 1, with those of the ends beyond, and that of inverted cells."""
    table = pv.LookupTable(COLOUR_MAP, n_values=256, scalar_range=(0.0, 1.0))
    # Not what is below the range: a valid cell may be below one that was chosen.
    table.nan_color = INVERTED_COLOUR
    return table


_LINE = (
    "float emix = clamp(0.5 + 0.5*lineWidth - min( min( edist[0], edist[1]), edist[2]), 0.0, 1.0);"
)
"""How VTK's shader says how much of a pixel the edges of its triangle cover."""
_FADING = """vec3 sines = abs(vec3(
    edgeEqn[1].x * edgeEqn[2].y - edgeEqn[1].y * edgeEqn[2].x,
    edgeEqn[2].x * edgeEqn[0].y - edgeEqn[2].y * edgeEqn[0].x,
    edgeEqn[0].x * edgeEqn[1].y - edgeEqn[0].y * edgeEqn[1].x));
  vec3 inside = vec3(edist[0] - edgeEqn[0].z, edist[1] - edgeEqn[1].z, edist[2] - edgeEqn[2].z);
  vec3 across = abs(dot(sines, inside)) / max(sines, vec3(1e-6));
  vec3 cover = clamp(0.5 + 0.5*lineWidth - vec3(edist[0], edist[1], edist[2]), 0.0, 1.0);
  cover *= smoothstep(1.5 * lineWidth, 5.0 * lineWidth, across);
  float emix = max(max(cover.x, cover.y), cover.z);"""
"""The same, each line by itself, and none where the triangle reaches less than 1.5 widths of a
line from it: lines one beside the other would be a dark area, or dashes without multisampling.

By the law of sines that height is a sum: of the distances to the three sides, each times the sine
of the angle opposite of it.
"""

_MIX = "ambientColor = mix( ambientColor, edgeColor, emix * edgeOpacity);"
"""How VTK's shader puts them over the colour of the face."""
_STRONGER = """vec3 luma = vec3(0.30, 0.59, 0.11);
  float gap = abs(dot(ambientColor + diffuseColor / max(1.0 - emix * edgeOpacity, 0.01), luma)
    - dot(edgeColor, luma));
  float strong = mix(min(2.1 * edgeOpacity, 1.0), edgeOpacity, smoothstep(0.1, 0.5, gap));
  ambientColor = mix(ambientColor, edgeColor, emix * strong);
  diffuseColor *= (1.0 - emix * strong) / max(1.0 - emix * edgeOpacity, 0.01);"""
"""The same, less seen through where the face is nearly as dark as the line.

It is always the same colour: lines that turn from dark to light look like a jump of the values.
"""

_DEPTH = "//VTK::Depth::Impl"
_BEHIND = _DEPTH + "\n  gl_FragDepth = 1.0;"


def draw_fine_edges(actor: Any) -> None:
    """Let an actor's edges fade where its cells are hardly larger than lines.

    A VTK with other shaders draws its own edges. Actors that share a mapper must share the
    ``ShaderProperty``, too: the one that is drawn first decides for all of them.
    """
    shader = actor.GetShaderProperty()
    shader.AddFragmentShaderReplacement(_LINE, False, _FADING, False)
    shader.AddFragmentShaderReplacement(_MIX, False, _STRONGER, False)


def see_through(actor: Any, opacity: float) -> None:
    """Set the opacity of an actor; below 1 all that is opaque is drawn in front of the actor.

    Glass in front of a cut would tint it, and its colours would no longer be those of the bar.
    """
    actor.GetProperty().SetOpacity(opacity)
    glass = opacity < 1.0
    if bool(actor.GetForceOpaque()) == glass:
        return
    # Drawn with what is opaque, and as far away as can be: only the background is mixed in.
    actor.SetForceOpaque(glass)
    shader = actor.GetShaderProperty()
    if glass:
        shader.AddFragmentShaderReplacement(_DEPTH, True, _BEHIND, False)
    else:
        shader.ClearFragmentShaderReplacement(_DEPTH, True)
