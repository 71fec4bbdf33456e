"""A picture of the quality of a mesh, drawn off-screen for the command line."""

from __future__ import annotations

from pathlib import Path

from slideviz.color_scheme import PAPER
from slideviz.export.offscreen import check_png, offscreen, write_png, write_title
from slideviz.export.portrait import Portrait
from slideviz.mesh.model import Mesh
from slideviz.mesh.quality import Quality
from slideviz.mesh.quality import quality as measure
from slideviz.scene.moved import Zoom
from slideviz.session.state import Frame

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
