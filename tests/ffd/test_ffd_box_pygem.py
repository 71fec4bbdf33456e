"""Boxes against PyGeM's free-form deformation (mathLab), where it is installed."""

import numpy as np
import pytest

from slideviz.ffd.box import CORNERS, regular_box

pygem = pytest.importorskip("pygem")
if not hasattr(pygem, "FFD"):
    pytest.skip(
        "the package pygem here is another one, a model of glaciers", allow_module_level=True
    )


@pytest.mark.parametrize("seed", range(5))
def test_points_of_turned_boxes_move_as_pygem_moves_them(seed):
    rng = np.random.default_rng(seed)
    counts = rng.integers(2, 6, 3)
    theirs = pygem.FFD(counts.tolist())
    theirs.box_length[:], theirs.box_origin[:] = rng.uniform(0.5, 3.0, 3), rng.normal(size=3)
    theirs.rot_angle[:] = rng.uniform(-40.0, 40.0, 3)
    shifts = rng.normal(size=(*counts, 3)) * 0.2  # parts of the box's lengths, along its sides
    theirs.array_mu_x, theirs.array_mu_y, theirs.array_mu_z = np.moveaxis(shifts, -1, 0)
    frame = (theirs.rotation_matrix @ np.diag(theirs.box_length)).T
    ours = regular_box("box", theirs.box_origin + CORNERS @ frame, tuple(counts - 1), None)
    uvw = rng.uniform(0.01, 0.99, (200, 3))
    wanted = theirs(theirs.box_origin + uvw @ frame)
    assert ours.moved(shifts @ frame).at(uvw) == pytest.approx(wanted, rel=0, abs=1e-12)
