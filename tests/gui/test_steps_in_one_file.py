"""All steps of a run are saved in one VTKHDF file."""

import h5py
import numpy as np
import pytest

from slideviz.errors import Cancelled
from slideviz.session import changes, jobs

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


@pytest.fixture
def ran(driver, sample_folder):
    driver.open(sample_folder / "passage" / "passage.cfg")
    driver.window.store.change(changes.set_case, steps=2)
    driver.window.start_run()
    driver.settle()
    return driver


def test_all_steps_go_into_one_file(ran, answers, tmp_path):
    path = tmp_path / "steps.vtkhdf"
    assert ran.session.unsaved_mesh
    answers("ask_numbered", path)
    ran.window.exports.steps()
    ran.settle()
    assert [one.name for one in tmp_path.glob("*.vtkhdf")] == ["steps.vtkhdf"]
    frames = ran.session.frames
    assert len(frames) == 3
    with h5py.File(path) as file:
        volume = file["VTKHDF/volume"]
        points = volume["Points"][()].reshape(3, -1, 3)[:, :, : frames[0].mesh.dim]
        values = volume["CellData/size_skew"][()].reshape(3, -1)
        shift = volume["PointData/displacement"][()].reshape(3, -1, 3)
    for k, frame in enumerate(frames):
        assert np.array_equal(points[k], frame.mesh.points)
        assert np.array_equal(values[k], frame.quality.values)
    assert not shift[0].any()
    assert shift[2].any()
    assert not ran.session.unsaved_mesh


def test_cancelled_steps_leave_no_file(ran, tmp_path):
    said = []
    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.save_steps(
            tmp_path / "s.vtkhdf",
            ran.session.frames[1:],
            jobs.Job(said.append, lambda: len(said) > 0),
        )
    assert not list(tmp_path.glob("*.vtkhdf"))
    assert not list(tmp_path.glob(".slideviz-*"))
