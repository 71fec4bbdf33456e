"""Pictures drawn off-screen: the quality of a mesh for the command line, the view at any size."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality
from slideviz.mesh.quality import quality as measure
from slideviz.view.look import PAPER, Look
from slideviz.view.moved import Zoom
from slideviz.view.offscreen import check_png, font_scale, offscreen, write_png, write_title
from slideviz.view.portrait import Portrait
from slideviz.view.state import Frame, Session
from slideviz.view.surfaces import Surface

if TYPE_CHECKING:
    from slideviz.view.scene import Scene

SIZE = (1600, 1000)


def picture(
    mesh: Mesh,
    file: str | Path,
    reference: Mesh | None = None,
    quality: Quality | None = None,
    size: tuple[int, int] = SIZE,
    zoom: Zoom = "auto",
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
    zoom : Detail, "auto" or "all"
        What part of the mesh is seen; "auto" is the whole, unless what moved is tiny in it.

    Raises
    ------
    SlidevizError
        The size cannot be drawn, or the file cannot be written.
    """
    check_png(Path(file))
    found = quality or measure(mesh, reference)
    with offscreen(size) as plotter:
        base = reference if reference is not None else mesh
        portrait = Portrait(plotter, mesh, base, zoom=zoom)
        portrait.show(Frame(mesh, found))
        write_title(plotter, portrait.caption(Path(mesh.name).name, found), PAPER)
        write_png(plotter, Path(file))


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
        The size cannot be drawn, or the file cannot be written.
    """
    from slideviz.view.scene import Scene

    look: Look = like.look if like is not None else PAPER
    with offscreen(size) as plotter:
        scene = Scene(plotter, look, font_scale(size))
        if transparent:
            # A gradient would stay opaque, and so would a plate.
            scene.stage.has_plate = False
            plotter.set_background(look.background)
        scene.open(session, surfaces)
        if like is not None:
            scene.set_motion_ghosts(like.motion_ghosts)
            scene.take_camera(like)
        write_png(plotter, Path(file), transparent)
