"""Streamed runs: the bits of a run in memory, whatever the chunks; what a stop leaves."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.cli.mesh_source import changed
from slideviz.errors import CaseError, MeshError, NodeError, UnsoundError
from slideviz.formats.su2b.layout import MAGIC
from slideviz.samples.table import write_sample
from slideviz.solver.deform import folded_at
from slideviz.solver.steps import Progress, Step
from slideviz.streaming import (
    interior,
    stream_input,
    streamed_repair,
)
from slideviz.streaming import run as streamed_run
from slideviz.streaming.run import SECONDS, stream
from slideviz.streaming.skin import read_skin
from slideviz.system.cleanup import PREFIX, draft
from tests.builders import grid
from tests.formats.test_su2b import WHOLE, change

RUNS = [
    ("square", 25, ("STEPS=3",)),
    ("square", 25, ("STEPS=3", "SLIDING_MODE=ds")),
    ("square", 25, ("STEPS=1", "SLIDING_MODE=none", "PERIODIC_MODE=none")),
    ("square", 25, ("STEPS=2", "RBF_KERNEL=thin-plate", "PERIODIC_MODE=fixed")),
    ("square", 25, ("STEPS=2", "POLYNOMIAL=YES", "INFLUENCE_FACTOR=0.3")),
    ("square", 25, ("STEPS=2", "METHOD=idw")),
    ("square", 25, ("STEPS=2", "DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=1e-2")),
    ("polar", 25, ("STEPS=2", "PERIODIC_MODE=periodic", "SLIDING_MODE=ds")),
    ("hexahedron", 9, ("STEPS=2",)),
    ("cylindrical", 9, ("STEPS=2", "METHOD=idw")),
    ("cylindrical", 6, ("STEPS=2", "PERIODIC_MODE=none", "RBF_KERNEL=thin-plate")),
    ("turbine-row", 5000, ("STEPS=2", "DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=1e-6")),
    pytest.param("stator", 7000, ("STEPS=2",), marks=pytest.mark.slow),
    pytest.param(
        *("square", 25, ("STEPS=auto", "SLIDING_MODE=none", "PERIODIC_MODE=none")),
        marks=pytest.mark.slow,
    ),
    ("polar", 12, ("STEPS=auto",)),
    ("airfoil", 24, ("STEPS=2",)),
    ("turbine-row", 5000, ("STEPS=2", "LAYERS=AUTO")),
    ("polar", 12, ("STEPS=2", "LAYERS=KEEP", "LAYER_THICKNESS=0.1")),
    ("cylindrical", 6, ("STEPS=2", "LAYERS=KEEP", "LAYER_THICKNESS=0.1")),
    ("airfoil", 24, ("STEPS=1", "DATA_REDUCTION=YES", "DATA_RED_TOLERANCE=1e-3")),
    ("square", 25, ("STEPS=1", "SLIDING_MODE=none", "PERIODIC_MODE=none", "REPAIR=YES")),
    ("square", 25, ("STEPS=2", "REPAIR=AUTO", "REPAIR_BELOW=0.5")),
    ("polar", 12, ("STEPS=1", "REPAIR=YES", "REPAIR_BELOW=0.6")),
    ("cylindrical", 6, ("STEPS=1", "REPAIR=YES", "REPAIR_BELOW=0.5")),
    pytest.param(
        *("stator", 7000, ("STEPS=1", "REPAIR=YES", "REPAIR_BELOW=0.75")),
        marks=pytest.mark.slow,
    ),
]
"""Sample, size and changes of its case: every sliding method, periodic mode and kind of frame."""


def made(folder, name, size, sets=()):
    write_sample(name, folder, size, file_format="su2b")
    return changed(sv.Case.read(folder / f"{name}.cfg"), sets)


def bits(points):
    return points.view(np.int64)


OTHERWISE = {"mesh", "control", "seconds", "condition", "repaired", "kept_layers"}
OTHERWISE |= {"field", "check_limits", "history"}
"""What a streamed step has of its skin or its file alone, and what is checked by itself below."""


def require_same(done, steps, mesh):
    """Check quality, folded cells and steps of a streamed run against those of one in memory."""
    found = sv.quality(steps[-1].mesh, mesh)
    ids = found.inverted_cells(100)
    assert done.quality.summary() == found.summary()
    assert np.array_equal(done.quality.values, found.values)
    assert done.undeformed.summary() == sv.quality(mesh).summary()
    when = {cell: step for cell, (_, step) in done.folded.items()}
    assert when == dict(zip(ids.tolist(), folded_at(steps, mesh, ids).tolist(), strict=True))
    for one, other in zip(steps, done.steps, strict=True):
        for field in {field.name for field in fields(Step)} - OTHERWISE:
            assert getattr(one, field) == getattr(other, field), field
        assert np.array_equal(one.condition, other.condition, equal_nan=True)
        assert (one.kept_layers is None) == (other.kept_layers is None)
        if one.kept_layers is not None:
            assert one.kept_layers.walls == other.kept_layers.walls
        assert len(one.control) == len(other.control)
        cycles = ([replace(cycle, seconds=0.0) for cycle in step.history] for step in (one, other))
        assert next(cycles) == next(cycles)
        assert (one.repaired is None) == (other.repaired is None)


@pytest.mark.parametrize(("name", "size", "sets"), RUNS)
def test_bits_are_those_of_a_run_in_memory(tmp_path, monkeypatch, name, size, sets):
    case = made(tmp_path, name, size, sets)
    mesh = sv.read(case.mesh_file)
    steps = list(sv.deform(case, mesh, certify=True))
    for chunk in (37, 1 << 20):
        monkeypatch.setattr(streamed_run, "CHUNK", chunk)
        monkeypatch.setattr(streamed_repair, "CELLS", chunk)
        done = stream(case, tmp_path / "out.su2b")
        moved = sv.read(tmp_path / "out.su2b")
        assert np.array_equal(bits(moved.points), bits(steps[-1].mesh.points))
        assert moved.cells.same_as(mesh.cells)
        require_same(done, steps, mesh)
        for one, other in zip(steps, done.steps, strict=True):
            if one.repaired is not None:
                assert len(one.repaired.nodes)
                assert one.repaired.report() == other.repaired.report()
    assert sorted(p.name for p in tmp_path.glob(".*")) == []


def test_folded_cells_are_followed_through_the_steps(tmp_path, monkeypatch):
    monkeypatch.setattr(streamed_run, "CHUNK", 50)
    case = made(tmp_path, "square", 25, ("STEPS=3", "SLIDING_MODE=none", "PERIODIC_MODE=none"))
    case = case.change(motions=(sv.Rotate(case.markers_with("moving")[0], 170.0),))
    mesh = sv.read(case.mesh_file)
    steps = list(sv.deform(case, mesh))
    found = sv.quality(steps[-1].mesh, mesh)
    assert found.inverted > 5
    done = stream(case, tmp_path / "out.su2b", listed=5)
    ids = found.inverted_cells(5)
    assert list(done.folded) == ids.tolist()
    assert [step for _, step in done.folded.values()] == folded_at(steps, mesh, ids).tolist()
    assert {vtk for vtk, _ in done.folded.values()} == {9}


@pytest.mark.parametrize("kind", ["mixed", "prism"])
def test_cells_in_another_order_and_other_zones_stay(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(streamed_run, "CHUNK", 40)
    mesh = grid((5, 4, 4), kind=kind)
    assert kind == "prism" or len(mesh.cells.by_type) > 1
    path = tmp_path / "mesh.su2b"
    sv.write(tmp_path / "a.su2", mesh)
    text = (tmp_path / "a.su2").read_text()
    (tmp_path / "two.su2").write_text(f"NZONE= 2\nIZONE= 1\n{text}IZONE= 2\n{text}")
    sv.convert(tmp_path / "two.su2", path)
    case = sv.Case(
        mesh_file=path,
        zone=2,
        roles={"x_p": "moving", "y_m": "sliding"},
        motions=(sv.Translate("x_p", (0.2, 0.1, 0.0)),),
        sliding="ds",
        steps=2,
    )
    done = stream(case, tmp_path / "out.su2b")
    second = sv.read(path, zone=2)
    *_, last = sv.deform(case, second)
    sv.write(tmp_path / "memory.su2b", last.mesh)
    assert (tmp_path / "out.su2b").read_bytes() == (tmp_path / "memory.su2b").read_bytes()
    assert np.array_equal(done.quality.values, sv.quality(last.mesh, second).values)


def test_the_command_writes_the_same_files_and_report(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made(tmp_path, "square", 25)
    call = ["run", "square.cfg", "--steps", "2"]
    texts = []
    for more in ([], ["--stream"]):
        assert run([*call, "-o", "out.su2b", "--json", "-", *more]) == 0
        report = json.loads(capsys.readouterr().out)
        assert all(part >= 0 for part in report.pop("seconds").values())
        assert len(report.pop("condition")) == 2  # an estimate, which differs from run to run
        assert bool(report.pop("walls")) == (not more)  # streamed runs do not measure them
        texts.append((report, Path("out.su2b").read_bytes(), Path("out_qual.txt").read_bytes()))
    assert texts[0] == texts[1]
    assert run([*call, "-o", "mesh.su2b", "--stream"]) == 1
    assert "is the input mesh" in capsys.readouterr().err
    assert run([*call, "-o", "mesh.su2b", "--stream", "--force", "-q"]) == 0
    assert Path("mesh.su2b").read_bytes() == texts[0][1]


class StoppedError(BaseException):
    """What ends a run early, but is no error of it, like Ctrl+C."""


def stopped_after(move, count):
    """Return what writes ``count`` parts, and not the next one."""
    calls = []

    def moving(*arguments):
        if len(calls) == count:
            raise StoppedError
        calls.append(1)
        return move(*arguments)

    return moving


def hidden(path):
    """Return the temporary files beside a file that is being written."""
    return list(path.parent.glob(f"{PREFIX}*"))


@pytest.mark.parametrize("quiet", [[], ["-q"]])
def test_a_streamed_run_says_at_once_that_it_measures_no_heights(tmp_path, capsys, quiet):
    made(tmp_path, "square", 8, ("STEPS=1",))
    call = ["run", str(tmp_path / "square.cfg"), "-o", str(tmp_path / "out.su2b"), "--stream"]
    assert run([*call, *quiet]) == 0
    said = capsys.readouterr().err
    words = "note: a streamed run does not measure how it changes the first heights of layers"
    assert (words in said) == (not quiet)


def test_a_run_that_is_stopped_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(streamed_run, "CHUNK", 60)
    case = made(tmp_path, "square", 25, ("STEPS=2",))
    out = tmp_path / "out.su2b"
    out.write_bytes(b"older")
    parts = -(-len(sv.read(case.mesh_file).points) // 60)
    for stop in sorted({0, 1, parts // 2, parts - 1}):
        with monkeypatch.context() as patch:
            patch.setattr(
                streamed_run, "write_points", stopped_after(streamed_run.write_points, stop)
            )
            with pytest.raises(StoppedError):
                stream(case, out)
        assert out.read_bytes() == b"older"
        assert not list(tmp_path.glob(".*"))


def test_what_is_not_complete_cannot_be_read(tmp_path):
    case = made(tmp_path, "square", 25, ("STEPS=1",))
    out = tmp_path / "out.su2b"
    heads = []
    stream(case, out, report=lambda _: heads.extend(f.read_bytes()[:4] for f in hidden(out)))
    assert heads
    assert not set(heads) & set(MAGIC)


@pytest.mark.parametrize("ending", ["su2", "su2b"])
def test_what_a_killed_run_has_left_is_removed(tmp_path, monkeypatch, ending):
    case = made(tmp_path, "square", 8, ("STEPS=1",))
    out = tmp_path / f"out.{ending}"
    stream(case, out)
    whole = out.read_bytes()
    monkeypatch.setattr(os, "getpid", lambda: 2**22 + 1)  # which no process has
    with draft(tmp_path) as left:
        monkeypatch.undo()
        left.write_bytes(b"left" * len(whole))
        stream(case, out)
        assert not left.exists()
    assert out.read_bytes() == whole
    assert not list(tmp_path.glob(".*"))


def test_nodes_on_sides_without_a_marker_stay(tmp_path):
    mesh, path = grid((9, 9)), tmp_path / "mesh.su2b"
    sv.write(path, replace(mesh, markers=mesh.markers[:2]))
    case = sv.Case(
        mesh_file=path,
        roles={"x_m": "moving"},
        motions=(sv.Rotate("x_m", 15.0, (0.0, 0.5)),),
        repair="yes",
        repair_below=0.95,
    )
    mesh = sv.read(path)
    *_, last = sv.deform(case, mesh)
    bare = mesh.points[:, 1] == mesh.points[:, 1].max()
    assert bare[mesh.cells.take(last.repaired.cells).nodes].any()
    assert not bare[last.repaired.nodes].any()
    stream(case, tmp_path / "out.su2b")
    assert np.array_equal(bits(sv.read(tmp_path / "out.su2b").points), bits(last.mesh.points))


@pytest.mark.parametrize("height", [0.15, 0.185])
def test_repair_holds_layers_as_in_memory_where_no_cell_stays_folded(tmp_path, height):
    mesh, path = grid((30, 20), place=lambda p: p * [1 / 30, 0.01]), tmp_path / "mesh.su2b"
    sv.write(path, mesh)
    case = sv.Case(
        mesh_file=path,
        roles={"y_m": "moving", "x_p": "internal"},
        motions=(sv.Rotate("y_m", np.degrees(height), (0.0, 0.0)),),
        layers="keep",
        repair="yes",
        repair_below=0.4,
    )
    mesh = sv.read(path)
    *_, last = sv.deform(case, mesh)
    said = [text for text in last.warnings if "of layers moved" in text]
    assert len(said) == (height > 0.15)
    assert len(last.repaired.nodes)
    done = stream(case, tmp_path / "out.su2b")
    assert np.array_equal(bits(sv.read(tmp_path / "out.su2b").points), bits(last.mesh.points))
    assert done.steps[-1].warnings == last.warnings


def test_bad_cells_stay_where_their_repair_does_not_fit_into_memory(tmp_path, monkeypatch):
    sets = "STEPS=1", "SLIDING_MODE=none", "PERIODIC_MODE=none", "REPAIR=YES"
    case = made(tmp_path, "square", 25, sets)
    plain = stream(case.change(repair="no"), tmp_path / "plain.su2b")
    monkeypatch.setattr(streamed_repair, "free_memory", lambda: 1e5)
    done = stream(case, tmp_path / "out.su2b")
    assert done.quality.summary() == plain.quality.summary()
    assert "bad cells stay as they are" in done.steps[-1].warnings[-1]
    assert len(done.steps[-1].repaired.left) == len(done.steps[-1].repaired.cells) > 0


def test_an_error_leaves_nothing(tmp_path, monkeypatch):
    case = made(tmp_path, "square", 8, ("STEPS=1",))
    out = tmp_path / "out.su2b"
    out.write_bytes(b"older")

    def stop(progress):
        if progress.phase == "quality" and progress.fraction:
            raise RuntimeError

    with pytest.raises(RuntimeError):
        stream(case, out, report=stop)
    assert out.read_bytes() == b"older"
    assert not list(tmp_path.glob(".*"))
    monkeypatch.setattr(interior, "overshoot_of_rest", lambda *_: "would go too far")
    with pytest.raises(UnsoundError, match=r"step 1: node \d+ at \(.*\) would go too far"):
        stream(case, out)
    assert out.read_bytes() == b"older"


SCRIPT = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.SIG_DFL)
from slideviz.__main__ import _heed_signals
_heed_signals()
from slideviz.cli import run
from slideviz.streaming import run as streamed_run
move = streamed_run.write_points
def slow(*a):
    print("writes", flush=True)
    time.sleep(0.05)
    return move(*a)
streamed_run.write_points, streamed_run.CHUNK = slow, int(sys.argv[1])
sys.exit(run(["run", *sys.argv[2:], "-q", "--stream"]))
"""
ROOT = Path(sv.__file__).parents[1]


@pytest.mark.parametrize(
    ("number", "words"), [(signal.SIGINT, "cancelled"), (signal.SIGTERM, "ended by SIGTERM")]
)
def test_a_signal_leaves_nothing(tmp_path, number, words):
    made(tmp_path, "square", 25)
    out = tmp_path / "out.su2b"
    out.write_bytes(b"older")
    # In so many parts that it is not done before the signal.
    call = [sys.executable, "-c", SCRIPT, "1", str(tmp_path / "square.cfg"), "-o", str(out)]
    pipe = subprocess.PIPE
    process = subprocess.Popen(call, cwd=ROOT, stdout=pipe, stderr=pipe, text=True)
    assert process.stdout.read(6) == "writes"
    assert hidden(out)
    process.send_signal(number)
    _, err = process.communicate(timeout=100)
    assert (process.returncode, err) == (
        128 + number,
        f"slideviz: {words}; it leaves nothing half-written\n",
    )
    assert out.read_bytes() == b"older"
    assert not list(tmp_path.glob(".*"))


def test_what_cannot_be_streamed_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    case = made(tmp_path, "square", 8)
    out = tmp_path / "out.su2b"
    with pytest.raises(CaseError, match="RELAX= YES needs the whole mesh at once"):
        stream(case.change(relax="yes", mesh_file=out.with_name("missing.su2")), out)
    with pytest.raises(CaseError, match="METHOD= elastic needs the whole mesh at once"):
        stream(case.change(method="elastic"), out)
    sv.convert("mesh.su2b", "mesh.vtu")
    with pytest.raises(MeshError, match="only SU2 meshes, text or binary, can be streamed; make"):
        stream(case.change(mesh_file=tmp_path / "mesh.vtu"), out)
    for more, words in (
        (["--picture", "a.png"], "--picture needs the mesh in memory"),
        (["--steps-dir", "steps"], "--steps-dir needs the mesh in memory"),
        (["--steps-file", "a.vtkhdf"], "--steps-file needs the mesh in memory"),
    ):
        assert run(["run", "square.cfg", "--stream", *more]) == 1
        assert words in capsys.readouterr().err
    assert not Path("steps").exists()
    other = ["run", "square.cfg", "--stream", "--set", "MESH_FILENAME=mesh.vtu"]
    for more, words in (
        ([], "mesh.vtu: only SU2 meshes, text or binary, can be streamed"),
        (["-o", "out.vtu"], "out.vtu: a streamed run writes SU2 meshes"),
        (["-o", "out.su2b"], "mesh.vtu: only SU2 meshes, text or binary, can be streamed"),
    ):
        assert run([*other, *more]) == 1
        assert words in capsys.readouterr().err


def both_ways(tmp_path, kind="plain", **changes):
    """Write a mesh whose first cells are numbered the other way round, and return its case."""
    mesh = grid((4, 4, 3), kind=kind)
    cells = mesh.cells.connectivity.reshape(len(mesh.cells), -1).copy()
    size = cells.shape[1] // 2
    cells[:13] = cells[:13][:, [*range(size, 2 * size), *range(size)]]
    turned = sv.Cells.from_types(mesh.cells.types, cells.ravel())
    sv.write(tmp_path / "mesh.su2b", replace(mesh, cells=turned, **changes))
    return sv.Case(
        mesh_file=tmp_path / "mesh.su2b",
        roles={"x_p": "moving"},
        motions=(sv.Translate("x_p", (0.1, 0.0, 0.0)),),
    )


@pytest.mark.parametrize("kind", ["plain", "prism"])
def test_cells_numbered_both_ways_give_the_bits_of_a_run_in_memory(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(streamed_run, "CHUNK", 5)
    case = both_ways(tmp_path, kind)
    mesh = sv.read(case.mesh_file)
    assert set(sv.quality(mesh).signs) == {1, -1}
    *_, last = sv.deform(case, mesh)
    sv.write(tmp_path / "memory.su2b", last.mesh)
    done = stream(case, tmp_path / "out.su2b")
    assert (tmp_path / "out.su2b").read_bytes() == (tmp_path / "memory.su2b").read_bytes()
    assert np.array_equal(done.quality.values, sv.quality(last.mesh, mesh).values)
    assert done.quality.inverted == 0


@pytest.mark.parametrize("change", ["folded", "unmarked"])
def test_cells_numbered_both_ways_are_told_where_some_may_be_folded(tmp_path, monkeypatch, change):
    monkeypatch.setattr(streamed_run, "CHUNK", 8)
    mesh = grid((4, 4, 3))
    points = mesh.points.copy()
    points[31] += 2.0
    changes = {"points": points} if change == "folded" else {"markers": mesh.markers[:-1]}
    case = both_ways(tmp_path, **changes)
    with pytest.raises(MeshError, match=r"numbered the other way round .* without --stream"):
        stream(case, tmp_path / "out.su2b")
    assert not (tmp_path / "out.su2b").exists()


@pytest.mark.parametrize(("ending", "bytes_of_cells"), [("su2b", 18 + 20), ("su2", 18)])
def test_room_is_asked_for_before_the_work(tmp_path, monkeypatch, capsys, ending, bytes_of_cells):
    monkeypatch.chdir(tmp_path)
    case = made(tmp_path, "square", 25)
    mesh = sv.read(case.mesh_file)
    assert run(["run", "square.cfg", "-q", "--stream", "-o", f"out.{ending}"]) == 0
    size = Path(f"out.{ending}").stat().st_size
    needed = size + bytes_of_cells * len(mesh.cells)
    needed += 24 * len(mesh.points) if ending == "su2" else 0
    asked = []

    def usage(_):
        asked.append(room)
        return shutil._ntuple_diskusage(1, 1, room)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    monkeypatch.setattr(stream_input, "read_skin", lambda *_: pytest.fail("it has begun"))
    Path(f"out.{ending}").unlink()
    room = int(0.7 * needed)
    assert run(["run", "square.cfg", "-q", "--stream", "-o", f"out.{ending}"]) == 1
    said = capsys.readouterr().err
    assert "0 MB of disk are needed in " in said
    assert "0 MB are free" in said
    assert asked
    room = int(1.3 * needed)
    with pytest.raises(pytest.fail.Exception, match="it has begun"):
        run(["run", "square.cfg", "-q", "--stream", "-o", f"out.{ending}"])


def test_a_node_beyond_the_sector_of_the_boundary_is_told(tmp_path):
    case = made(tmp_path, "cylindrical", 9)
    mesh = sv.read(case.mesh_file)
    on = np.unique(np.concatenate([marker.nodes for marker in mesh.markers]))
    inner = np.setdiff1d(np.arange(len(mesh.points)), on)
    skin = read_skin(case.mesh_file, None)
    inner = np.setdiff1d(inner, skin.numbering.points)
    assert len(inner)
    points = mesh.points.copy()
    r, angle = np.hypot(*points[:, :2].T), np.arctan2(points[:, 1], points[:, 0])
    far = angle.max() + 0.05
    # Within the box around the mesh, so that it is none of its outermost nodes.
    points[inner[0], :2] = 1.1 * r.min() * np.array([np.cos(far), np.sin(far)])
    assert (points[inner[0]] < mesh.points.max(axis=0)).all()
    assert (points[inner[0]] > mesh.points.min(axis=0)).all()
    sv.write(tmp_path / "odd.su2b", mesh.with_points(points))
    with pytest.raises(MeshError, match=rf"node {inner[0]} at .* is outside the sector"):
        stream(case.change(mesh_file=tmp_path / "odd.su2b"), tmp_path / "out.su2b")


@pytest.mark.parametrize("ending", ["su2", "su2b"])
def test_of_two_that_write_one_file_each_writes_it_whole(tmp_path, ending):
    case = made(tmp_path, "square", 8, ("STEPS=1",))
    out = tmp_path / f"out.{ending}"
    other = stream(case.change(steps=3), out)
    threes = out.read_bytes()
    seen = []

    def meanwhile(_):
        if not seen:
            seen.append(1)
            stream(case.change(steps=3), out)
            assert out.read_bytes() == threes

    assert len(stream(case, out, report=meanwhile).steps) == 1 < len(other.steps)
    assert seen
    once = out.read_bytes()
    stream(case, out)
    assert out.read_bytes() == once != threes
    assert not list(tmp_path.glob(".*"))


def test_a_copy_is_the_same_where_the_system_cannot_copy_by_itself(tmp_path, monkeypatch):
    case = made(tmp_path, "square", 8, ("STEPS=1",))
    stream(case, tmp_path / "one.su2b")
    monkeypatch.setattr(streamed_run, "_PIECE", 100)
    monkeypatch.delattr(os, "copy_file_range")
    stream(case, tmp_path / "two.su2b")
    assert (tmp_path / "one.su2b").read_bytes() == (tmp_path / "two.su2b").read_bytes()
    monkeypatch.setattr(os, "pread", lambda *_: b"")
    with pytest.raises(MeshError, match="became shorter while it was read"):
        stream(case, tmp_path / "two.su2b")
    with pytest.raises(MeshError, match="cannot be written: the folder does not exist"):
        stream(case, tmp_path / "none" / "two.su2b")


# The skin ------------------------------------------------------------------------------------


def test_the_skin_is_the_boundary_and_what_is_at_it(tmp_path):
    mesh = grid((6, 6, 6))
    sv.write(tmp_path / "mesh.su2b", mesh)
    skin = read_skin(tmp_path / "mesh.su2b", None)
    assert skin.marker_names == mesh.marker_names
    assert skin.extent == mesh.extent
    part = skin.numbering
    assert (part.n_points, part.n_cells) == (7**3, 6**3)
    assert np.array_equal(skin.points, mesh.points[part.points])
    inner = ((mesh.points > 0.3) & (mesh.points < 0.7)).all(axis=1)
    assert not inner[part.points].any()
    assert len(part.cells) == 6**3 - 4**3
    assert skin.number(3) == part.points[3]
    assert mesh.number(3) == 3
    nodes = part.points[skin.cells.connectivity].reshape(-1, 8)
    assert np.array_equal(nodes, mesh.cells.connectivity.reshape(-1, 8)[part.cells])


def test_the_extent_is_that_of_the_mesh_even_without_boundaries(tmp_path):
    mesh = replace(grid((4, 4)), markers=grid((4, 4)).markers[:1])
    sv.write(tmp_path / "mesh.su2b", mesh)
    skin = read_skin(tmp_path / "mesh.su2b", None)
    assert skin.extent == mesh.extent
    assert len(skin.points) < len(mesh.points)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (change(WHOLE, 56, "<Q", 1), "byte 48: element 0: node 1 occurs twice in one triangle"),
        (change(WHOLE, 80, "<Q", 1), "byte 48: element 0: its index 1 is not below .* twice"),
        (change(WHOLE, 80, "<Q", 2), "byte 48: element 0: its index 2 is not below the number"),
        (change(WHOLE, 144, "<d", 1e60), "byte 144: point 0 is at .* larger than 1e.50"),
    ],
)
def test_mistakes_are_told_as_by_the_reader(tmp_path, data, message):
    path = tmp_path / "mesh.su2b"
    path.write_bytes(data)
    with pytest.raises(MeshError, match=message):
        read_skin(path, None)


@pytest.mark.parametrize(
    "motions",
    [
        "(x_m, translate, 0.1, 0, 0), (y_m, translate, 0, 0.1, 0)",
        "(x_p, translate, 0.05, 0, 0), (x_p, file, far.txt)",
    ],
)
def test_sentences_have_the_numbers_of_the_file(tmp_path, monkeypatch, motions):
    """Nodes of the skin have others, which nobody knows."""
    monkeypatch.chdir(tmp_path)
    mesh = grid((7, 7, 7))
    sv.write("mesh.su2b", mesh)
    corner = int(np.intersect1d(mesh.marker("x_p").nodes, mesh.marker("y_p").nodes)[3])
    Path("far.txt").write_text(f"{corner} 3 0 0\n999 1 0 0\n")
    moving = "x_m, y_m" if "y_m" in motions else "x_p"
    text = f"MESH_FILENAME= mesh.su2b\nMARKER_MOVING= ({moving})\nMOTION= {motions}\n"
    Path("case.cfg").write_text(text)
    case = sv.Case.read("case.cfg")
    with pytest.raises(CaseError) as one:
        list(sv.deform(case, sv.read("mesh.su2b")))
    with pytest.raises(CaseError) as other:
        stream(case, tmp_path / "out.su2b")
    assert str(one.value) == str(other.value)
    assert "node " in str(one.value)


def test_errors_of_the_method_have_the_numbers_of_the_file(tmp_path, monkeypatch):
    case = made(tmp_path, "square", 25, ("STEPS=1",))
    skin = read_skin(case.mesh_file, None)
    assert skin.number(150) != 150

    def fail(*_):
        raise NodeError("nodes {} and {} are apart by 0.1", 3, 150)

    monkeypatch.setattr(streamed_run, "make_setup", fail)
    with pytest.raises(NodeError, match=f"nodes {skin.number(3)} and {skin.number(150)} are apart"):
        stream(case, tmp_path / "out.su2b")


def test_a_mesh_too_large_for_the_memory_is_streamed_by_itself(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    case = made(tmp_path, "square", 8)
    size = case.mesh_file.stat().st_size
    monkeypatch.setattr(stream_input, "free_memory", lambda: stream_input.NEEDED["su2b"] * size - 1)
    call = ["run", "square.cfg", "--steps", "1"]
    assert run([*call, "-o", "out.su2b"]) == 0
    told = capsys.readouterr().err
    assert "slideviz: note: mesh.su2b needs about 0 GB of memory" in told
    assert "it is streamed" in told
    monkeypatch.setattr(streamed_run, "stream", None)
    for more in (["-o", "out.vtu"], ["-o", "b.su2b", "--steps-dir", "steps"]):
        assert run([*call, *more, "-q"]) == 0
    assert run([*call, "-q", "-o", "c.su2b", "--set", "METHOD=elastic"]) == 3  # done, with folds
    monkeypatch.setattr(stream_input, "free_memory", lambda: stream_input.NEEDED["su2b"] * size)
    assert run([*call, "-q", "-o", "d.su2b"]) == 0
    assert stream_input.missing_memory(sv.Case()) == ""


def test_the_bar_tells_the_phase_and_what_is_left_of_it(tmp_path, monkeypatch):
    from slideviz.cli import progress as module

    drawn, clock = [], iter(range(0, 1000, 10))
    monkeypatch.setattr(module, "control", drawn.append)
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(module.sys.stderr, "isatty", lambda: True, raising=False)
    bar = module.Bar()
    for fraction in (0.0, 0.25, 0.5):
        bar.phase(progress_of("quality", fraction))
    bar.phase(progress_of("write", 0.0))
    texts = [text.rpartition("] ")[2] for text in drawn]
    assert texts == [
        "measuring cells: 0 %",
        "measuring cells: 25 %, about 30 s left",
        "measuring cells: 50 %, about 20 s left",
        "writing the mesh: 0 %",
    ]
    monkeypatch.undo()
    case, told = made(tmp_path, "square", 8, ("STEPS=1",)), []
    stream(case, tmp_path / "out.su2b", report=told.append)
    ends = {now.phase: now.fraction for now in told}
    assert {phase: ends[phase] for phase in ("read", "write", "evaluate", "quality")} == (
        dict.fromkeys(("read", "write", "evaluate", "quality"), 1.0)
    )


def progress_of(phase, fraction):
    return Progress(1, 1, phase, fraction)


@pytest.mark.parametrize("stages", [("read", "solve", "evaluate", "quality"), tuple(SECONDS)])
def test_what_is_left_is_of_all_stages(monkeypatch, stages):
    """On a machine of half the speed, all is known from the first stage on."""
    now, told = 0.0, []
    monkeypatch.setattr(streamed_run, "monotonic", lambda: now)
    one = streamed_run.RemainingTime(told.append, *stages)
    total = 2.0 * sum(SECONDS[stage] for stage in stages)
    for k, stage in enumerate(stages):
        if k:
            one.next()
        begin = now
        for fraction in (0.0, 0.05, 0.5, 1.0):
            now = begin + 2.0 * SECONDS[stage] * fraction
            phase = {"text": "read", "solve": "select"}.get(stage, stage)
            one(progress_of(phase, fraction))
            # That another phase ends does not matter, such as that the copy of the mesh is there.
            one(progress_of("elsewhere", 1.0))
            if now >= 0.2:
                assert told[-2].left == pytest.approx(total - now)
                assert told[-1].left == pytest.approx(total - now)
    assert told[0].left is None


def test_steps_tell_how_long_the_boundary_takes(monkeypatch):
    now, told = 0.0, []
    monkeypatch.setattr(streamed_run, "monotonic", lambda: now)
    one = streamed_run.RemainingTime(told.append, "read", "solve", "quality")
    now = SECONDS["read"]
    one.next()
    now += 7.0
    one(Progress(1, 4, "classify", 0.0))
    now += 10.0
    one(Progress(2, 4, "select", 0.0))
    assert told[-1].left == pytest.approx(30.0 + SECONDS["quality"])


def test_the_bar_tells_what_is_left_of_all(monkeypatch):
    from slideviz.cli import progress as module

    drawn, clock = [], iter(range(0, 1000, 10))
    monkeypatch.setattr(module, "control", drawn.append)
    monkeypatch.setattr(module.time, "monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(module.sys.stderr, "isatty", lambda: True, raising=False)
    bar = module.Bar()
    for phase, fraction, left in (("read", 0.5, 30.0), ("read", 1.0, 10.0), ("quality", 0.1, 40.0)):
        bar.phase(replace(progress_of(phase, fraction), left=left))
    assert [text.rpartition("] ")[2] for text in drawn] == [
        "reading: 50 %, about 30 s left in all",
        "reading: 100 %, about 10 s left in all",
        "measuring cells: 10 %, about 40 s left in all",
    ]
    filled = [text.count("#") for text in drawn]
    assert filled == [0, 12, 12]


@pytest.mark.slow
def test_killing_it_at_random_moments_leaves_no_half_mesh(tmp_path):
    """Also while it copies, reads and measures; what is there at the end has the same bits."""
    random = np.random.default_rng(3)
    case = made(tmp_path, "square", 40)
    case.change(steps=2).write(tmp_path / "square.cfg")
    out, reference = tmp_path / "out.su2b", tmp_path / "reference.su2b"
    stream(sv.Case.read(tmp_path / "square.cfg"), reference)
    call = [sys.executable, "-c", SCRIPT, "30", str(tmp_path / "square.cfg"), "-o", str(out)]
    begin = time.monotonic()
    subprocess.run(call, check=True, cwd=ROOT)
    usual = time.monotonic() - begin
    out.write_bytes(b"older")
    for _ in range(20):
        process = subprocess.Popen(call, cwd=ROOT)
        time.sleep(random.uniform(0.1, 1.1) * usual)
        process.kill()
        process.wait()
        assert out.read_bytes() in (b"older", reference.read_bytes())
        assert not {file.read_bytes()[:4] for file in hidden(out)} & set(MAGIC)
    subprocess.run(call, check=True, cwd=ROOT)
    assert out.read_bytes() == reference.read_bytes()
    assert not list(tmp_path.glob(".*"))
