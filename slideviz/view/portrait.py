"""A mesh drawn off-screen by its quality: cut and aimed once, then step after step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.quality import Quality
from slideviz.view.actors import VALUES, lookup_table, shown_values, volume
from slideviz.view.legend import STRIP, add_colour_bar
from slideviz.view.look import PAPER
from slideviz.view.offscreen import font_scale
from slideviz.view.state import COLOUR_BY, ColourBy, Frame
from slideviz.view.surfaces import padded

TINY = 0.05
"""Moved boundaries smaller than this part of the mesh are shown in detail."""
MARGIN = 2.5
"""A detail is this many times as wide as the boundaries that moved."""
_NODE, _CELL = "node", "cell"


@dataclass(frozen=True)
class Detail:
    """A part of the mesh to show.

    Attributes
    ----------
    centre : tuple of float
        Its middle, two or three coordinates in the mesh's length unit.
    width : float
        How much of the mesh is seen from left to right, in the mesh's length unit.
    """

    centre: tuple[float, ...]
    width: float


Zoom = Detail | Literal["auto", "all"]
"""A given detail, the whole mesh, or the whole unless what moved is tiny in it."""


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
    colour_by : {"size_skew", "size", "skew", "displacement"}
        What the colours say.
    zoom : Detail, "auto" or "all"
        What part of the mesh is seen.
    """

    def __init__(
        self,
        plotter: Any,
        mesh: Mesh,
        base: Mesh,
        colour_by: ColourBy = "size_skew",
        zoom: Zoom = "auto",
    ) -> None:
        self.plotter = plotter
        self.colour_by = colour_by
        self._base = base
        moved = base if base.points.shape == mesh.points.shape else mesh
        cells, towards, up = _seen(mesh, moved)
        shape = _outside(volume(mesh), cells)
        self._nodes = np.asarray(shape.point_data.pop(_NODE))
        self._owners = np.asarray(shape.cell_data.pop(_CELL))
        shape.cell_data[VALUES] = np.zeros(shape.n_cells)
        self._shape = shape
        self._mapper = _add_cells(plotter, shape, flat=mesh.dim == 2).mapper
        if colour_by == "displacement":
            top = float(_lengths(mesh, base).max()) or 1.0
            self._mapper.lookup_table.scalar_range = self._mapper.scalar_range = (0.0, top)
        detail = tiny_motion(mesh, moved) if zoom == "auto" else zoom
        self.detail = detail if isinstance(detail, Detail) else None
        _aim(plotter, shape, towards, up)
        if self.detail is not None:
            _approach(plotter, self.detail)
            width, height = plotter.window_size
            _cover(plotter, "bar", (1.0 - _strip(plotter) / width, 0.0))
            _cover(plotter, "sky", (0.0, 1.0 - 40.0 * font_scale((width, height)) / height))

    def show(self, frame: Frame) -> None:
        """Draw another step of the mesh."""
        values = shown_values(frame, self.colour_by, self._base)
        self._shape.points[:] = padded(frame.mesh.points)[self._nodes]
        self._shape.GetPoints().Modified()
        self._shape.cell_data[VALUES] = values[self._owners]
        for name in list(self.plotter.scalar_bars.keys()):
            self.plotter.remove_scalar_bar(name, render=False)
        scale = font_scale(tuple(self.plotter.window_size))
        inverted = frame.quality.inverted > 0
        words = COLOUR_BY[self.colour_by]
        add_colour_bar(self.plotter, self._mapper, words, inverted, (PAPER, scale))
        self.plotter.renderer.ResetCameraClippingRange()

    def caption(self, name: str, found: Quality) -> str:
        """Return the words above a picture: what it is, and the quality of the whole mesh."""
        text = caption(name, found, self.colour_by)
        return text + (" (whole mesh; detail shown)" if self.detail else "")


def caption(name: str, found: Quality, colour_by: ColourBy = "size_skew") -> str:
    """Return what a picture shows, and the quality there, in a line."""
    what = "" if colour_by == "size_skew" else "size-skew "
    text = f"{name}: {what}min {found.min:.4f}, mean {found.mean:.4f}"
    if found.inverted:
        text += f", {found.inverted} of {len(found)} cells inverted"
    return text


def tiny_motion(mesh: Mesh, base: Mesh) -> Detail | None:
    """Return the surroundings of what moved, when it would be a dot in a view of the whole.

    That are the boundaries inside the mesh that moved: an airfoil in a wide far field. None
    when they are large enough, or when it is an outer boundary that moved.
    """
    bodies = _inner_bodies(base, _lengths(mesh, base))
    if not bodies:
        return None
    nodes = np.concatenate(bodies)
    points = np.concatenate([base.points[nodes], mesh.points[nodes]])
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    width = float(np.linalg.norm(extent))
    if width >= TINY * float(np.linalg.norm(np.ptp(base.points, axis=0))):
        return None
    return Detail(tuple((low + extent / 2.0).tolist()), MARGIN * width)


def _lengths(mesh: Mesh, base: Mesh) -> FloatArray:
    return np.asarray(np.linalg.norm(mesh.points - base.points, axis=1))


def _inner_bodies(base: Mesh, length: FloatArray) -> list[IntArray]:
    """Return the nodes of each boundary that lies inside the mesh's box and moved."""
    least = 0.05 * float(length.max())
    bodies = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return [at for at in bodies if _is_inside(base, at) and length[at].max() > least]


def _is_inside(base: Mesh, nodes: IntArray) -> bool:
    """Tell whether nodes keep off the mesh's box in two directions or more, as a blade does."""
    low, high = base.points.min(axis=0), base.points.max(axis=0)
    at = base.points[nodes]
    return int(((at.min(axis=0) > low) & (at.max(axis=0) < high)).sum()) >= 2


def _seen(mesh: Mesh, base: Mesh) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the cells to show, the direction to the eye, and what is up."""
    if mesh.dim == 2:
        return np.arange(len(mesh.cells)), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
    low, extent = base.points.min(axis=0), np.ptp(base.points, axis=0)
    centre, across = low + extent / 2.0, int(np.argmin(extent))
    length = _lengths(mesh, base)
    if length.max() > 0:
        strong = _moved_body(base, length)
        centre = base.points[strong].mean(axis=0)
        along = np.abs(mesh.points - base.points)[strong].mean(axis=0)
        # Cut along the motion, and of such planes the one across the longest side.
        free = along < 0.5 * along.max()
        across = int(np.argmax(np.where(free, extent, -1.0))) if free.any() else int(along.argmin())
    # By where the cells were: what lay in one layer of a structured mesh stays together.
    middle = volume(base).cell_centers().points[:, across]
    behind = np.flatnonzero(middle <= centre[across] + 1e-3 * extent[across])
    normal = np.zeros(3)
    normal[across] = 1.0
    up = np.array([0.0, 1.0, 0.0]) if across == 2 else np.array([0.0, 0.0, 1.0])
    cells = behind if len(behind) else np.arange(len(mesh.cells))
    return cells, normal + 0.4 * np.cross(up, normal) + 0.3 * up, up


def _moved_body(base: Mesh, length: FloatArray) -> IntArray:
    """Return the nodes of the boundary to cut through: of those inside, what moved most.

    A blade or a block lies inside the mesh's box in two directions or three; the outer
    boundaries, which may slide further than it, in none.
    """

    def rank(nodes: IntArray) -> tuple[bool, float]:
        return _is_inside(base, nodes), float(length[nodes].mean())

    every = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return max(every, key=rank, default=np.flatnonzero(length > 0.7 * length.max()))


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


def _aim(plotter: Any, shape: Any, towards: FloatArray, up: FloatArray) -> None:
    camera = plotter.camera
    centre = np.asarray(shape.center)
    camera.focal_point = centre
    camera.position = centre + towards * max(shape.length, 1e-300)
    camera.up = up
    camera.parallel_projection = True
    camera.SetWindowCenter(_strip(plotter) / plotter.window_size[0], 0.06)
    plotter.renderer.ResetCameraScreenSpace(0.8)
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
