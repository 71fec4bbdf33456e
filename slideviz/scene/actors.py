"""VTK objects for the parts of a mesh, made once and changed in place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from vtkmodules.util.numpy_support import numpy_to_vtk

from slideviz.argument_types import record
from slideviz.color_scheme import COLOR_MAP, INVERTED_COLOR
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.surfaces import Surface, facet_connectivity, lifted
from slideviz.sections.polygons import Polygons

VALUES = "values"  # name of the cell data by which shapes are colored
CELL = "vtkOriginalCellIds"
POINT = "vtkOriginalPointIds"
"""Names of cell and point data with the indices of cells and nodes in the mesh."""

LIFT = 1e-4  # height at which lines of a 2D mesh are drawn above its cells, relative to its extent


@record
class DrawnBoundary:
    """A boundary in the scene: its surface, data set and actor."""

    surface: Surface
    shape: Any  # its facets
    actor: Any


@record
class Band:
    """What is drawn of a boundary besides its facets: data set and actor."""

    shape: Any
    actor: Any


def surface_shape(surface: Surface, points: FloatArray, lift: float = 0.0) -> Any:
    """Return a boundary as PolyData, at points (n, d) of all nodes; lines if the mesh is 2D.

    ``lift`` raises a 2D mesh's boundary above z = 0.
    """
    at = lifted(points[surface.nodes], lift)
    flat = facet_connectivity(surface.facets)
    if surface.facets.shape[1] == 2:
        shape = pv.PolyData(at, lines=flat)
    else:
        shape = pv.PolyData(at, faces=flat)
    shape.cell_data[VALUES] = np.zeros(len(surface.facets))
    return shape


def rim_shape(surface: Surface, points: FloatArray, lift: float = 0.0) -> Any:
    """Return the lines that highlight a boundary as PolyData: itself in 2D, its border in 3D.

    Parameters are those of `surface_shape`; a closed surface has edges of its facets instead.
    """
    at = lifted(points[surface.nodes], lift)
    lines = surface.facets if surface.facets.shape[1] == 2 else surface.rim
    if not len(lines):
        # A closed surface, such as a blade, has no border.
        lines = np.concatenate([surface.facets[:, [0, 1]], surface.facets[:, [1, 2]]])
    return pv.PolyData(at, lines=facet_connectivity(lines))


def part_shape(mesh: Mesh, cells: IntArray) -> Any:
    """Return the cells with indices (k,) as PolyData: themselves in 2D, their outer faces in 3D.

    Its cell data `CELL` are the indices in the mesh of the cells that the polygons belong to, its
    point data `POINT` those of the nodes. A part of a polyhedron stands for all of it, and the
    first one for its polygons.
    """
    if mesh.whole_cells is not None:
        cells = np.flatnonzero(np.isin(mesh.whole_cells, mesh.whole_cells[cells]))
    part = mesh.cells.take(cells)
    nodes = part.nodes
    place = np.empty(len(mesh.points), np.int64)
    place[nodes] = np.arange(len(nodes))
    points = lifted(mesh.points[nodes], 0.0)
    table = pv.CellArray.from_arrays(part.offsets, place[part.connectivity])  # type: ignore[arg-type]
    if mesh.dim == 2 or not len(cells):
        shape = pv.PolyData()
        shape.points = points
        shape.SetPolys(table)
        shape.point_data[POINT] = nodes
        shape.cell_data[CELL] = cells
    else:
        grid = pv.UnstructuredGrid()
        grid.points = points
        grid.SetCells(numpy_to_vtk(part.types, deep=True), table)
        shape = grid.extract_surface(algorithm="geometry", pass_pointid=True, pass_cellid=True)
        shape.point_data[POINT] = nodes[shape.point_data[POINT]]
        shape.cell_data[CELL] = cells[shape.cell_data[CELL]]
    if mesh.whole_cells is not None:
        faces = shape.GetPolys()
        flat = faces.GetOffsetsArray(), faces.GetConnectivityArray(), shape.cell_data[CELL]
        arrays = (np.array(one, np.int64) for one in flat)
        polygons = Polygons(points, *arrays).of_file_cells(mesh, sides=mesh.dim == 3)
        shape.SetPolys(polygon_table(polygons))
        shape.cell_data[CELL] = polygons.cells
    return shape


def polygon_table(polygons: Polygons) -> Any:
    """Return polygons as VTK's array of cells."""
    return pv.CellArray.from_arrays(polygons.offsets, polygons.connectivity)  # type: ignore[arg-type]


def polygon_shape(polygons: Polygons, lift: float = 0.0) -> Any:
    """Return polygons, or lines, as PolyData, raised by ``lift`` in z, with values of 0."""
    shape = pv.PolyData()
    shape.points = polygons.points + np.array([0.0, 0.0, lift])
    if len(polygons) and polygons.sizes.max() == 2:
        shape.SetLines(polygon_table(polygons))
    else:
        shape.SetPolys(polygon_table(polygons))
    shape.cell_data[VALUES] = np.zeros(len(polygons))
    return shape


def place(shape: Any, points: FloatArray, lift: float = 0.0) -> None:
    """Move the points of a data set to points (n, d), raised by ``lift``, in place."""
    shape.points[:] = lifted(points, lift)
    shape.GetPoints().Modified()


def add_overlay(plotter: Any, actor: Any, name: str) -> None:
    """Add an actor that lies in the plane of the view, over the scene."""
    plotter.add_actor(actor, name=name, reset_camera=False, render=False, pickable=False)


def remove_actor(plotter: Any, name: str) -> None:
    """Remove an actor, if there is one of that name."""
    plotter.remove_actor(name, reset_camera=False, render=False)


def lookup_table() -> Any:
    """Return a table of colors for 0 to 1, clamped; inverted cells have the color of NaN."""
    table = pv.LookupTable(COLOR_MAP, n_values=256, scalar_range=(0.0, 1.0))
    # Not the color below the range, where valid cells may be too, if the user chose the range.
    table.nan_color = INVERTED_COLOR
    return table


_LINE = (
    "float emix = clamp(0.5 + 0.5*lineWidth - min( min( edist[0], edist[1]), edist[2]), 0.0, 1.0);"
)
"""The line of VTK's shader that computes how much of a pixel its triangle's edges cover."""
_FADING = """vec3 sines = abs(vec3(
    edgeEqn[1].x * edgeEqn[2].y - edgeEqn[1].y * edgeEqn[2].x,
    edgeEqn[2].x * edgeEqn[0].y - edgeEqn[2].y * edgeEqn[0].x,
    edgeEqn[0].x * edgeEqn[1].y - edgeEqn[0].y * edgeEqn[1].x));
  vec3 inside = vec3(edist[0] - edgeEqn[0].z, edist[1] - edgeEqn[1].z, edist[2] - edgeEqn[2].z);
  vec3 across = abs(dot(sines, inside)) / max(sines, vec3(1e-6));
  vec3 cover = clamp(0.5 + 0.5*lineWidth - vec3(edist[0], edist[1], edist[2]), 0.0, 1.0);
  cover *= smoothstep(1.5 * lineWidth, 5.0 * lineWidth, across);
  float emix = max(max(cover.x, cover.y), cover.z);"""
"""The replacement of `_LINE`: an edge fades where the triangle's height above it is small.

It is drawn in full from a height of 5 line widths on, and not below 1.5: dense lines would look
like a dark area, or like dashes without multisampling. The height above a side follows from the
law of sines: the sum of a pixel's distances to the three sides, each times the sine of the angle
opposite that side, divided by the sine of the angle opposite the side in question.
"""

_MIX = "ambientColor = mix( ambientColor, edgeColor, emix * edgeOpacity);"
"""The line of VTK's shader that blends the edges over the color of the face."""
_STRONGER = """vec3 luma = vec3(0.30, 0.59, 0.11);
  float gap = abs(dot(ambientColor + diffuseColor / max(1.0 - emix * edgeOpacity, 0.01), luma)
    - dot(edgeColor, luma));
  float strong = mix(min(2.1 * edgeOpacity, 1.0), edgeOpacity, smoothstep(0.1, 0.5, gap));
  ambientColor = mix(ambientColor, edgeColor, emix * strong);
  diffuseColor *= (1.0 - emix * strong) / max(1.0 - emix * edgeOpacity, 0.01);"""
"""The replacement of `_MIX`: edges are more opaque where the face is nearly as dark as they are.

Their color is the same everywhere: a change from dark to light lines would look like a jump of
the values.
"""

_DEPTH = "//VTK::Depth::Impl"
_BEHIND = _DEPTH + "\n  gl_FragDepth = 1.0;"
"""The replacement of `_DEPTH`: the greatest depth for every pixel."""


def draw_fine_edges(actor: Any) -> None:
    """Make an actor's edges fade where its cells are hardly larger than the lines.

    It replaces lines of VTK's shader; a VTK whose shader has other lines draws its usual edges.
    Actors that share a mapper must share the ``ShaderProperty`` too: that of the actor drawn first
    is used for all of them.
    """
    shader = actor.GetShaderProperty()
    shader.AddFragmentShaderReplacement(_LINE, False, _FADING, False)
    shader.AddFragmentShaderReplacement(_MIX, False, _STRONGER, False)


def see_through(actor: Any, opacity: float) -> None:
    """Set the opacity of an actor; below 1 it is drawn behind all opaque actors.

    In front of a cut it would tint the colors, which would no longer be those of the color bar.
    """
    actor.GetProperty().SetOpacity(opacity)
    glass = opacity < 1.0
    if bool(actor.GetForceOpaque()) == glass:
        return
    # Drawn in the opaque pass at the greatest depth: it is blended with the background only.
    actor.SetForceOpaque(glass)
    shader = actor.GetShaderProperty()
    if glass:
        shader.AddFragmentShaderReplacement(_DEPTH, True, _BEHIND, False)
    else:
        shader.ClearFragmentShaderReplacement(_DEPTH, True)


def draw_in_front(mapper: Any) -> None:
    """Give the lines and points of a mapper a depth offset that draws them before everything."""
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyLineOffsetParameters(0.0, _IN_FRONT)
    mapper.SetRelativeCoincidentTopologyPointOffsetParameter(_IN_FRONT)


_IN_FRONT = -66_000.0  # depth offset in 1/65536 of the depth range
