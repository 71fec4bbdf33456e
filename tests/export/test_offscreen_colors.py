"""Colors of values: a range that cells are below, and the red of inverted cells alone."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.color_scheme import INVERTED_COLOR
from slideviz.export.offscreen_renderer import OffscreenRenderer
from slideviz.export.picture_options import PictureOptions
from slideviz.export.vector import draw_vector
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.scene.flat_scene import FlatScene
from slideviz.scene.scene import Scene
from slideviz.sections.model import Section
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.section_cuts import Cuts
from slideviz.session.state import StepFrame


@pytest.fixture
def window_size():
    return [300, 300]


def colors(plotter):
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(int)


def count(picture, color, within=30):
    wanted = np.array(pv.Color(color).int_rgb)
    return int((np.abs(picture - wanted).max(axis=2) <= within).sum())


def folded(session):
    """Return the session after a step that folds some cells and spoils others."""
    points = session.mesh.points.copy()
    points[12] += (1.6, 0.4)
    mesh = session.mesh.with_points(points)
    frame = StepFrame(mesh, quality(mesh, session.mesh))
    assert frame.quality.inverted
    session = changes.add_frames(changes.start_run(session), [frame])
    return changes.set_view(session, color_by="size-skew", edges=False, legend=False)


def above_all(session):
    return changes.set_view(session, color_range=(2.0, 3.0), color_map="plasma")


LOWEST = tuple(pv.LookupTable("plasma").map_value(0.0)[:3])


def test_cells_below_the_range_have_its_lowest_color_and_inverted_ones_are_red(plotter, session):
    scene = Scene(plotter)
    for state, red in ((session, False), (folded(session), True)):
        state = above_all(changes.set_view(state, color_by="size-skew", edges=False, legend=False))
        scene.open(state, find_surfaces(state.mesh))
        picture = colors(plotter)
        assert count(picture, LOWEST) > 5000
        assert (count(picture, INVERTED_COLOR) > 200) == red


def test_so_it_is_in_the_flat_view(plotter, cube):
    session = open_mesh(StepFrame(cube, quality(cube)), None)
    session = above_all(changes.set_view(session, color_by="size-skew", edges=False))
    scene = FlatScene(plotter, Cuts())
    scene.update(session, Section("plane", (0.5, 0.5, 0.52)))
    scene.camera.fit()
    picture = colors(plotter)
    assert count(picture, LOWEST) > 5000
    assert count(picture, INVERTED_COLOR) == 0


def test_the_labels_of_the_bar_differ(plotter, session):
    scene = Scene(plotter)
    session = changes.set_view(session, color_by="size-skew", color_range=(0.949, 0.967))
    scene.open(session, find_surfaces(session.mesh))
    bar = plotter.scalar_bars["size-skew"]
    at = [
        bar.GetCustomLabels().GetValue(i) for i in range(bar.GetCustomLabels().GetNumberOfValues())
    ]
    # Both ends, and what is between them and away from them: 0.950 would touch 0.949.
    assert at == pytest.approx([0.949, 0.955, 0.960, 0.965, 0.967])
    assert bar.GetUseCustomLabels()
    assert len({bar.GetLabelFormat() % value for value in at}) == 5


def test_so_it_is_in_vector_figures(session):
    for state, red in ((session, 0), (folded(session), 1)):
        state = above_all(changes.set_view(state, color_by="size-skew"))
        with OffscreenRenderer(state, find_surfaces(state.mesh)) as renderer:
            sheet = draw_vector(renderer, PictureOptions((300, 300), legend=False))
        cells = sheet.axes[0].collections[0]
        cells.update_scalarmappable()
        found = cells.get_facecolor()[:, :3]
        inverted = np.isclose(found, pv.Color(INVERTED_COLOR).float_rgb).all(axis=1)
        assert inverted.sum() == red * state.frame.quality.inverted
        lowest = np.array(LOWEST)
        assert np.isclose(found[~inverted], lowest, atol=0.01).all()
