"""Sweeps: rows as single runs give them, columns by name, results that can go on."""

from __future__ import annotations

import csv
import errno
import fcntl
import os
import socket
import subprocess
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.design.sweeps import sweep as sweeping
from slideviz.design.sweeps.sweep import (
    Packed,
    Task,
    TaskResult,
    cache_mesh,
    pack_mesh,
    run_task,
)
from slideviz.design.sweeps.table import (
    DesignRow,
    case_values,
    columns_of,
    lock_folder,
    numbers_of,
    read_designs,
)
from slideviz.errors import CaseError, DeformError
from slideviz.samples.table import sample


@pytest.fixture(scope="module")
def passage():
    return sample("passage", 12)


@pytest.fixture
def here():
    with ThreadPoolExecutor(2) as executor:
        yield executor


DESIGNS = {"airfoil.rotate.angle_deg": [-1.0, -4.0, -8.0], "airfoil.translate.y": [0.0, 0.05, 0.1]}


def turned(case, angle, up):
    rotation, shift = case.motions
    return case.change(
        motions=(replace(rotation, angle_deg=angle), replace(shift, vector=(0.0, up)))
    )


def swept(case, designs, executor, **options):
    return sorted(sv.sweep(case, designs, executor, **options), key=lambda row: row.design)


def test_rows_are_what_single_runs_give_to_the_bit(passage, here):
    rows = swept(passage.case, DESIGNS, here, mesh=passage.mesh)
    assert [row.design for row in rows] == [1, 2, 3]
    for row, angle, up in zip(rows, *DESIGNS.values(), strict=True):
        *steps, last = sv.deform(turned(passage.case, angle, up), passage.mesh)
        found = sv.quality(last.mesh, reference=passage.mesh)
        errors = [step.max_error for step in (*steps, last)]
        assert (row.min, row.mean, row.inverted) == (found.min, found.mean, found.inverted)
        assert (row.control_nodes, row.steps) == (last.control_nodes, last.total)
        assert row.max_error == max(errors)
        assert row.problem == ""
        assert row.values == {"airfoil.rotate.angle_deg": angle, "airfoil.translate.y": up}
        assert row.seconds > 0.0


def test_keys_and_empty_values(passage, here):
    rows = swept(
        passage.case,
        [{"steps": 2, "SLIDING_MODE": "ds"}, {"steps": "", "sliding_mode": "ps"}],
        here,
        mesh=passage.mesh,
    )
    assert [row.steps for row in rows] == [2, passage.case.steps]
    *_, last = sv.deform(passage.case.change(steps=2, sliding="ds"), passage.mesh)
    assert rows[0].min == sv.quality(last.mesh, reference=passage.mesh).min
    assert rows[0].values == {"STEPS": 2, "SLIDING_MODE": "ds"}


def test_a_design_that_fails_is_a_row_with_the_reason(passage, here):
    designs = {"airfoil.rotate.angle_deg": [1.0, 1.0], "PERIODIC_MODE": ["moving", "moving"]}
    designs["SLIDING_MODE"] = ["none", "ps"]
    rows = swept(passage.case, designs, here, mesh=passage.mesh)
    assert "PERIODIC_MODE= moving needs a sliding method" in rows[0].problem
    assert np.isnan(rows[0].min)
    assert rows[1].problem == ""


def mesh_with_box(folder, corners):
    """A square of 8 by 8 cells, read from a file that has a box."""
    from slideviz.ffd.box import plane_corners, regular_box
    from slideviz.ffd.section import with_boxes

    x, y = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9), indexing="ij")
    number = np.arange(81).reshape(9, 9)
    around = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    sides = {"low": number[:, 0], "high": number[:, -1]}
    mesh = sv.Mesh(
        np.stack([x.ravel(), y.ravel()], axis=1),
        sv.Cells.from_blocks([(9, np.stack(around, axis=-1).reshape(-1, 4))]),
        tuple(
            sv.Marker(name, sv.Cells.from_blocks([(3, np.stack([side[:-1], side[1:]], axis=1))]))
            for name, side in sides.items()
        ),
    )
    box = regular_box("BOX", plane_corners(np.array(corners)[:, :2]), (3, 1, 1), None)
    sv.write(folder / "boxed.su2", with_boxes(mesh, [box]))
    return sv.read(folder / "boxed.su2")


def test_columns_have_several_names(passage):
    case = passage.case
    for one, other in [
        ("airfoil.rotate.degrees", "motion1.angle_deg"),
        ("AIRFOIL.translate.dy", "motion2.y"),
        ("airfoil.translate.Y", "Motion2.DY"),
    ]:
        assert columns_of(case, [one])[one] == columns_of(case, [other])[other]
    assert "airfoil.translate.y" in numbers_of(case)
    named = columns_of(case, ["airfoil.translate.y", "STEPS"])
    assert case_values(case, named) == {"airfoil.translate.y": 0.12, "STEPS": "5"}


def test_numbers_of_every_motion():
    case = sv.Case(
        roles={"a": "moving", "b": "moving"},
        motions=(
            sv.Translate("a", (1, 2.0)),
            sv.Translate("a", (0.0, 0.0)),
            sv.Scale(("a", "b"), (1.1,), (0.0, 0.5)),
            sv.Radial("", 1.5, 0.1),
        ),
    )
    known = numbers_of(case)
    assert list(known)[:4] == ["motion1.x", "motion1.y", "motion2.x", "motion2.y"]
    assert {"a+b.scale.factor", "a+b.scale.point_x", "*.radial.factor", "*.radial.distance"} < set(
        known
    )
    values = {name: place.of(case) for name, place in known.items()}
    assert (values["motion1.x"], values["a+b.scale.factor"]) == (1.0, 1.1)
    made = read_designs(case, [{"a+b.scale.py": 7, "*.radial.dr": 3}]).rows[0].case
    assert made.motions[2].point == (0.0, 7.0)
    assert made.motions[3].distance == 3.0
    with pytest.raises(CaseError, match=r"several motions have it; say which, e.g. motion1.x"):
        columns_of(case, ["a.translate.x"])


def test_control_points_of_boxes_are_numbers_too(here, tmp_path):
    corners = [(-0.1, -0.2, 0), (1.1, -0.2, 0), (1.1, 0.3, 0), (-0.1, 0.3, 0)]
    square = mesh_with_box(tmp_path, corners)
    moves = [sv.Ffd("low", "BOX", (k, -1, -1), (0.0, 0.0, 0.0)) for k in (1, 2)]
    case = sv.Case(roles={"low": "moving"}, motions=tuple(moves))
    names = ["low.ffd.BOX.1.-1.-1.dy", "low.ffd.box.2.-1.-1.Y"]
    designs = [dict(zip(names, values, strict=True)) for values in ((0.1, 0.0), (0.05, -0.05))]
    rows = swept(case, designs, here, mesh=square, folder=tmp_path / "out")
    for row, (one, other) in zip(rows, ((0.1, 0.0), (0.05, -0.05)), strict=True):
        moved = [replace(m, vector=(0.0, y, 0.0)) for m, y in zip(moves, (one, other), strict=True)]
        *_, last = sv.deform(case.change(motions=tuple(moved)), square)
        assert row.min == sv.quality(last.mesh, reference=square).min < 1.0
    with pytest.raises(CaseError, match=r"low.ffd.BOX.1.-1.-1.x, low.ffd.BOX.1.-1.-1.y"):
        columns_of(case, ["brightness"])
    with pytest.raises(CaseError, match=r"did you mean low.ffd.BOX.2.-1.-1.y\?"):
        columns_of(case, ["low.ffd.BOX.3.-1.-1.y"])
    other = mesh_with_box(tmp_path, [*corners[:2], (1.1, 0.4, 0), (-0.1, 0.4, 0)])
    with pytest.raises(CaseError, match="the FFD_TAG section of the mesh changed"):
        swept(case, designs, here, mesh=other, folder=tmp_path / "out", resume=True)


def test_displacements_of_a_program(passage, here, tmp_path):
    nodes = passage.mesh.marker("airfoil").nodes
    given = sv.Prescribed(nodes, np.full((len(nodes), 2), 0.01))
    case = passage.case.change(motions=(given,))
    asked = {"mesh": passage.mesh, "folder": tmp_path}
    (row,) = swept(case, {"STEPS": [1]}, here, **asked)
    assert row.problem == ""
    assert numbers_of(case) == {}
    assert swept(case, {"STEPS": [1]}, here, resume=True, **asked)[0].earlier
    other = case.change(motions=(sv.Prescribed(nodes, 2 * given.vectors),))
    with pytest.raises(CaseError, match="the displacement 1 changed"):
        swept(other, {"STEPS": [1]}, here, resume=True, **asked)


def test_markers_that_differ_in_capitals_alone():
    case = sv.Case(motions=(sv.Translate("ab", (0.0, 0.0)), sv.Translate("AB", (0.0, 0.0))))
    found = columns_of(case, ["AB.translate.dx", "ab.translate.dx"])
    assert [place.motion for place in found.values()] == [1, 0]
    with pytest.raises(CaseError, match=r"say which, e.g. ab.translate.x, .*AB.translate.x"):
        columns_of(case, ["Ab.translate.dx"])


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["airfoil.rotat.angle_deg"], r"no such key; did you mean airfoil.rotate.angle_deg\?$"),
        (
            ["airfoil.scale.x"],
            r"the case has no motion \(airfoil, scale, ...\); add one to MOT",
        ),
        (
            ["airfoil.ffd.y"],
            r"no motion \(airfoil, ffd, ...\); .* the motions have airfoil.r",
        ),
        (["airfoi.rotate.angle_deg"], r"did you mean airfoil.rotate.angle_deg\?$"),
        (["zzz"], r"the motions have airfoil.rotate.angle_deg, .*airfoil.translate.y"),
        (["MESH_FILENAME"], "files and the view come from the case"),
        (["STEPS", "steps"], "means the same as column STEPS"),
        (["motion2.y", "airfoil.translate.dy"], "means the same as column motion2.y"),
        (["motion2.y", "MOTION"], "replaces motions whose numbers"),
    ],
)
def test_columns_that_cannot_be(passage, names, said):
    with pytest.raises(CaseError, match=said):
        columns_of(passage.case, names)


def test_every_wrong_value_is_told_with_its_line(passage, tmp_path):
    table = tmp_path / "designs.csv"
    table.write_text("motion2.y;STEPS\n# a remark\n\n0,1;2\nnan;x\n1;2;3\n")
    with pytest.raises(CaseError) as problem:
        read_designs(passage.case, table)
    assert str(problem.value).splitlines() == [
        f"{table}:4: column 'motion2.y': '0,1' is not a number; write decimals with a point",
        f"{table}:5: column 'STEPS': 'x' is not a whole number from 1 to 9999, or auto",
        f"{table}:5: column 'motion2.y': 'nan' is not a number",
        f"{table}:6: has 3 values, and the head 2 columns; give as many",
    ]
    table.write_text("motion2.yy,STEPS\n0,x\n1,1\n")
    with pytest.raises(CaseError) as problem:
        read_designs(passage.case, table)
    head, row = str(problem.value).splitlines()
    assert head.startswith(f"{table}:1: column 'motion2.yy': there is no such number")
    assert row == f"{table}:2: column 'STEPS': 'x' is not a whole number from 1 to 9999, or auto"
    with pytest.raises(CaseError, match=r"design 2: column 'motion2.y': inf is not a finite"):
        read_designs(passage.case, {"motion2.y": [0.0, np.inf]})
    with pytest.raises(CaseError, match="different numbers of values"):
        read_designs(passage.case, {"motion2.y": [0.0], "STEPS": [1, 2]})
    table.write_text("motion2.y\n")
    with pytest.raises(CaseError, match="has no designs"):
        read_designs(passage.case, table)
    with pytest.raises(CaseError, match="table of designs is empty"):
        read_designs(passage.case, [])


def lines_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_stopped_sweep_goes_on(passage, here, tmp_path):
    asked = {"mesh": passage.mesh, "folder": tmp_path, "meshes": True}
    rows = sv.sweep(passage.case, DESIGNS, here, **asked)
    first = next(rows)
    rows.close()
    table = tmp_path / "results.csv"
    assert [int(line["design"]) for line in lines_of(table)] == [first.design]
    with table.open("a") as file:
        file.write("3,-8.0,0.1,0.")  # cut off in the middle
    with pytest.raises(CaseError, match="there are results already"):
        sv.sweep(passage.case, DESIGNS, here, **asked)
    again = list(sv.sweep(passage.case, DESIGNS, here, resume=True, **asked))
    assert again[0] == replace(first, earlier=True)
    assert sorted(row.design for row in again) == [1, 2, 3]
    whole = {row.design: row for row in again}
    for line in lines_of(table):
        row = whole[int(line["design"])]
        assert (float(line["min"]), float(line["airfoil.translate.y"])) == (
            row.min,
            row.values["airfoil.translate.y"],
        )
        assert row.mesh == tmp_path / line["mesh"]
        *_, last = sv.deform(turned(passage.case, *row.values.values()), passage.mesh)
        assert np.array_equal(sv.read(row.mesh).points, last.mesh.points)
    assert [line["design"] for line in lines_of(table)] == ["1", "2", "3"]
    # A row more at the end of the table is no other table; a mesh that is gone is made again.
    whole[2].mesh.unlink()
    longer = {name: [*values, 0.0] for name, values in DESIGNS.items()}
    more = swept(passage.case, longer, here, resume=True, **asked)
    assert [row.earlier for row in more] == [True, False, True, False]
    assert whole[2].mesh.exists()


def test_what_failed_is_done_again(passage, here, tmp_path):
    asked = {"mesh": passage.mesh, "folder": tmp_path}
    missing = tmp_path / "later.txt"
    designs = {"DEFORMATION_FILENAME": [str(missing)]}
    case = passage.case.change(motions=())
    (row,) = sv.sweep(case, designs, here, **asked)
    assert "there is no such displacement file" in row.problem
    nodes = passage.mesh.marker("airfoil").nodes
    missing.write_text("".join(f"{node} 0.0 0.01\n" for node in nodes))
    (row,) = sv.sweep(case, designs, here, resume=True, **asked)
    assert row.problem == ""
    assert len(lines_of(tmp_path / "results.csv")) == 1


def test_results_of_something_else_are_refused(passage, here, tmp_path):
    asked = {"mesh": passage.mesh, "folder": tmp_path, "resume": True}
    list(sv.sweep(passage.case, DESIGNS, here, **asked))
    with pytest.raises(CaseError, match="SLIDING_MODE= ps before, ds now"):
        sv.sweep(passage.case.change(sliding="ds"), DESIGNS, here, **asked)
    other = {**DESIGNS, "airfoil.translate.y": [0.0, 0.06, 0.1]}
    with pytest.raises(CaseError, match=r"design 2 was made with airfoil.translate.y= 0.05"):
        sv.sweep(passage.case, other, here, **asked)
    with pytest.raises(CaseError, match="has other columns"):
        sv.sweep(passage.case, {"STEPS": [1, 2, 3]}, here, **asked)
    fewer = {name: values[:2] for name, values in DESIGNS.items()}
    with pytest.raises(CaseError, match="has design 3, and the table of designs has 2"):
        sv.sweep(passage.case, fewer, here, **asked)
    moved = passage.mesh.with_points(passage.mesh.points + 1.0)
    with pytest.raises(CaseError, match="the mesh changed"):
        sv.sweep(passage.case, DESIGNS, here, **(asked | {"mesh": moved}))
    table = tmp_path / "results.csv"
    table.write_text(table.read_text() + "1,2\n")
    with pytest.raises(CaseError, match=r"results.csv:5: is not a row of a sweep"):
        sv.sweep(passage.case, DESIGNS, here, **asked)
    (tmp_path / "sweep.json").unlink()
    for text in ("", "[" * 10**5, '{"mesh": 3}', "[]"):
        (tmp_path / "sweep.json").write_text(text)
        with pytest.raises(CaseError, match="is missing or not readable"):
            sv.sweep(passage.case, DESIGNS, here, **asked)
    rows = list(sv.sweep(passage.case, DESIGNS, here, **asked | {"resume": False, "force": True}))
    assert not any(row.earlier for row in rows)


def test_asked_in_vain(passage):
    with pytest.raises(CaseError, match="the case names no mesh"):
        sv.sweep(passage.case.change(mesh_file=None), DESIGNS)
    with pytest.raises(CaseError, match="need a folder"):
        sv.sweep(passage.case, DESIGNS, mesh=passage.mesh, meshes=True)
    with pytest.raises(CaseError, match="workers is 0"):
        sv.sweep(passage.case, DESIGNS, mesh=passage.mesh, workers=0)


def test_the_mesh_is_sent_to_who_needs_it(passage):
    task = Task(1, passage.case, "no such mesh")
    assert run_task(task).row is None
    mesh = pack_mesh(passage.mesh)
    assert run_task(replace(task, mesh=mesh.name, packed=mesh)).row.problem == ""
    assert run_task(replace(task, mesh=mesh.name)).row.problem == ""
    other = run_task(replace(task, version="0.0.0")).row
    assert "install the same version" in other.problem
    for name in "ab":  # another sweep uses the same processes
        cache_mesh(Packed(name, mesh.content))
    assert run_task(replace(task, mesh=mesh.name)).row is None


class Losing(Executor):
    """An executor that loses the worker of some calls, and has two that lack the mesh."""

    def __init__(self, losses):
        self._losses, self.sent, self.calls = list(losses), 0, 0

    def submit(self, fn, /, task):
        future = Future()
        self.calls += 1
        self.sent += task.packed is not None
        if self.calls <= 2:
            future.set_result(TaskResult(f"worker {self.calls}"))
        elif task.design in self._losses:
            self._losses.remove(task.design)
            future.set_exception(BrokenExecutor("killed"))
        else:
            future.set_result(TaskResult("worker 1", DesignRow(task.design, min=0.5)))
        return future


def test_a_lost_worker_loses_one_design_which_is_done_again(passage):
    executor = Losing([2, 2, 3])
    rows = swept(passage.case, DESIGNS, executor, mesh=passage.mesh)
    assert [(row.lost, row.problem) for row in rows] == [(0, ""), (2, ""), (1, "")]
    assert executor.sent >= 1


def test_a_design_that_always_loses_its_worker_is_a_row(passage):
    rows = swept(passage.case, DESIGNS, Losing([2] * 9), mesh=passage.mesh)
    assert [row.problem == "" for row in rows] == [True, False, True]
    assert f"its worker was lost {sweeping.LOST} times" in rows[1].problem


def test_an_executor_that_is_broken(passage):
    with ThreadPoolExecutor(1) as executor:
        executor.shutdown()
        with pytest.raises(DeformError, match="the executor takes no more work"):
            list(sv.sweep(passage.case, DESIGNS, executor, mesh=passage.mesh))


def test_a_large_file_is_opened_in_the_other_process_too(passage, tmp_path, monkeypatch):
    import pickle

    from slideviz.formats import source

    monkeypatch.setattr(source, "KEPT_BYTES", 100)
    file = tmp_path / "passage.su2"
    sv.write(file, passage.mesh)
    mesh = sv.read(file)
    sent = pickle.loads(pack_mesh(mesh).content)
    moved = mesh.points * 1.5
    sv.write(tmp_path / "one.su2", mesh.with_points(moved))
    sv.write(tmp_path / "other.su2", sent.with_points(moved))
    assert (tmp_path / "one.su2").read_bytes() == (tmp_path / "other.su2").read_bytes()
    content = pack_mesh(mesh).content
    file.write_bytes(file.read_bytes() + b"% more\n")
    with pytest.raises(sv.SlidevizError, match="was changed while it was in use"):
        pickle.loads(content)


def test_a_design_has_one_thread(passage, monkeypatch):
    from numba import get_num_threads
    from threadpoolctl import threadpool_info

    from slideviz.design.sweeps import sweep as module

    def threads():
        return [get_num_threads(), *(one["num_threads"] for one in threadpool_info())]

    found = []

    def watched(*values):
        found.append(threads())
        return sv.deform(*values)

    monkeypatch.setattr(module, "deform", watched)
    mesh = pack_mesh(passage.mesh)
    run_task(Task(1, passage.case, mesh.name, packed=mesh))  # libraries are loaded by the first
    before = threads()
    assert run_task(Task(1, passage.case, mesh.name, packed=mesh)).row.problem == ""
    assert set(found[-1]) == {1}
    assert threads() == before


def test_of_two_sweeps_in_a_folder_the_second_is_refused(passage, here, tmp_path):
    asked = {"mesh": passage.mesh, "folder": tmp_path}
    # A process that was killed leaves the file; nobody holds it.
    (tmp_path / "sweep.lock").write_text("1\n")
    rows = sv.sweep(passage.case, DESIGNS, here, **asked)
    first = next(rows)
    for how in ({"resume": True}, {"force": True}):
        with pytest.raises(CaseError, match=rf"another sweep .* \(process {os.getpid()}\); wait"):
            sv.sweep(passage.case, DESIGNS, here, **asked, **how)
    assert len([first, *rows]) == 3
    assert not (tmp_path / "sweep.lock").exists()
    # Nor does a refusal leave it held, nor a sweep that was given up.
    with pytest.raises(CaseError, match="there are results already"):
        sv.sweep(passage.case, DESIGNS, here, **asked)
    again = sv.sweep(passage.case, DESIGNS, here, force=True, **asked)
    next(again)
    again.close()
    assert len(swept(passage.case, DESIGNS, here, resume=True, **asked)) == 3


def test_a_lock_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "sweep.lock").mkdir()
    with pytest.raises(CaseError, match=r"sweep\.lock: cannot be written: .*folder"):
        lock_folder(tmp_path)
    (tmp_path / "sweep.lock").rmdir()
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "sweep.lock").symlink_to(tmp_path / "precious")
    with pytest.raises(CaseError, match=r"sweep\.lock: .* it is a symbolic link, whose"):
        lock_folder(tmp_path)
    assert (tmp_path / "precious").read_text() == "precious"
    (tmp_path / "sweep.lock").unlink()
    os.mkfifo(tmp_path / "sweep.lock")
    with pytest.raises(CaseError, match=r"sweep\.lock: this is a device or pipe"):
        lock_folder(tmp_path)


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_without_locks_of_the_file_system_the_file_is_the_lock(tmp_path, monkeypatch, number):
    def flock(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", flock)
    lock = lock_folder(tmp_path)
    with pytest.raises(CaseError, match=rf"another sweep .* \(process {os.getpid()}\); wait"):
        lock_folder(tmp_path)
    lock.release()
    assert not (tmp_path / "sweep.lock").exists()
    dead = subprocess.Popen(["true"])
    dead.wait()
    (tmp_path / "sweep.lock").write_text(f"{dead.pid}\n{socket.gethostname()}\n")
    lock_folder(tmp_path).release()


def test_a_lock_into_which_nobody_may_write_is_held(tmp_path, monkeypatch):
    """Windows lets nobody write a locked file, not even its owner."""

    def refused(*_, **__):
        raise PermissionError(errno.EACCES, "locked")

    monkeypatch.setattr(Path, "write_text", refused)
    lock = lock_folder(tmp_path)
    with pytest.raises(CaseError, match="another sweep writes its results here"):
        lock_folder(tmp_path)
    lock.release()


def test_fields_of_endless_length_are_told(passage, here, tmp_path):
    long = "x" * 200_000
    for head, row, line in ((f"STEPS,{long}", "1,2", 1), ("STEPS", long, 2)):
        (tmp_path / "a.csv").write_text(f"{head}\n{row}\n")
        with pytest.raises(
            CaseError,
            match=rf"a.csv:{line}: is not a line of values \(field larger",
        ):
            read_designs(passage.case, tmp_path / "a.csv")
    asked = {"mesh": passage.mesh, "folder": tmp_path, "resume": True}
    list(sv.sweep(passage.case, {"STEPS": [1]}, here, **asked))
    table = tmp_path / "results.csv"
    table.write_text(f"{table.read_text()}{long}\n")
    with pytest.raises(CaseError, match=r"results.csv: is not a table of a sweep \(field larger"):
        sv.sweep(passage.case, {"STEPS": [1]}, here, **asked)
