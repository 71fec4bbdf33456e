import numpy as np
import pytest

from slideviz import read
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.rigid import Translate
from slideviz.errors import Cancelled, CaseError, MeshError
from slideviz.mesh.quality import quality
from slideviz.session import jobs
from slideviz.session.motions import Ghosts
from slideviz.session.state import StepFrame
from tests.builders import passage


def test_opening_a_case_gives_mesh_roles_pairs_and_quality(kept_passage):
    heard = []
    opened = jobs.open_file(kept_passage / "passage.cfg", None, jobs.Job(heard.append))
    session = opened.session
    assert session.role("airfoil") == "moving"
    assert session.path == session.case.mesh_file
    assert {session.pairs[0].first, session.pairs[0].second} == {"periodic_1", "periodic_2"}
    assert len(session.frame.quality) == len(session.mesh.cells)
    assert {one.name for one in opened.surfaces} == set(session.mesh.marker_names)
    fractions = [doing.fraction for doing in heard if doing.fraction is not None]
    assert fractions == sorted(fractions)
    assert fractions


def test_opening_can_be_stopped(kept_passage):
    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.open_file(kept_passage / "mesh.su2", None, jobs.Job(stopped=lambda: True))


def test_a_case_without_a_mesh_is_refused(tmp_path):
    file = tmp_path / "a.cfg"
    Case(roles={"a": "moving"}, motions=(Translate("a", (1.0, 0.0)),)).write(file)
    with pytest.raises(CaseError, match="MESH_FILENAME"):
        jobs.open_file(file, None, jobs.Job())


def test_computing_reports_every_step_with_its_quality(kept_passage):
    case = Case.read(kept_passage / "passage.cfg").change(steps=3)
    mesh, heard = read(case.mesh_file), []
    jobs.compute(case, mesh, jobs.Job(heard.append))
    frames = [item for item in heard if isinstance(item, StepFrame)]
    assert [frame.step.index for frame in frames] == [1, 2, 3]
    assert frames[-1].quality.min < 1.0
    fractions = [item.fraction for item in heard if isinstance(item, jobs.JobProgress)]
    assert all(0.0 <= fraction <= 1.0 for fraction in fractions)
    assert fractions == sorted(fractions)


def test_automatic_steps_tell_what_is_tried_and_claim_no_fraction(kept_passage):
    case = Case.read(kept_passage / "passage.cfg").change(steps=0)
    heard = []
    jobs.compute(case, read(case.mesh_file), jobs.Job(heard.append))
    frames = [item for item in heard if isinstance(item, StepFrame)]
    assert len(frames) == frames[-1].step.total
    texts = [item.text for item in heard if isinstance(item, jobs.JobProgress)]
    assert any(text.startswith("Trying 1 step: step 1, ") for text in texts)
    assert any(text.startswith("Trying 2 steps: step 2, ") for text in texts)
    trying = [i for i in heard if isinstance(i, jobs.JobProgress) and i.text.startswith("Trying")]
    assert {doing.fraction for doing in trying} == {None}


def test_computing_stops_when_asked_and_keeps_what_was_reported(kept_passage):
    case = Case.read(kept_passage / "passage.cfg").change(steps=50)
    frames = []

    def report(item):
        if isinstance(item, StepFrame):
            frames.append(item)

    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.compute(case, read(case.mesh_file), jobs.Job(report, lambda: len(frames) >= 2))
    assert len(frames) == 2


def test_a_mesh_is_saved_with_quality_where_there_is_room(tmp_path, passage):
    import meshio

    opened = jobs.prepare(passage.mesh, None, passage.case, jobs.Job())
    frame = opened.session.frame
    jobs.save_mesh(tmp_path / "a.su2", frame, False, jobs.Job())
    jobs.save_mesh(tmp_path / "a.vtu", frame, False, jobs.Job())
    assert np.array_equal(read(tmp_path / "a.su2").points, passage.mesh.points)
    stored = np.concatenate(meshio.read(tmp_path / "a.vtu").cell_data["size_skew"])
    # The lines of the boundaries are in the file, too, and have no quality.
    stored = stored[np.isfinite(stored)]
    assert np.allclose(np.sort(stored), np.sort(frame.quality.values))


def test_a_broken_file_is_one_error(tmp_path):
    file = tmp_path / "bad.su2"
    file.write_text("NDIME= 2\nNELEM= many\n")
    with pytest.raises(MeshError, match=r"bad\.su2:2"):
        jobs.open_file(file, None, jobs.Job())


def test_ghosts_are_where_the_motions_lead(passage):
    mesh = passage.mesh
    nodes = mesh.marker("airfoil").nodes
    case = Case(roles={"airfoil": "moving"}, motions=(Translate("airfoil", (0.5, 0.25)),))
    moved = Ghosts(mesh).moved(case)
    assert np.allclose(moved["airfoil"], mesh.points[nodes] + [0.5, 0.25])


def test_ghosts_read_displacement_files_again_when_they_change(tmp_path, passage):
    import os

    mesh, file = passage.mesh, tmp_path / "d.txt"
    node = int(mesh.marker("airfoil").nodes[0])
    case = Case(roles={"airfoil": "moving"}, motions=(FromFile(file, "airfoil"),))
    ghosts = Ghosts(mesh)
    assert np.allclose(ghosts.moved(case)["airfoil"][0], mesh.points[node]), "no file yet"
    for stamp, by in ((1_000, 0.5), (2_000, 0.75)):
        file.write_text(f"{node} {by} 0.0\n")
        os.utime(file, (stamp, stamp))
        assert np.allclose(ghosts.moved(case)["airfoil"][0], mesh.points[node] + [by, 0.0])
    file.write_text("nonsense\n")
    os.utime(file, (3_000, 3_000))
    assert np.allclose(ghosts.moved(case)["airfoil"][0], mesh.points[node])


def test_a_displacement_file_of_all_moving_boundaries_moves_each_ghost(tmp_path, passage):
    mesh, file = passage.mesh, tmp_path / "d.txt"
    names = ("airfoil", "inflow")
    nodes = {name: mesh.marker(name).nodes for name in names}
    file.write_text("".join(f"{nodes[name][1]} 0.5 {at}\n" for at, name in enumerate(names)))
    case = Case(roles=dict.fromkeys(names, "moving"), motions=(FromFile(file),))
    moved = Ghosts(mesh).moved(case)
    for at, name in enumerate(names):
        assert np.allclose(moved[name][1] - mesh.points[nodes[name][1]], [0.5, at])
        assert np.allclose(moved[name][0], mesh.points[nodes[name][0]])


@pytest.mark.slow
def test_the_view_needs_no_qt():
    import subprocess
    import sys

    code = (
        "import sys, slideviz.scene.scene, slideviz.export.offscreen_renderer\n"
        "import slideviz.session.jobs, slideviz.session.changes, slideviz.session.motions\n"
        "bad = [m for m in sys.modules if m.split('.')[0] in ('qtpy', 'PySide6', 'pyvistaqt')]\n"
        "sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_wheel_is_written_whole_or_not_at_all(tmp_path):
    mesh, path = passage((2, 6, 6), 40.0), tmp_path / "wheel.su2"
    roles = {"blade": "moving", "per1": "periodic", "per2": "periodic"}
    case, heard = Case(roles=roles, periodic_type="rotational"), []
    values = path, case, mesh, StepFrame(mesh, quality(mesh)), "all", False
    with pytest.raises(Cancelled, match="stopped on request"):
        jobs.save_wheel(*values, jobs.Job(heard.append, lambda: True))
    assert not list(tmp_path.iterdir())
    made = jobs.save_wheel(*values, jobs.Job(heard.append))
    assert (made.passages, made.points) == (9, len(read(path).points))
    fractions = [doing.fraction for doing in heard]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
