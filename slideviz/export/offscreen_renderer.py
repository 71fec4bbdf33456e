"""The offscreen renderer: pictures and images of films of a session."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from slideviz.color_scheme import PAPER
from slideviz.export.offscreen import (
    LETTERS,
    TITLE,
    check_png,
    check_size,
    image_of,
    offscreen,
    resize,
    write_title,
)
from slideviz.export.picture_options import PictureOptions, headings, panes
from slideviz.export.titles import name_mark
from slideviz.mesh.io.atomic import atomic_write
from slideviz.mesh.model import Mesh
from slideviz.mesh.surfaces import Surface, find_surfaces
from slideviz.scene.moved import Overview, Zoom, lengths
from slideviz.session.changes import seen_beside, show_frame
from slideviz.session.pieces import appearing, whole
from slideviz.session.state import Session

if TYPE_CHECKING:
    from slideviz.export.encode import Pixels
    from slideviz.scene.scene import Scene


class OffscreenRenderer:
    """An off-screen scene that draws pictures of a session, into memory or a file.

    Parameters
    ----------
    session : Session
        What is shown and how.
    surfaces : sequence of Surface
        The boundaries of its mesh.
    like : Scene, optional
        The view whose camera, colours and ghosts are taken.
    overview : Overview, optional
        What is seen, and from where, if there is no such view: every step of the runs shown.
    """

    def __init__(
        self,
        session: Session,
        surfaces: Sequence[Surface],
        like: Scene | None = None,
        overview: Overview | None = None,
    ) -> None:
        self.session = session
        self.surfaces = surfaces
        self.like = like
        self.overview = overview
        self._stack = ExitStack()
        self._plotter: Any = None
        self._scene: Any = None
        self._making = self._make()

    @classmethod
    def of_runs(cls, session: Session, zoom: Zoom = "auto") -> OffscreenRenderer:
        """Return a renderer that shows what the runs of a session did to its mesh.

        Raises
        ------
        SlidevizError
            The detail has not as many coordinates as the mesh, or is no part of it.
        """
        base = session.mesh
        assert base is not None
        lasts = [run.last.mesh for run in session.runs if run.last is not None]
        farthest = max(lasts, key=lambda mesh: float(lengths(mesh, base).max()), default=base)
        overview = Overview.of(farthest, base, zoom)
        return cls(session, find_surfaces(base) if base.dim == 2 else (), overview=overview)

    def arranging(self) -> Iterator[None]:
        """Yield between the pieces of the work before the first picture.

        Where nobody pulls all of it, the first picture does the rest at once.
        """
        # Not "yield from": whoever stops pulling would end it.
        for _ in self._making:
            yield

    def _make(self) -> Iterator[None]:
        from slideviz.scene.scene import Scene

        self._plotter = self._stack.enter_context(offscreen((640, 400)))
        yield
        self._plotter.render_window.Render()  # begins with the graphics
        yield
        self._scene = Scene(self._plotter, PAPER)
        shown, overview = PictureOptions().showing(self.session), self.overview
        part = None if overview is None else overview.cells
        yield from self._scene.opening(shown, self.surfaces, part)
        if self.like is not None:
            self._scene.set_motion_ghosts(self.like.motion_ghosts)
        if overview is None:  # else nobody waits for it
            yield from appearing(self._plotter)

    def __enter__(self) -> OffscreenRenderer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the graphics."""
        self._stack.close()

    @property
    def fills(self) -> bool:
        """Tell whether a picture may show the mesh larger than the view, which has all of it."""
        return self.like is None or self.like.sees_all(0.02)

    @property
    def shows_detail(self) -> bool:
        """Tell whether a moved part is shown large, with the rest of the mesh out of sight."""
        return self.overview is not None and self.overview.detail is not None

    @property
    def beside(self) -> Session | None:
        """Return the session of the second view, or None."""
        other = self.session.view.beside
        if other is None or (other and self.session.run(other) is None):
            return None
        return seen_beside(self.session)

    def image(self, figure: PictureOptions) -> Pixels:
        """Return the picture, (height, width, 3), or 4 when it is transparent.

        Raises
        ------
        SlidevizError
            The size cannot be drawn.
        """
        return whole(self.picturing(figure))

    def picturing(
        self, figure: PictureOptions, aim: bool = True, frame: int | None = None
    ) -> Generator[None, None, Pixels]:
        """Return the picture as `image` does, and yield between the pieces of the work.

        Nothing else may be drawn meanwhile.

        Parameters
        ----------
        figure : PictureOptions
        aim : bool
            Whether to aim the camera; else it stays where it was for the last picture.
        frame : int, optional
            Another step than the session shows.
        """
        shown = self.session if frame is None else show_frame(self.session, frame)
        check_size(figure.size)
        yield from self.arranging()
        sessions = self.shown(shown, figure)
        if aim:
            self._aim(sessions[0], figure)
        return (yield from self.drawing(sessions, figure, headings(sessions, figure)))

    def shown(self, session: Session, figure: PictureOptions) -> tuple[Session, ...]:
        """Return the sessions in a picture, from left to right: one, or two runs."""
        other = self.beside if figure.both else None
        return (session,) if other is None else ordered(session, other)

    def drawing(
        self,
        sessions: Sequence[Session],
        figure: PictureOptions,
        titles: tuple[Sequence[str], float],
    ) -> Generator[None, None, Pixels]:
        """Return the picture of one session or two with titles, and yield between the pieces.

        The camera stays where it is: in both a length is as long. Titles come with the size of
        their letters, where 1 is that of others.
        """
        words, part = titles
        if len(sessions) == 1:
            return (yield from self._pane(sessions[0], figure, (words[0], part)))
        first, second = panes(figure, figure.gap)
        left = yield from self._pane(sessions[0], first, (words[0], part))
        right = yield from self._pane(sessions[1], second, (words[1], part))
        between = np.repeat(left[:, -1:], figure.gap, axis=1)
        return np.ascontiguousarray(np.concatenate([left, between, right], axis=1))

    def pose(self, figure: PictureOptions, frame: int | None = None) -> Scene:
        """Return the scene, its camera and colours as for a picture; for a film like it."""
        shown = self.session if frame is None else show_frame(self.session, frame)
        for _ in self.arranging():
            pass
        self._aim(shown, figure)
        scene: Scene = self._scene
        return scene

    def window(self, figure: PictureOptions) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ranges of x and of y in a picture of a 2D mesh."""
        self.pose(figure)
        camera, (width, height) = self._plotter.camera, figure.size
        unit = 2.0 * camera.parallel_scale / height
        found = []
        for centre, length, shift in zip(
            camera.focal_point[:2], (width, height), camera.GetWindowCenter(), strict=True
        ):
            low = centre - 0.5 * length * (1.0 - shift) * unit
            found.append((float(low), float(low + length * unit)))
        return found[0], found[1]

    def write(self, figure: PictureOptions, file: Path) -> None:
        """Write the picture as a PNG file, whole or not at all.

        Raises
        ------
        SlidevizError
            The size cannot be drawn, the name does not end with .png, or the file cannot be
            written.
        """
        from PIL import Image

        check_png(file)
        data = BytesIO()
        known = {} if figure.dpi is None else {"dpi": (figure.dpi, figure.dpi)}
        Image.fromarray(self.image(figure)).save(data, format="PNG", **known)
        with atomic_write(file) as out:
            out.write(data.getvalue())

    def _pane(
        self,
        session: Session,
        figure: PictureOptions,
        title: tuple[str, float],
    ) -> Generator[None, None, Pixels]:
        self._prepare(session, figure)
        yield
        plotter, (words, part) = self._plotter, title
        plotter.remove_actor("title", reset_camera=False, render=False)
        if words:
            room = figure.title_room * figure.scale
            # Those of a film are smaller than its other letters: it has more to say.
            letters = TITLE * part * figure.scale / (LETTERS if figure.film else 1.0)
            write_title(plotter, words, self._scene.look, letters, room)
        name_mark(plotter, self._scene, figure.scale)
        return image_of(plotter, figure.background == "transparent")

    def _prepare(self, session: Session, figure: PictureOptions) -> None:
        """Show a session in the size of a picture; the camera stays."""
        plotter, scene = self._plotter, self._scene
        resize(plotter, figure.size)
        scene.stage.font_scale = figure.scale
        scene.stage.has_legend = figure.legend
        scene.stage.has_plate = figure.background != "transparent"
        scene.update(figure.showing(session))
        if figure.background == "transparent":
            plotter.set_background("white")  # a gradient would stay opaque
        self._keep_room(figure)

    def _keep_room(self, figure: PictureOptions) -> None:
        """Keep the rooms of legend and title free of the mesh."""
        right = self._scene.stage.strip() / figure.size[0]
        self._plotter.camera.SetWindowCenter(right, figure.top)
        self._plotter.renderer.ResetCameraClippingRange()

    def _aim(self, session: Session, figure: PictureOptions) -> None:
        """Look from where the view looks, in its colours, at what a picture shows."""
        scene, camera, like = self._scene, self._plotter.camera, self.like
        if figure.both and self.beside is not None:
            figure = panes(figure, figure.gap)[0]
        scene.set_look(PAPER if like is None or figure.background != "shown" else like.look)
        self._prepare(session, figure)
        if like is not None:
            scene.take_camera(like)
        if self.overview is not None:
            scene.look_along(self.overview, self._seen(figure))
        elif figure.fill:
            scene.fit()
        elif like is not None:
            _keep_width(scene, like)
        # Below the title; a detail has the width that was asked for.
        if camera.parallel_projection and not self.shows_detail:
            camera.parallel_scale = camera.parallel_scale / (1.0 - figure.top)
        self._keep_room(figure)

    def _seen(self, figure: PictureOptions) -> Iterator[Mesh]:
        """Yield the states of the mesh that an overview must show whole."""
        for run in self.session.runs:
            yield from (frame.mesh for frame in run.frames)
        if figure.film and self.session.mesh is not None:
            yield self.session.mesh


def ordered(first: Session, second: Session) -> tuple[Session, Session]:
    """Return the sessions of two views, the left one first."""
    return (second, first) if first.view.swapped else (first, second)


def _keep_width(scene: Scene, like: Scene) -> None:
    """Show as much of the width as another view does, in a picture that is less wide."""
    free = []
    for one in (scene, like):
        width, height = one.plotter.window_size
        free.append(max(width - one.stage.strip(), 1.0) / max(height, 1))
    if scene.plotter.camera.parallel_projection and free[0] < free[1]:
        scene.plotter.camera.parallel_scale *= free[1] / free[0]
