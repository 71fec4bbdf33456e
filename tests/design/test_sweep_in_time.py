"""Sweeps whose designs have times: meshes with the numbers of iterations, in memory or streamed."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.sweeps.table import iterations, read_designs
from slideviz.errors import CaseError
from slideviz.export import film
from tests.builders import square

CASE = sv.Case(
    roles={"BLOCK": "moving", "x_m": "fixed"}, motions=(sv.Translate("BLOCK", (0.0, 0.0)),)
)
TIMES = {"time": [0.0, 0.01, 0.03], "BLOCK.translate.y": [0.0, 0.02, 0.05]}


@pytest.fixture
def filed(tmp_path):
    """A case with its mesh in a file."""
    sv.write(tmp_path / "mesh.su2", square(10))
    return CASE.change(mesh_file=tmp_path / "mesh.su2")


def swept(case, table, **options):
    with ThreadPoolExecutor(1) as executor:
        rows = sv.sweep(case, table, executor, mesh=sv.read(case.mesh_file), meshes=True, **options)
        return list(rows)


def test_meshes_have_the_numbers_of_iterations_and_go_on(filed, tmp_path):
    folder = tmp_path / "out"
    rows = swept(filed, TIMES, time_step=1e-3, folder=folder)
    names = ["mesh_00000.su2", "mesh_00010.su2", "mesh_00030.su2"]
    assert [row.mesh.name for row in rows] == names
    assert [row.values["time"] for row in rows] == TIMES["time"]
    before = [(folder / name).read_bytes() for name in names]
    (folder / names[1]).unlink()
    rows = swept(filed, TIMES, time_step=1e-3, folder=folder, resume=True)
    assert [row.earlier for row in rows] == [True, True, False]
    assert [(folder / name).read_bytes() for name in names] == before
    nodes = square(10).marker("BLOCK").nodes
    moved = sv.read(folder / names[2]).points[nodes] - square(10).points[nodes]
    assert moved == pytest.approx(np.tile([0.0, 0.05], (len(nodes), 1)), abs=1e-12)


def test_streamed_meshes_have_the_same_bytes_and_need_no_mesh(filed, tmp_path):
    swept(filed, TIMES, time_step=1e-3, folder=tmp_path / "memory")
    rows = list(
        sv.sweep(filed, TIMES, folder=tmp_path / "out", meshes=True, stream=True, time_step=1e-3)
    )
    assert [row.problem for row in rows] == ["", "", ""]
    for row in rows:
        assert row.mesh.read_bytes() == (tmp_path / "memory" / row.mesh.name).read_bytes()
        assert row.inverted == 0
    again = sv.sweep(
        filed, TIMES, folder=tmp_path / "out", meshes=True, stream=True, time_step=1e-3, resume=True
    )
    assert all(row.earlier for row in again)
    with pytest.raises(CaseError, match="stream reads and writes meshes from file to file"):
        sv.sweep(filed, TIMES, folder=tmp_path / "out", stream=True)


def test_displacement_files_are_designs_at_the_times_in_their_names(filed, tmp_path):
    node = int(square(10).marker("BLOCK").nodes[0])
    for time in (5, 10):
        (tmp_path / f"fsi2_{time}.txt").write_text(f"{node} 0.0 {time / 1000}\n")
    case = filed.change(motions=())
    designs = read_designs(case, tmp_path / "fsi2_*.txt")
    assert iterations(designs) == {1: 5, 2: 10}
    rows = swept(case, designs, folder=tmp_path / "out")
    assert [row.mesh.name for row in rows] == ["mesh_00005.su2", "mesh_00010.su2"]
    moved = sv.read(rows[1].mesh).points[node] - square(10).points[node]
    assert moved == pytest.approx([0.0, 0.01])
    with pytest.raises(CaseError, match=r"loads_\*.txt: there is no such file"):
        read_designs(case, tmp_path / "loads_*.txt")
    (tmp_path / "fsi.dat").write_text("")
    with pytest.raises(CaseError, match=r"fsi.dat: its name has no number"):
        read_designs(case, tmp_path / "*.dat")


@pytest.mark.parametrize(
    ("times", "step", "match"),
    [
        ([0.5], None, "the time 0.5 is not a whole number of time steps, from 0 on"),
        ([-1.0], 0.5, "the time -1 is not a whole number of time steps of 0.5"),
        ([1.0, 1.0], None, "designs 1 and 2 are at time iteration 1 both"),
        ([1.0], 0.0, "the time step is 0; it must be above 0"),
    ],
)
def test_times_that_are_no_iterations_are_refused(times, step, match):
    with pytest.raises(CaseError, match=match):
        iterations(read_designs(CASE, {"time": times}), step)


def test_times_are_numbers_and_time_steps_need_them(tmp_path):
    with pytest.raises(CaseError, match=r"design 1: column 'time': .*soon"):
        read_designs(CASE, {"Time": ["soon"]})
    with pytest.raises(CaseError, match="a time step needs a column time"):
        iterations(read_designs(CASE, {"STEPS": [2]}), 0.1)


def test_the_command_and_a_film_take_a_table_in_time(filed, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    filed.write("block.cfg")
    (tmp_path / "motion.csv").write_text("time,BLOCK.translate.y\n1,0.01\n2,0.02\n")
    assert run(["sweep", "block.cfg", "motion.csv", "-o", "out", "--meshes", "--stream"]) == 0
    assert "block.cfg: 2 designs of time, BLOCK.translate.y" in capsys.readouterr().out
    assert (tmp_path / "out" / "mesh_00002.su2").is_file()
    call = ["film", "block.cfg", "--designs", "motion.csv", "-o", "film_%02d.png"]
    titles = []
    drawn = film.film_frame_at

    def noted(*arguments):
        titles.append(drawn(*arguments))
        return titles[-1]

    monkeypatch.setattr(film, "film_frame_at", noted)
    assert run([*call, "--size", "320x200"]) == 0
    assert [one.words for one in titles] == ["undeformed", "time 1", "time 2"]
    assert "2 designs, min " in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.glob("film_*")) == [
        "film_00.png",
        "film_01.png",
        "film_02.png",
    ]


def test_a_film_says_which_designs_fold_cells(filed, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    filed.write("block.cfg")
    (tmp_path / "motion.csv").write_text("BLOCK.translate.y\n0.35\n0.02\n")
    monkeypatch.setattr("slideviz.cli.film_command.draw", lambda session, *_, **__: iter(()))
    call = ["film", "block.cfg", "--designs", "motion.csv", "-o", "film.gif", "-q"]
    monkeypatch.setattr("slideviz.cli.film_command.closing", nullcontext)
    assert run(call) == 3
    error = capsys.readouterr().err
    assert "cells are inverted at design 1 of 2; `slideviz sweep block.cfg motion.csv --m" in error
    assert "design 2" not in error


def test_a_motion_that_is_rounding_moves_nothing(filed, tmp_path):
    table = {"time": [0, 8], "BLOCK.translate.y": [0.0, 1e-3 * np.sin(np.pi)]}
    rows = swept(filed, table, folder=tmp_path / "out")
    assert [row.problem for row in rows] == ["", ""]
