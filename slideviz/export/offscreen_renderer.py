"""The offscreen renderer, which draws pictures of a session and the images of its films."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from PIL.PngImagePlugin import PngInfo
from pyvista import Color

from slideviz.case.cfg import case_text
from slideviz.case.model import Case
from slideviz.color_scheme import PAPER
from slideviz.export.encode import Pixels
from slideviz.export.offscreen import (
    LETTERS,
    TITLE,
    WEB_PAGE,
    check_drawable,
    check_picture,
    image_of,
    offscreen,
    png_bytes,
    resize,
    write_title,
)
from slideviz.export.picture_options import PictureOptions, headings, line_between, panes
from slideviz.export.titles import DETAIL, caption, label_marked_cell
from slideviz.export.web_page import web_page
from slideviz.mesh.model import Mesh
from slideviz.mesh.surfaces import Surface, find_surfaces
from slideviz.scene.overview import Overview, Zoom, lengths
from slideviz.scene.scene import Scene
from slideviz.session.changes import show_frame
from slideviz.session.motions import shown_case
from slideviz.session.opening import session_of_runs, with_case_view
from slideviz.session.panes import second_session, shown_views
from slideviz.session.pieces import render_in_groups, run_to_end
from slideviz.session.saving import view_to_case
from slideviz.session.session_file import PICTURE_KEY
from slideviz.session.state import Run, Session, StepFrame
from slideviz.system.atomic import write_whole


class OffscreenRenderer:
    """An off-screen scene that draws pictures of a session, into memory or a file.

    ``surfaces``: the boundaries of its mesh. ``like``: the scene of a view whose camera, color
    scheme and ghosts are used. ``overview``: the cells and the camera without such a view; all
    steps of the runs are fitted. ``place``: the camera without either (`Camera.view`).
    """

    def __init__(
        self,
        session: Session,
        surfaces: Sequence[Surface],
        like: Scene | None = None,
        overview: Overview | None = None,
        place: tuple[float, ...] | None = None,
    ) -> None:
        self.session = session
        self.surfaces = surfaces
        self.like = like
        self.overview = overview
        self.place = place
        self._stack = ExitStack()
        self._plotter: Any = None
        self._scene: Any = None
        self._making = self._make()

    @classmethod
    def of_runs(cls, session: Session, zoom: Zoom = "auto") -> OffscreenRenderer:
        """Return a renderer with the overview of the run with the largest displacement.

        Or, for the zoom ``view``, with the view of the session's case. Raises SlidevizError if the
        detail has not as many coordinates as the mesh, or is outside the mesh.
        """
        base = session.opened_mesh
        if zoom == "view":
            place = session.case.view.get("VIEW_CAMERA")
            return cls(with_case_view(session), find_surfaces(base), place=place)
        lasts = [run.last.mesh for run in session.runs if run.last is not None]
        farthest = max(lasts, key=lambda mesh: float(lengths(mesh, base).max()), default=base)
        overview = Overview.of(farthest, base, zoom)
        return cls(session, find_surfaces(base) if base.dim == 2 else (), overview=overview)

    def prepare_steps(self) -> Iterator[None]:
        """Prepare the plotter and the scene, yielding between pieces of this work.

        What remains of it is done with the first picture.
        """
        # Not "yield from": closing this generator would close the other.
        for _ in self._making:
            yield

    def _make(self) -> Iterator[None]:
        self._plotter = self._stack.enter_context(offscreen((640, 400)))
        yield
        self._plotter.render_window.Render()  # initializes OpenGL
        yield
        self._scene = Scene(self._plotter, PAPER)
        shown = PictureOptions().drawn_session(self.session)
        overview = self.overview
        part = None if overview is None else overview.cells
        yield from self._scene.opening(shown, self.surfaces, part)
        if self.like is not None:
            self._scene.set_motion_ghosts(self.like.motion_ghosts)
        if overview is None:  # in the window, which must stay responsive
            yield from render_in_groups(self._plotter)

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
        """Release the graphics resources."""
        self._stack.close()

    @property
    def fills(self) -> bool:
        """Return whether pictures are fitted to the mesh by default: the view shows all of it."""
        return self.like is None or self.like.camera.sees_all(0.02)

    @property
    def shows_detail(self) -> bool:
        """Return whether pictures show a detail, with the rest of the mesh out of view."""
        return self.overview is not None and self.overview.detail is not None

    @property
    def beside(self) -> Session | None:
        """Return the session as the second view shows it, or None without a comparison."""
        return second_session(self.session)

    def image(self, options: PictureOptions) -> Pixels:
        """Draw a picture and return it, (height, width, 3), or 4 with a transparent background.

        Raises SlidevizError if the size cannot be drawn.
        """
        return run_to_end(self.render_steps(options))

    def render_steps(
        self, options: PictureOptions, aim: bool = True, frame: int | None = None
    ) -> Generator[None, None, Pixels]:
        """Draw and return a picture as `image` does, yielding between pieces of the work.

        The renderer must not draw anything else meanwhile. ``aim``: whether to aim the camera; if
        not, it is that of the last picture. ``frame``: the number of the step to draw, by default
        the one that the session shows.
        """
        shown = self.session if frame is None else show_frame(self.session, frame)
        check_drawable(options.size)
        yield from self.prepare_steps()
        sessions = self.shown(shown, options)
        if aim:
            self._aim(sessions[0], options)
        return (yield from self.draw_panes(sessions, options, headings(sessions, options)))

    def shown(self, session: Session, options: PictureOptions) -> tuple[Session, ...]:
        """Return the sessions in a picture, from left to right: one, or two of a comparison."""
        return shown_views(session) if options.both else (session,)

    def draw_panes(
        self,
        sessions: Sequence[Session],
        options: PictureOptions,
        titles: tuple[Sequence[str], float],
    ) -> Generator[None, None, Pixels]:
        """Draw and return the picture of one session or two, yielding between pieces of the work.

        The camera stays; both have the same scale. ``titles`` are the titles, and the size of
        their letters relative to the usual one.
        """
        words, size = titles
        if len(sessions) == 1:
            return (yield from self._pane(sessions[0], options, words[0], size))
        first, second = panes(options, options.gap)
        left = yield from self._pane(sessions[0], first, words[0], size)
        right = yield from self._pane(sessions[1], second, words[1], size)
        between = self._between(options)
        return np.ascontiguousarray(np.concatenate([left, between, right], axis=1))

    def _between(self, options: PictureOptions) -> Pixels:
        """Return the pixels between two pictures: background, with a line in the middle."""
        scheme = self._scene.scheme
        height = options.size[1]
        down = np.linspace(0.0, 1.0, height)[:, None, None]
        top = np.array(Color(scheme.background_top).int_rgb)
        bottom = np.array(Color(scheme.background).int_rgb)
        drawn = np.repeat(top + down * (bottom - top), options.gap, axis=1).round()
        columns = line_between(options)
        drawn[:, columns] = Color(scheme.edge).int_rgb
        if options.background == "transparent":
            opacity = np.zeros((height, options.gap, 1))
            opacity[:, columns] = 255.0
            drawn = np.concatenate([drawn, opacity], axis=2)
        return drawn.astype(np.uint8)

    def aim(self, options: PictureOptions, frame: int | None = None) -> Scene:
        """Aim the camera as for a picture of a step, by default the shown one; return the scene."""
        shown = self.session if frame is None else show_frame(self.session, frame)
        for _ in self.prepare_steps():
            pass
        self._aim(shown, options)
        scene: Scene = self._scene
        return scene

    def window(self, options: PictureOptions) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ranges of x and of y that a picture of a 2D mesh shows."""
        self.aim(options)
        camera = self._plotter.camera
        width, height = options.size
        unit = 2.0 * camera.parallel_scale / height
        ranges = []
        for centre, length, shift in zip(
            camera.focal_point[:2], (width, height), camera.GetWindowCenter(), strict=True
        ):
            low = centre - 0.5 * length * (1.0 - shift) * unit
            ranges.append((float(low), float(low + length * unit)))
        return ranges[0], ranges[1]

    def write(self, options: PictureOptions, file: Path) -> None:
        """Write the picture as a PNG file, whole or not at all; that of a view with its case.

        With a name that ends with .html it is a web page that can be turned. Raises SlidevizError
        if the size cannot be drawn, the name has another ending, or the file cannot be written.
        """
        check_picture(file)
        if file.suffix.lower() == WEB_PAGE:
            one = replace(options, both=False)
            words, _ = headings((self.session,), one)
            write_whole(file, web_page(self.aim(one), self.session, words[0]))
            return
        known: dict[str, Any] = {} if options.dpi is None else {"dpi": (options.dpi, options.dpi)}
        if self.like is not None and options.case:
            shown = replace(self.session, case=shown_case(self.session))
            known["pnginfo"] = PngInfo()
            text = case_text(file, view_to_case(shown, self.like.camera.view))
            known["pnginfo"].add_itxt(PICTURE_KEY, text)
        write_whole(file, png_bytes(self.image(options), **known))

    def _pane(
        self, session: Session, options: PictureOptions, words: str, size: float
    ) -> Generator[None, None, Pixels]:
        """Draw and return the picture of one session, with a title whose letters have ``size``."""
        self._prepare(session, options)
        yield
        plotter = self._plotter
        plotter.remove_actor("title", reset_camera=False, render=False)
        if words:
            title_height = options.title_room * options.scale
            # A film's title is longer, and has smaller letters than the rest.
            letters = TITLE * size * options.scale / (LETTERS if options.film else 1.0)
            write_title(plotter, words, self._scene.scheme, letters, title_height)
        label_marked_cell(plotter, self._scene, options.scale)
        return image_of(plotter, options.background == "transparent")

    def _prepare(self, session: Session, options: PictureOptions) -> None:
        """Update the scene to a session, in the size and style of a picture; the camera stays."""
        plotter = self._plotter
        scene = self._scene
        resize(plotter, options.size)
        scene.stage.font_scale = options.scale
        scene.stage.has_legend = options.legend
        scene.stage.has_plate = options.background != "transparent"
        scene.update(options.drawn_session(session))
        if options.background == "transparent":
            plotter.set_background("white")  # VTK draws a gradient opaquely
        self._keep_room(options)

    def _keep_room(self, options: PictureOptions) -> None:
        """Shift the picture so that the room of legend and title stays free."""
        right = self._scene.stage.strip() / options.size[0]
        self._plotter.camera.SetWindowCenter(right, options.top)
        self._plotter.renderer.ResetCameraClippingRange()

    def _aim(self, session: Session, options: PictureOptions) -> None:
        """Set camera and color scheme for a picture: of the view, of the overview, or fitted."""
        scene = self._scene
        camera = self._plotter.camera
        like = self.like
        if len(self.shown(session, options)) == 2:
            options = panes(options, options.gap)[0]
        scene.set_scheme(PAPER if like is None or options.background != "shown" else like.scheme)
        self._prepare(session, options)
        if like is not None:
            scene.camera.copy_from(like.camera)
        if self.overview is not None:
            scene.look_along(self.overview, self._seen(options))
        elif self.place is not None:
            scene.camera.move_to(self.place)
            if scene.camera.is_fit(self.place):
                scene.camera.fit()
        elif options.fill:
            scene.camera.fit()
        elif like is not None:
            scene.camera.show_width_of(like.camera)
        # Zoom out for the title's room; a place, or the width of a detail, was asked for.
        if camera.parallel_projection and self.place is None and not self.shows_detail:
            camera.parallel_scale = camera.parallel_scale / (1.0 - options.top)
        self._keep_room(options)

    def _seen(self, options: PictureOptions) -> Iterator[Mesh]:
        for run in self.session.runs:
            yield from (frame.mesh for frame in run.frames)
        if options.film and self.session.mesh is not None:
            yield self.session.mesh


PICTURE_SIZE = PictureOptions.size  # default width and height in pixels
WHITE = 250  # least red, green and blue (0 to 255) of a pixel that counts as background
_SMALL = 10  # mean size of cells in pixels below which they are drawn without edges


def picture(
    session: Session, file: str | Path, size: tuple[int, int] = PICTURE_SIZE, zoom: Zoom = "auto"
) -> None:
    """Write what a session shows, a run or a mesh alone, for `slideviz.picture`: PNG or HTML.

    With the zoom ``view``, it is the picture of the view that the case has. Raises SlidevizError if
    the size cannot be drawn, or the file cannot be written.
    """
    check_picture(Path(file))
    with OffscreenRenderer.of_runs(session, zoom) as renderer:
        words = caption(Path(session.shown_frame.mesh.name).name, session.shown_frame.quality)
        words += DETAIL if renderer.shows_detail else ""
        options = PictureOptions(size, title=True, heading=words)
        if zoom == "view":
            letters = LETTERS * size[0] / size[1] / 1.6  # as large as in the window
            options = PictureOptions(size, letters=letters).like(renderer.session.view)
        renderer.write(options, Path(file))


def pictures_alike(frames: Sequence[StepFrame], base: Mesh, side: int) -> list[Pixels]:
    """Return a square picture (side, side, 3) of each mesh, without legend, all from one camera.

    ``frames``: the deformed meshes, at least one. ``base``: the undeformed mesh. ``side``: width
    and height of each picture in pixels.
    """
    runs = [Run(k, Case(), (frame,), "done") for k, frame in enumerate(frames, start=1)]
    session = session_of_runs(StepFrame(base, frames[0].quality), runs)
    with OffscreenRenderer.of_runs(session) as renderer:
        options = PictureOptions((side, side), legend=False, edges=False, both=False, film=True)
        scene = renderer.aim(options)

        def draw(run: Run, options: PictureOptions) -> Pixels:
            shown = replace(session, shown=run.number)
            return run_to_end(renderer.draw_panes([shown], options, ([""], 1.0)))

        inked = int((draw(runs[0], options) < WHITE).any(axis=2).sum())
        # The edges of small cells would hide their colors.
        options = replace(options, edges=inked >= scene.polygons * _SMALL**2)
        return [draw(run, options) for run in runs]
