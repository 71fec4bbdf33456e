"""A mesh that moved is still seen whole, unless the camera was moved by the user."""

import numpy as np
import pytest

from slideviz.case.motions.rigid import Translate
from slideviz.session import changes
from slideviz.session.saving import view_to_case
from tests.windows import come_to_rest


@pytest.mark.parametrize("zoomed", [False, True])
def test_a_run_that_moves_the_mesh_leaves_it_in_the_view(driver, passage_file, zoomed):
    window = driver.window
    driver.open(passage_file)
    window.store.change(changes.set_role, ("airfoil",), "moving")
    window.store.change(changes.set_case, motions=(Translate("airfoil", (0.0, 1.8)),))
    window.viewing.fit()
    if zoomed:
        # Some of the mesh is still seen then; of an empty view nobody has anything.
        window.scene.camera.zoom_at(50, window.view.height() - 1, 1.2)
    before = window.scene.camera.place
    window.start_run()
    driver.settle()
    assert window.store.session.deformed is not None
    assert np.allclose(window.scene.camera.place, before) == zoomed
    assert zoomed or window.scene.camera.sees_all()
    if not zoomed:
        # And so does playing the steps.
        for step in range(len(window.store.session.frames)):
            window.store.change(changes.show_frame, step)
            assert not window.scene.camera.loses_some()


def scale_of(driver):
    come_to_rest()
    return driver.window.view.camera.parallel_scale


def fitted_scale(driver):
    driver.window.viewing.fit()
    return scale_of(driver)


def test_the_view_is_fitted_again_when_the_window_grows(driver, sample_folder, tmp_path):
    window, path = driver.window, sample_folder / "passage" / "passage.cfg"
    window.resize(900, 640)
    driver.open(path)
    small = fitted_scale(driver)
    case = view_to_case(driver.session, window.scene.camera.view)
    case.write(tmp_path / "saved.cfg")
    window.scene.camera.zoom_at(50, 50, 3.0)
    view_to_case(driver.session, window.scene.camera.view).write(tmp_path / "zoomed.cfg")
    window.viewing.fit()
    window.viewing.fly_to(0)
    window.resize(1500, 900)
    # Back from a cell, all is seen in the size that the window has now.
    window.viewing.fly_back()
    large = scale_of(driver)
    assert large != pytest.approx(small)
    assert large == pytest.approx(fitted_scale(driver))
    # So is a case that was saved in a small window; but not where it was zoomed in.
    driver.open(tmp_path / "saved.cfg")
    assert scale_of(driver) == pytest.approx(large)
    driver.open(tmp_path / "zoomed.cfg")
    assert scale_of(driver) == pytest.approx(small / 3.0, rel=1e-3)
