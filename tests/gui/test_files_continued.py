"""A run is continued: its result becomes the mesh, and the mesh before it the reference."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]


def test_out_and_back_in_the_window_is_home_as_headless(with_runs, answers, tmp_path):
    driver = with_runs({"relax": "yes", "layers": "no", "repair": "no", "steps": 1})
    window = driver.window
    start = driver.session.mesh
    undeformed = driver.session.path
    gone = np.abs(driver.session.frame.mesh.points - start.points).max()
    answers("ask_save", tmp_path / "out.su2")
    answers("ask_unsaved", "drop")
    command = window.actions_table.by_name["continue_run"]
    assert command.isEnabled()
    command.trigger()
    driver.qtbot.waitUntil(lambda: driver.session.path == tmp_path / "out.su2")
    driver.settle()
    session = driver.session
    assert session.case.reference_file == undeformed
    assert session.case.source is None
    np.testing.assert_array_equal(session.mesh.undeformed.points, start.points)
    expected = sv.quality(session.mesh, start).values
    np.testing.assert_array_equal(session.first.quality.values, expected)
    assert not command.isEnabled()  # no run yet

    (name,) = session.case.markers_with("moving")
    nodes = session.mesh.marker(name).nodes
    rows = (start.points - session.mesh.points)[nodes].tolist()
    table = [" ".join(map(repr, [k, *row])) for k, row in zip(nodes.tolist(), rows, strict=True)]
    (tmp_path / "back.txt").write_text("\n".join(table) + "\n")
    motion = sv.FromFile(tmp_path / "back.txt")
    window.store.change(changes.set_case, motions=(motion,))
    window.start_run()
    driver.settle()
    home = driver.session.frame.mesh.points
    assert np.abs(home - start.points).max() < 1e-3 * gone
    assert driver.session.frame.quality.min == pytest.approx(sv.quality(start).min, abs=1e-4)
    case = driver.session.case
    *_, last = sv.deform(case, sv.read(case.mesh_file))
    np.testing.assert_array_equal(last.mesh.points, home)
