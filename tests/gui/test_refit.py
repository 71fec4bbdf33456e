"""A mesh that moved is still seen whole, unless the camera was moved by the user."""

import numpy as np
import pytest

from slideviz.case.motions.rigid import Translate
from slideviz.session import changes


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
