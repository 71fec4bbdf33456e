"""Edges of cells stand out on every colour."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.view.drawing.actors import VALUES
from slideviz.view.drawing.look import DARK, LIGHT
from slideviz.view.drawing.stage import Stage

SIZE = 240


@pytest.mark.parametrize("look", [LIGHT, DARK])
@pytest.mark.parametrize("value", [0.0, 0.2, 0.5, 0.75, 1.0])
def test_edges_are_seen_on_low_and_on_high_values(value, look):
    plotter = pv.Plotter(off_screen=True, window_size=[SIZE, SIZE])
    try:
        stage = Stage(plotter, look)
        shape = pv.Plane(i_resolution=4, j_resolution=4)
        shape.clear_data()
        shape.cell_data[VALUES] = np.full(16, value)
        actor = stage.add(shape, "cells", lighting=False)
        actor.mapper.scalar_visibility = True
        actor.prop.line_width = 3.0
        stage.edges(actor.prop, True)
        plotter.camera_position = "xy"
        plotter.camera.parallel_projection = True
        plotter.camera.parallel_scale = 0.4
        image = plotter.screenshot(return_img=True).astype(float)
    finally:
        plotter.close()
    light = image @ (0.30, 0.59, 0.11)
    # Between the lines, and on the one in the middle.
    face, line = light[SIZE // 2 + 36, SIZE // 2 + 36], light[SIZE // 2 + 36, SIZE // 2]
    assert abs(line - face) > 30
    assert (line > face) == (value < 0.4), "lighter on dark colours, darker on others"
