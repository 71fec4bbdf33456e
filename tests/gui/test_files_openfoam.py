"""A case of OpenFOAM is opened by its folder in the window, and saved as another case."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.case.motion_words import mesh_words
from slideviz.errors import MeshError
from slideviz.gui.widgets import questions
from tests.polymesh_files import honeycomb_case, write_polymesh


def test_a_case_is_opened_by_its_folder_and_saved_as_another(driver, answers, tmp_path):
    points, cells, patches = honeycomb_case()
    folder = tmp_path / "honeycomb" / "constant" / "polyMesh"
    write_polymesh(folder, points, cells, patches, {"ends": "symmetryPlane"})
    driver.window.files.open_path(tmp_path / "honeycomb")
    driver.settle()
    session = driver.session
    assert session.path == folder / "points"
    assert session.guesses["ends"].reason == "its file says so"
    assert session.case.roles["ends"] == "sliding"
    assert driver.window.files.stem() == "honeycomb"
    assert driver.window.files.folder() == tmp_path / "honeycomb"
    asked = answers("ask_open", None)
    driver.window.files.ask_and_open()
    assert asked[0][0] == tmp_path / "honeycomb"
    assert driver.window.windowTitle() == "honeycomb – slideviz"
    assert len(session.mesh.cells) > len(cells)
    words = " ".join(mesh_words(session.mesh))
    assert f"{len(cells):,} cells" in words
    assert f"{len(cells):,} polyhedra are" in words
    assert "*.foam" in questions.mesh_filters(session.mesh)
    answers("ask_save", tmp_path / "new.foam")
    driver.window.files.save_mesh()
    driver.settle()
    saved = sv.read(tmp_path / "new")
    assert np.array_equal(saved.points[: len(points)], points)
    assert (tmp_path / "new/constant/polyMesh/faces").read_bytes() == (
        folder / "faces"
    ).read_bytes()


@pytest.mark.parametrize("opened", ["", "constant", "0"])
def test_a_case_without_a_mesh_says_so(driver, tmp_path, opened):
    case = tmp_path / "case"
    for name in ("constant", "0", "system"):
        (case / name).mkdir(parents=True)
    (case / "system" / "controlDict").touch()
    driver.window.files.open_path(case / opened)
    told = driver.window.banner.text.text()
    assert "polyMesh: this case of OpenFOAM has no mesh; make one first" in told
    with pytest.raises(MeshError, match="this case of OpenFOAM has no mesh; make one first"):
        sv.read(case / opened)
