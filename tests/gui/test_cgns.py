"""A CGNS mesh is opened in the window, and saved as another CGNS file."""

import numpy as np

from slideviz.formats.cgns.read import read_cgns
from slideviz.gui.widgets import questions
from tests.cgns_files import passage_grid, save_passage


def test_a_cgns_file_is_opened_and_saved_again(driver, answers, tmp_path):
    path = save_passage(tmp_path / "passage.cgns", passage_grid())
    answers("ask_open", path)
    driver.window.files.ask_and_open()
    driver.settle()
    session = driver.session
    assert session.mesh.marker_names[-2:] == ("lower", "upper")
    assert session.case.roles["BLADE"] == "moving"
    assert [pair.describe() for pair in session.pairs] != []
    assert "*.cgns" in questions.mesh_filters(session.mesh)
    answers("ask_save", tmp_path / "out.cgns")
    driver.window.files.save_mesh()
    driver.settle()
    assert np.array_equal(read_cgns(tmp_path / "out.cgns").points, session.mesh.points)
    assert "does not hold" not in driver.window.banner.text.text()
