"""Edges of cells stand out on every color, and step back where cells are small."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.color_scheme import DARK, LIGHT, VALUE_EDGE
from slideviz.scene.actors import VALUES
from slideviz.scene.stage import Stage
from tests.slow import one_of_each_fast

SIZE = 240


@pytest.fixture
def stage():
    plotter = pv.Plotter(off_screen=True, window_size=[SIZE, SIZE])
    yield Stage(plotter, LIGHT)
    plotter.close()


def light_of(stage, cells, values, width=1.0):
    """Return how light each pixel is of cells along x and y, and the actor."""
    shape = pv.Plane(i_resolution=cells[0], j_resolution=cells[1])
    shape.clear_data()
    shape.cell_data[VALUES] = values
    actor = stage.add(shape, "cells", lighting=False)
    actor.mapper.scalar_visibility = True
    actor.prop.line_width = width
    stage.edges(actor.prop, True)
    camera = stage.plotter.camera
    stage.plotter.camera_position = "xy"
    camera.parallel_projection, camera.parallel_scale = True, 0.4
    image = stage.plotter.screenshot(return_img=True).astype(float)
    return image @ (0.30, 0.59, 0.11), actor


@pytest.mark.parametrize(
    ("value", "scheme"),
    one_of_each_fast([0.0, 0.2, 0.3, 0.35, 0.4, 0.5, 0.75, 1.0], [LIGHT, DARK]),
)
def test_edges_are_dark_on_low_and_on_high_values(value, scheme, stage):
    stage.scheme = scheme
    light, _ = light_of(stage, (4, 4), np.full(16, value), 3.0)
    # Between the lines, and on the one in the middle.
    face, line = light[SIZE // 2 + 36, SIZE // 2 + 36], light[SIZE // 2 + 36, SIZE // 2]
    assert line < face - 25
    assert line < 130, "lines are dark even where the colors are light"


def test_edges_fade_where_cells_are_hardly_wider_than_lines(stage):
    light, actor = light_of(stage, (200, 3), np.full(600, 0.75))
    # 1.5 pixels wide, 100 high: no columns, but rows.
    between = light[SIZE // 2 - 20 : SIZE // 2 + 20]
    assert np.ptp(between) < 2
    assert light[:, SIZE // 2].min() < between.min() - 30
    stage.plotter.camera.parallel_scale = 0.02
    stage.plotter.render_window.Render()
    near = stage.plotter.screenshot(return_img=True).astype(float) @ (0.30, 0.59, 0.11)
    assert np.ptp(near[SIZE // 2]) > 30, "seen from near they are there"
    assert actor.prop.show_edges


@pytest.mark.parametrize("scheme", [LIGHT, DARK])
def test_cells_without_values_have_the_lines_of_the_scheme(scheme, stage):
    stage.scheme = scheme
    _, actor = light_of(stage, (2, 2), np.full(4, 0.5))
    stage.edges(actor.prop, True, plain=True)
    assert actor.prop.edge_color == pv.Color(scheme.edge)
    stage.edges(actor.prop, True)
    assert actor.prop.edge_color == pv.Color(VALUE_EDGE)
