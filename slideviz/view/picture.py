"""Pictures drawn off-screen: the quality of a mesh for the command line, the view at any size."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.errors import SlidevizError
from slideviz.mesh.atomic import atomic_write
from slideviz.mesh.model import FloatArray, IntArray, Mesh
from slideviz.mesh.quality import Quality
from slideviz.mesh.quality import quality as measure
from slideviz.view.actors import VALUES, lookup_table, shown_values, volume
from slideviz.view.legend import STRIP, add_colour_bar, set_letters
from slideviz.view.look import PAPER, Look
from slideviz.view.state import Frame, Session
from slideviz.view.surfaces import Surface

if TYPE_CHECKING:
    from collections.abc import Iterator

    from slideviz.view.scene import Scene

SIZE = (1600, 1000)
_NORMAL_HEIGHT = 620
"""A picture this high has letters of normal size."""


def picture(
    mesh: Mesh,
    file: str | Path,
    reference: Mesh | None = None,
    quality: Quality | None = None,
    size: tuple[int, int] = SIZE,
) -> None:
    """Write a PNG of a mesh coloured by size-skew.

    A 2D mesh is shown whole. Of a 3D mesh the half behind a plane is shown, cells uncut, with
    its boundaries; the plane goes through what moved most and along the way it moved.

    Parameters
    ----------
    mesh : Mesh
        The deformed mesh.
    file : str or Path
        The PNG file.
    reference : Mesh, optional
        The undeformed mesh: for the quality, and for where to cut.
    quality : Quality, optional
        That of ``mesh``, when it is known already.
    size : (int, int)
        Width and height in pixels.

    Raises
    ------
    SlidevizError
        The file cannot be written.
    """
    found = quality or measure(mesh, reference)
    frame = Frame(mesh, found)
    scale = _font_scale(size)
    with _plotter(size) as plotter:
        shape = volume(mesh)
        shape.cell_data[VALUES] = shown_values(frame, "size_skew")
        if mesh.dim == 3:
            shape, towards, up = _half(shape, mesh, reference)
        else:
            towards, up = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
        actor = _add_cells(plotter, shape, flat=mesh.dim == 2)
        _add_title(plotter, mesh, found, scale)
        add_colour_bar(plotter, actor.mapper, "size-skew", found.inverted > 0, (PAPER, scale))
        _aim(plotter, shape, towards, up)
        _write(plotter, Path(file), transparent=False)


def picture_of(
    session: Session,
    surfaces: Sequence[Surface],
    file: str | Path,
    *,
    size: tuple[int, int] = SIZE,
    transparent: bool = False,
    like: Scene | None = None,
) -> None:
    """Write a PNG of what a view shows, at any size.

    Parameters
    ----------
    session : Session
        What is shown and how.
    surfaces : sequence of Surface
        The boundaries of its mesh.
    file : str or Path
        The PNG file.
    size : (int, int)
        Width and height in pixels.
    transparent : bool
        Leave out the background.
    like : Scene, optional
        The view whose camera, colours and ghosts are taken.

    Raises
    ------
    SlidevizError
        The file cannot be written.
    """
    from slideviz.view.scene import Scene

    look: Look = like.look if like is not None else PAPER
    with _plotter(size) as plotter:
        scene = Scene(plotter, look, _font_scale(size))
        if transparent:
            # A gradient would stay opaque.
            plotter.set_background(look.background)
        scene.open(session, surfaces)
        if like is not None:
            scene.set_motion_ghosts(like.motion_ghosts)
            scene.take_camera(like)
        _write(plotter, Path(file), transparent)


@contextmanager
def _plotter(size: tuple[int, int]) -> Iterator[Any]:
    """Give an off-screen plotter that works without a screen, too."""
    import pyvista as pv

    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        # VTK would first try X, and complain, before it turns to EGL.
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    try:
        plotter.set_background("white")
        plotter.enable_anti_aliasing("msaa", multi_samples=8)
        yield plotter
    finally:
        plotter.close()


def _font_scale(size: tuple[int, int]) -> float:
    return max(size[1] / _NORMAL_HEIGHT, 0.6)


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


def _add_title(plotter: Any, mesh: Mesh, found: Quality, scale: float) -> None:
    text = f"{Path(mesh.name).name}: min {found.min:.4f}, mean {found.mean:.4f}"
    if found.inverted:
        text += f", {found.inverted} of {len(found)} cells inverted"
    import pyvista as pv

    title = pv.Text(text)
    set_letters(title.prop, PAPER, 16 * scale)
    title.prop.SetJustificationToCentered()
    title.prop.SetVerticalJustificationToCentered()
    title.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    title.GetPositionCoordinate().SetValue(0.5, 1.0 - 20 * scale / plotter.window_size[1])
    plotter.add_actor(title, name="title", reset_camera=False, render=False)


def _half(shape: Any, mesh: Mesh, reference: Mesh | None) -> tuple[Any, FloatArray, FloatArray]:
    """Return the cells behind a plane, the direction to the eye, and what is up."""
    base = mesh
    if reference is not None and reference.points.shape == mesh.points.shape:
        base = reference
    low, extent = base.points.min(axis=0), np.ptp(base.points, axis=0)
    centre, across = low + extent / 2.0, int(np.argmin(extent))
    shift = mesh.points - base.points
    length = np.linalg.norm(shift, axis=1)
    if length.max() > 0:
        strong = _moved_body(base, length)
        centre = base.points[strong].mean(axis=0)
        along = np.abs(shift[strong]).mean(axis=0)
        # Cut along the motion, and of such planes the one across the longest side.
        free = along < 0.5 * along.max()
        across = int(np.argmax(np.where(free, extent, -1.0))) if free.any() else int(along.argmin())
    # By where the cells were: what lay in one layer of a structured mesh stays together.
    middle = volume(base).cell_centers().points[:, across]
    behind = np.flatnonzero(middle <= centre[across] + 1e-3 * extent[across])
    half = shape.extract_cells(behind) if len(behind) else shape
    normal = np.zeros(3)
    normal[across] = 1.0
    up = np.array([0.0, 1.0, 0.0]) if across == 2 else np.array([0.0, 0.0, 1.0])
    return half, normal + 0.4 * np.cross(up, normal) + 0.3 * up, up


def _moved_body(base: Mesh, length: FloatArray) -> IntArray:
    """Return the nodes of the boundary to cut through: of those inside, what moved most.

    A blade or a block lies inside the mesh's box in two directions or three; the outer
    boundaries, which may slide further than it, in none.
    """
    low, high = base.points.min(axis=0), base.points.max(axis=0)

    def rank(nodes: IntArray) -> tuple[bool, float]:
        at = base.points[nodes]
        inside = (at.min(axis=0) > low) & (at.max(axis=0) < high)
        return int(inside.sum()) >= 2, float(length[nodes].mean())

    every = [marker.nodes for marker in base.markers if len(marker.nodes)]
    return max(every, key=rank, default=np.flatnonzero(length > 0.7 * length.max()))


def _aim(plotter: Any, shape: Any, towards: FloatArray, up: FloatArray) -> None:
    camera = plotter.camera
    centre = np.asarray(shape.center)
    camera.focal_point = centre
    camera.position = centre + towards * max(shape.length, 1e-300)
    camera.up = up
    camera.parallel_projection = True
    width, height = plotter.window_size
    strip = STRIP * _font_scale((width, height))
    camera.SetWindowCenter(strip / width, 0.06)
    plotter.renderer.ResetCameraScreenSpace(0.8)
    plotter.renderer.ResetCameraClippingRange()


def _write(plotter: Any, file: Path, transparent: bool) -> None:
    from io import BytesIO

    from PIL import Image

    if file.suffix.lower() != ".png":
        raise SlidevizError(f"{file}: pictures are PNG; end the name with .png")
    plotter.render()
    image = plotter.screenshot(return_img=True, transparent_background=transparent)
    data = BytesIO()
    Image.fromarray(np.asarray(image)).save(data, format="PNG", optimize=False)
    with atomic_write(file) as out:
        out.write(data.getvalue())
