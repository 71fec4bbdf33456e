"""Letters over a mesh have a plate that is seen only where something is behind it."""

import numpy as np
import pytest
import pyvista as pv

from slideviz.color_scheme import DARK, LIGHT
from slideviz.export.offscreen_renderer import OffscreenRenderer, PictureOptions
from slideviz.mesh.quality import quality
from slideviz.mesh.surfaces import find_surfaces
from slideviz.scene.legend import OPACITY
from slideviz.scene.scene import Scene
from slideviz.scene.stage import STRIP
from slideviz.session import changes
from slideviz.session.opening import open_mesh
from slideviz.session.state import StepFrame

SIZE = (500, 400)


@pytest.fixture
def window_size():
    return SIZE


def opened(plotter, mesh, scheme, **view):
    scene = Scene(plotter, scheme)
    scene.set_scheme(scheme)
    session = open_mesh(StepFrame(mesh, quality(mesh)), None)
    session = changes.set_view(session, edges=False, triad=False, **view)
    scene.open(session, find_surfaces(mesh))
    return scene, session


def image(scene):
    scene.plotter.render()
    return np.asarray(scene.plotter.screenshot(return_img=True)).astype(float)


@pytest.mark.parametrize("scheme", [LIGHT, DARK])
def test_beside_the_mesh_no_plate_is_seen(plotter, square, scheme):
    scene, session = opened(plotter, square, scheme, color_by="size-skew")
    with_plate = image(scene)
    scene.stage.has_plate = False
    scene.update(session)
    assert np.abs(image(scene) - with_plate).max() <= 3


@pytest.mark.parametrize("scheme", [LIGHT, DARK])
@pytest.mark.parametrize("by", ["size-skew", "role"])
def test_over_the_mesh_the_letters_lie_on_the_color_of_the_background(plotter, square, scheme, by):
    scene, session = opened(plotter, square, scheme, color_by=by)
    scene.camera.aim((2.0, 2.0, 0.0), 0.3)
    covered = image(scene)
    scene.stage.has_plate = False
    scene.update(session)
    bare = image(scene)
    # Most of the strip is neither bar nor letter.
    right = np.s_[90:300, -STRIP + 2 : -2] if by == "size-skew" else np.s_[4:50, -STRIP + 2 : -2]
    color = scheme.background if by == "size-skew" else scheme.background_top
    background = np.array(pv.Color(color).int_rgb, float)

    def away(picture):
        return np.median(np.abs(picture[right] - background).max(axis=2))

    assert away(covered) < 0.45 * away(bare)
    # Left of the strip nothing is covered.
    assert np.array_equal(covered[:, : -STRIP - 2], bare[:, : -STRIP - 2])


def test_a_plate_follows_the_size_of_the_view(plotter, square):
    scene, _ = opened(plotter, square, LIGHT, color_by="size-skew")
    plate = plotter.actors["plate:legend"]
    before = np.array(plate.GetMapper().GetInput().GetBounds()[:4])
    assert before[:2] == pytest.approx((SIZE[0] - STRIP, SIZE[0]))
    plotter.window_size = [700, 300]
    scene.resized()
    after = np.array(plate.GetMapper().GetInput().GetBounds()[:4])
    assert after[:2] == pytest.approx((700 - STRIP, 700))
    assert after[3] < before[3]


def test_a_transparent_picture_has_no_plate(square):
    session = open_mesh(StepFrame(square, quality(square)), None)
    session = changes.set_view(session, color_by="size-skew")
    with OffscreenRenderer(session, find_surfaces(square)) as renderer:
        clear = renderer.image(PictureOptions(SIZE, background="transparent"))
        strip = round(STRIP * PictureOptions(SIZE).scale)
        opacity = clear[:, -strip:, 3]
        assert (opacity == 0).mean() > 0.5
        # But for single pixels at the edges of letters.
        assert (opacity == round(255 * OPACITY)).mean() < 0.01
