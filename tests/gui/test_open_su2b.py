"""SU2 binary meshes in the window: opened, offered to be saved, and said what they lose."""

from pathlib import Path

import numpy as np
from qtpy.QtWidgets import QFileDialog

import slideviz as sv
from slideviz.formats.table import usual_ending
from slideviz.gui.widgets import questions
from slideviz.gui.widgets.questions import ask_open  # the driver answers the others
from slideviz.samples.table import write_sample
from slideviz.session.jobs import Job, open_file, save_mesh


def test_a_binary_mesh_is_opened_and_saved(tmp_path):
    write_sample("square", tmp_path, 8, file_format="su2b")
    session = open_file(tmp_path / "square.cfg", None, Job()).session
    mesh = session.mesh
    assert usual_ending(mesh) == ".su2b"
    assert usual_ending(sv.Mesh(mesh.points, mesh.cells)) == ".su2"
    filters = questions.mesh_filters(mesh)
    assert "SU2 binary (keeps all markers) (*.su2b)" in filters
    saved = save_mesh(tmp_path / "saved.su2b", session.frame, False, Job())
    assert saved.read_bytes() == (tmp_path / "mesh.su2b").read_bytes()
    assert np.array_equal(sv.read(saved).points, mesh.points)


def test_they_are_among_the_files_to_open(monkeypatch):
    asked = []

    def ask(_parent, _title, _folder, filters):
        asked.append(filters)
        return "", ""

    monkeypatch.setattr(QFileDialog, "getOpenFileName", ask)
    assert ask_open(None, Path()) is None
    assert "SU2 meshes, cases and sessions (*.su2 *.su2b" in asked[0]
