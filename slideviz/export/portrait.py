"""A mesh drawn off-screen by its quality: cut and aimed once, then step after step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.export.offscreen import font_scale
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.quality import Quality
from slideviz.mesh.surfaces import padded
from slideviz.scene.actors import VALUES, lookup_table, volume
from slideviz.scene.color_legend import STRIP, add_colour_bar, place_bar
from slideviz.scene.moved import Detail, Zoom, half_of, lengths, require_detail, tiny_motion
from slideviz.session.state import Frame
from slideviz.terms import COLOUR_BY, ColourBy

FILL = 0.86
"""How much of the free height or width a mesh takes; the rest is for title and margins."""
_NODE, _CELL = "node", "cell"


class Portrait:
    """Cells of a mesh in an off-screen plotter, coloured by what ``colour_by`` says.

    A 2D mesh is shown from above. Of a 3D mesh the half behind a plane is shown, cells uncut,
    with its boundaries; the plane goes through what moved most and along the way it moved. Cut
    and camera stay as they are for every frame.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Where to draw.
    mesh : Mesh
        The deformed mesh; cut and camera suit it.
    base : Mesh
        The undeformed mesh, or ``mesh`` again where that is not known.
    colour_by : {"size-skew", "size", "skew", "displacement"}
        What the colours say.
    zoom : Detail, "auto" or "all"
        What part of the mesh is seen.
    seen : sequence of Mesh
        More steps of it that the camera must see whole.

    Raises
    ------
    SlidevizError
        The detail has not as many coordinates as the mesh, or is no part of it.
    """

    def __init__(
        self,
        plotter: Any,
        mesh: Mesh,
        base: Mesh,
        colour_by: ColourBy = "size-skew",
        zoom: Zoom = "auto",
        seen: Sequence[Mesh] = (),
    ) -> None:
        require_detail(zoom, base)
        self.plotter = plotter
        self.colour_by = colour_by
        self._base = base
        moved = base if base.points.shape == mesh.points.shape else mesh
        cells, towards, up = half_of(mesh, moved)
        shape = _outside(volume(mesh), cells)
        self._nodes = np.asarray(shape.point_data.pop(_NODE))
        self._owners = np.asarray(shape.cell_data.pop(_CELL))
        shape.cell_data[VALUES] = np.zeros(shape.n_cells)
        self._shape = shape
        self._mapper = _add_cells(plotter, shape, flat=mesh.dim == 2).mapper
        if colour_by == "displacement":
            top = float(lengths(mesh, base).max()) or 1.0
            self._mapper.lookup_table.scalar_range = self._mapper.scalar_range = (0.0, top)
        detail = tiny_motion(mesh, moved) if zoom == "auto" else zoom
        self.detail = detail if isinstance(detail, Detail) else None
        clouds = [padded(each.points)[self._nodes] for each in (mesh, *seen)]
        _aim(plotter, np.concatenate(clouds), towards, up)
        if self.detail is not None:
            _approach(plotter, self.detail)
            width, height = plotter.window_size
            _cover(plotter, "bar", (1.0 - _strip(plotter) / width, 0.0))
            _cover(plotter, "sky", (0.0, 1.0 - 40.0 * font_scale((width, height)) / height))

    def show(self, frame: Frame) -> None:
        """Draw another step of the mesh."""
        values = frame.shown_values(self.colour_by, self._base)
        self._shape.points[:] = padded(frame.mesh.points)[self._nodes]
        self._shape.GetPoints().Modified()
        self._shape.cell_data[VALUES] = values[self._owners]
        for name in list(self.plotter.scalar_bars.keys()):
            self.plotter.remove_scalar_bar(name, render=False)
        scale = font_scale(tuple(self.plotter.window_size))
        inverted = frame.quality.inverted > 0
        what = COLOUR_BY[self.colour_by]
        add_colour_bar(self.plotter, self._mapper, what, inverted, (PAPER, scale))
        place_bar(self.plotter, what.label, 0.0, scale)
        self.plotter.renderer.ResetCameraClippingRange()

    def caption(self, name: str, found: Quality) -> str:
        """Return the words above a picture: what it is, and the quality of the whole mesh."""
        text = caption(name, found, self.colour_by)
        return text + (" (whole mesh; detail shown)" if self.detail else "")


def caption(name: str, found: Quality, colour_by: ColourBy = "size-skew") -> str:
    """Return what a picture shows, and the quality there, in a line."""
    what = "" if colour_by == "size-skew" else "size-skew "
    text = f"{name}: {what}min {found.min:.4f}, mean {found.mean:.4f}"
    if found.inverted:
        text += f", {found.inverted} of {found.cells} cells inverted"
    return text


def _outside(grid: Any, cells: IntArray) -> Any:
    """Return the faces of some cells as PolyData that know their nodes and cells."""
    grid.point_data[_NODE] = np.arange(grid.n_points)
    grid.cell_data[_CELL] = np.arange(grid.n_cells)
    part = grid.extract_cells(cells) if len(cells) < grid.n_cells else grid
    return part.extract_surface(algorithm="geometry", pass_pointid=False, pass_cellid=False)


def _add_cells(plotter: Any, shape: Any, flat: bool) -> Any:
    actor = plotter.add_mesh(
        shape,
        scalars=VALUES,
        cmap=lookup_table(),
        show_scalar_bar=False,
        show_edges=True,
        edge_color=PAPER.edge,
        edge_opacity=0.6,
        lighting=not flat,
        # Together 1: more would give other colours than the bar has.
        ambient=0.62,
        diffuse=0.38,
        copy_mesh=False,
    )
    # Edges as thin as they can be: boundary layers would turn black otherwise.
    actor.prop.line_width = 0.5
    return actor


def _strip(plotter: Any) -> float:
    """Return how many pixels at the right the colour bar takes."""
    return STRIP * font_scale(tuple(plotter.window_size))


def _aim(plotter: Any, points: FloatArray, towards: FloatArray, up: FloatArray) -> None:
    """Look at all points from a direction, beside the colour bar and below the title."""
    right = np.cross(up, towards)
    axes = np.array([right, np.cross(towards, right), towards])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    low, high = (points @ axes.T).min(axis=0), (points @ axes.T).max(axis=0)
    extent = high - low
    width, height = plotter.window_size
    free = max(width - _strip(plotter), 1.0)
    camera = plotter.camera
    camera.focal_point = axes.T @ (low + extent / 2.0)
    camera.position = camera.focal_point + axes[2] * max(np.linalg.norm(extent), 1e-300)
    camera.up = up
    camera.parallel_projection = True
    camera.SetWindowCenter(_strip(plotter) / width, 0.06)
    half = max(extent[1] / height, extent[0] / free) * height / 2.0
    camera.parallel_scale = max(half / FILL, 1e-300)
    plotter.renderer.ResetCameraClippingRange()


def _approach(plotter: Any, detail: Detail) -> None:
    """Keep the direction and look at a part only."""
    camera = plotter.camera
    offset = np.asarray(camera.position) - np.asarray(camera.focal_point)
    centre = np.zeros(3)
    centre[: len(detail.centre)] = detail.centre
    camera.focal_point, camera.position = centre, centre + offset
    width, height = plotter.window_size
    free = max(width - _strip(plotter), 1.0)
    camera.parallel_scale = detail.width / min(free, 1.3 * height) * height / 2.0
    plotter.renderer.ResetCameraClippingRange()


def _cover(plotter: Any, name: str, corner: tuple[float, float]) -> None:
    """Paint the view white right of and above a corner (parts of width and height).

    Title and colour bar stand there: over the cells of a detail they could not be read.
    """
    import pyvista as pv
    from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCoordinate, vtkPolyDataMapper2D

    left, low = corner
    points = np.array([[left, low, 0.0], [1.0, low, 0.0], [1.0, 1.0, 0.0], [left, 1.0, 0.0]])
    place = vtkCoordinate()
    place.SetCoordinateSystemToNormalizedViewport()
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(pv.PolyData(points, faces=[4, 0, 1, 2, 3]))
    mapper.SetTransformCoordinate(place)
    cover = vtkActor2D()
    cover.SetMapper(mapper)
    cover.GetProperty().SetColor(*pv.Color(PAPER.background).float_rgb)
    plotter.add_actor(cover, name=f"cover:{name}", reset_camera=False, render=False)
