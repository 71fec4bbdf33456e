"""Folded cells of a 2D mesh lie over each other: the inverted ones are drawn on top."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

from slideviz.color_scheme import INVERTED_COLOR
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.export.vector import draw_vector
from slideviz.mesh.quality import INVERTED, quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.plots.section_paint import paint
from slideviz.plots.section_picture import SectionInRun, SectionStyle, draw_section
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame
from tests.scenes import square_mesh

PLAIN = PictureOptions((400, 300), legend=False, edges=0.0)


@pytest.fixture(scope="module")
def base():
    return square_mesh(2)


@pytest.fixture(scope="module")
def folded(base):
    """The left cells, 0 and 2, are turned inside out, and the right ones lie over all of them."""
    points = base.points.copy()
    points[[1, 4, 7], 0] = -0.5
    found = base.with_points(points)
    assert (quality(found).status == INVERTED).tolist() == [True, False, True, False]
    return found


def session_of(base, folded, **view):
    found = changes.start_run(open_mesh(StepFrame(base, quality(base)), None))
    found = changes.add_frames(found, [StepFrame(folded, quality(folded, base))])
    return changes.set_view(changes.end_run(found, "done"), color_by="size-skew", **view)


def red_part(image):
    """How much of what is drawn has the color of inverted cells."""
    color = np.array(to_rgb(INVERTED_COLOR)) * 255
    ink = (image[..., :3] < 250).any(axis=2)
    red = np.abs(image[..., :3].astype(float) - color).max(axis=2) < 12
    return red.sum() / ink.sum()


VIEWS = {
    "whole": {},
    "threshold": {"threshold": (-1.0, 1.0)},
    "section": {"sections": (Section("plane", (0, 0.5, 0), (0, 1, 0), whole_cells=True),)},
}


@pytest.mark.parametrize("view", VIEWS)
def test_inverted_cells_are_seen_in_the_scene(base, folded, view):
    session = session_of(base, folded, **VIEWS[view])
    with OffscreenRenderer(session, find_surfaces(base)) as renderer:
        # Of a width of 2.5, 0.5; of a section, half as high, and with the rest faint around it.
        assert 0.06 < red_part(renderer.image(PLAIN)) < 0.3
        # Back at the undeformed mesh, all cells have their own values again.
        renderer.session = changes.show_frame(session, 0)
        assert red_part(renderer.image(PLAIN)) == 0.0


def test_inverted_cells_are_seen_in_a_drawing(base, folded):
    with OffscreenRenderer(session_of(base, folded), find_surfaces(base)) as renderer:
        assert red_part(image_of(draw_vector(renderer, replace(PLAIN, size=(400, 300))))) > 0.04


def test_inverted_cells_are_seen_in_the_picture_of_a_section(base, folded):
    section = Section("plane", (0, 0.5, 0), (0, 1, 0), whole_cells=True)
    pieces = {0: Cutter(folded).show(folded.points, section)}
    painted = paint(folded, quality(folded, base), "size-skew", base)
    figure = draw_section([SectionInRun(pieces, painted)], section, SectionStyle())
    (cells,) = figure.axes[0].collections
    assert cells.get_facecolors()[-1][:3] == pytest.approx(to_rgb(INVERTED_COLOR))


def image_of(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())
