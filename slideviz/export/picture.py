"""Pictures of the results of runs, for the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from slideviz.case.model import Case
from slideviz.export.encode import Pixels
from slideviz.export.offscreen import check_png
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.export.titles import DETAIL, caption
from slideviz.mesh.model import Mesh
from slideviz.scene.moved import Zoom
from slideviz.session.opening import of_runs
from slideviz.session.pieces import run_to_end
from slideviz.session.state import Run, Session, StepFrame

SIZE = PictureOptions.size
"""Default width and height in pixels."""

WHITE = 250
"""Least red, green and blue (0 to 255) of a pixel that counts as background."""

_SMALL = 10
"""Mean size of cells in pixels below which they are drawn without edges."""


def picture(
    session: Session, file: str | Path, size: tuple[int, int] = SIZE, zoom: Zoom = "auto"
) -> None:
    """Write a PNG of a mesh in the colors of its quality, with name and quality as title.

    A 2D mesh is shown whole. Of a 3D mesh, the whole cells behind a plane are shown, which goes
    through the boundary that moved most, along its displacement.

    Parameters
    ----------
    session : Session
        Shows a run, or a mesh alone (`slideviz.session.opening.of_runs`).
    file : str or Path
        The PNG file.
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
    assert session.frame is not None
    with OffscreenRenderer.of_runs(session, zoom) as renderer:
        words = caption(Path(session.frame.mesh.name).name, session.frame.quality)
        words += DETAIL if renderer.shows_detail else ""
        renderer.write(PictureOptions(size, title=True, heading=words), Path(file))


def pictures_alike(frames: Sequence[StepFrame], base: Mesh, side: int) -> list[Pixels]:
    """Return a square picture (side, side, 3) of each mesh, without legend, all from one camera.

    Parameters
    ----------
    frames : sequence of StepFrame
        The deformed meshes, at least one.
    base : Mesh
        The undeformed mesh.
    side : int
        Width and height of each picture in pixels.
    """
    runs = [Run(k, Case(), (frame,), "done") for k, frame in enumerate(frames, start=1)]
    session = of_runs(StepFrame(base, frames[0].quality), runs)
    with OffscreenRenderer.of_runs(session) as renderer:
        options = PictureOptions((side, side), legend=False, edges=False, both=False, film=True)
        scene = renderer.pose(options)

        def draw(run: Run, options: PictureOptions) -> Pixels:
            shown = replace(session, shown=run.number)
            return run_to_end(renderer.drawing([shown], options, ([""], 1.0)))

        inked = int((draw(runs[0], options) < WHITE).any(axis=2).sum())
        # The edges of small cells would hide their colors.
        options = replace(options, edges=inked >= scene.polygons * _SMALL**2)
        return [draw(run, options) for run in runs]
