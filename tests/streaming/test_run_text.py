"""Streamed runs of SU2 text meshes: the bytes of a run in memory; what a stop leaves."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.cli.mesh_source import changed
from slideviz.errors import MeshError
from slideviz.formats import binary_copy
from slideviz.formats.su2 import text as su2_text
from slideviz.formats.su2 import write
from slideviz.samples.table import write_sample
from slideviz.streaming import converting, stream_input
from slideviz.streaming import run as streamed_run
from slideviz.streaming.run import stream
from tests.builders import grid
from tests.streaming.test_run import ROOT, RUNS, StoppedError, stopped_after


def made(folder, name, size, sets=()):
    write_sample(name, folder, size)
    return changed(sv.Case.read(folder / f"{name}.cfg"), sets)


def in_memory(case, path):
    """Deform a mesh in memory, write it, and return the bytes of the file."""
    mesh = sv.read(case.mesh_file, case.zone)
    *_, last = sv.deform(case, mesh)
    sv.write(path, last.mesh)
    return path.read_bytes()


@pytest.fixture
def small(monkeypatch):
    """Pieces, parts and blocks have few rows."""
    monkeypatch.setattr(su2_text, "BLOCK_BYTES", 700)
    monkeypatch.setattr(binary_copy, "PIECES", 3)
    monkeypatch.setattr(streamed_run, "CHUNK", 60)


FEW = [RUNS[k] for k in (1, 6, 7, 8, 14)]
"""What differs from a binary mesh is the file alone: the others are streamed by its tests."""


@pytest.mark.parametrize(
    ("ending", "name", "size", "sets"),
    [
        *(("su2", *row) for row in FEW),
        ("su2b", *RUNS[2]),
        *(
            pytest.param(end, *row, marks=pytest.mark.slow)
            for end in ("su2", "su2b")
            for row in (getattr(run, "values", run) for run in RUNS)
        ),
    ],
)
def test_bytes_are_those_of_a_run_in_memory(tmp_path, monkeypatch, ending, name, size, sets):
    case = made(tmp_path, name, size, sets)
    expected = in_memory(case, tmp_path / f"memory.{ending}")
    for chunk, block in ((37, 700), (1 << 20, 1 << 20)):
        monkeypatch.setattr(streamed_run, "CHUNK", chunk)
        monkeypatch.setattr(su2_text, "BLOCK_BYTES", block)
        stream(case, tmp_path / f"out.{ending}")
        assert (tmp_path / f"out.{ending}").read_bytes() == expected
    assert not list(tmp_path.glob(".*"))


ODD = """\
% a comment
FFD_NBOX= 1
FFD_NLEVEL= 1
FFD_TAG= BOX
FFD_LEVEL= 0
FFD_DEGREE_I= 1
FFD_DEGREE_J= 1
FFD_DEGREE_K= 1
FFD_PARENTS= 0
FFD_CHILDREN= 0
FFD_CORNER_POINTS= 8
-0.1 -0.1 -0.1
1.1 -0.1 -0.1
1.1 1.1 -0.1
-0.1 1.1 -0.1
-0.1 -0.1 1.1
1.1 -0.1 1.1
1.1 1.1 1.1
-0.1 1.1 1.1
FFD_CONTROL_POINTS= 0
FFD_SURFACE_POINTS= 2
x_p {0} 0.9 0.5 0.5
x_p {1} 0.9 0.5 0.5
UNKNOWN= 3
what ever stands here
"""


def odd_mesh(path, kind, zones=1):
    """Write a mesh with boxes, comments, tabs, elements without index and other ways of numbers."""
    mesh = grid((5, 4, 4), kind=kind)
    sv.write(path, mesh)
    text = path.read_text().replace("MARKER_TAG= x_p", "MARKER_TAG=   x_p % out")
    lines = text.replace("MARKER_TAG= y_m", "MarkerTag=y_m").splitlines()
    at = lines.index(f"NPOIN= {len(mesh.points)}")
    for k in range(3, at, 7):
        lines[k] = "\t" + lines[k].rpartition(" ")[0] + " % no index"
    for k in range(at + 2, at + 90, 5):
        words = lines[k].split()
        lines[k] = f" {float(words[0]):+.3e}\t{words[1]}   {float(words[2]):.9f} % {words[3]}"
    corners = mesh.marker("x_p").nodes[[1, 3]].tolist()
    text = "\n".join(lines) + "\n" + ODD.format(*corners)
    if zones > 1:
        text = f"NZONE= {zones}\n" + "".join(f"IZONE= {k + 1}\n{text}" for k in range(zones))
    path.write_text("\ufeff" + text.rstrip("\n"), encoding="utf-8")
    return sv.Case(
        mesh_file=path,
        zone=None if zones == 1 else 2,
        roles={"x_p": "moving", "y_m": "sliding"},
        motions=(sv.Translate("x_p", (0.05, 0.0, 0.0)),),
        sliding="ds",
        steps=2,
    )


@pytest.mark.parametrize("kind", ["mixed", "tetrahedron", "prism"])
@pytest.mark.parametrize("zones", [1, 3])
def test_all_else_of_the_file_stays(tmp_path, small, kind, zones):
    case = odd_mesh(tmp_path / "mesh.su2", kind, zones)
    done = stream(case, tmp_path / "out.su2")
    assert (tmp_path / "out.su2").read_bytes() == in_memory(case, tmp_path / "memory.su2")
    mesh, moved = (sv.read(tmp_path / f"{name}.su2", case.zone) for name in ("mesh", "out"))
    assert np.array_equal(done.quality.values, sv.quality(moved, mesh).values)
    if zones == 1:
        stream(case, tmp_path / "out.su2b")
        assert (tmp_path / "out.su2b").read_bytes() == in_memory(case, tmp_path / "memory.su2b")


@pytest.mark.parametrize("kind", ["mixed", "prism", "turned"])
def test_a_binary_mesh_becomes_the_text_that_memory_gives(tmp_path, monkeypatch, small, kind):
    monkeypatch.setattr(write, "_BLOCK_ROWS", 17)
    monkeypatch.setattr(converting, "NEAR", 5)
    mesh = grid((5, 4, 4), kind="mixed" if kind == "turned" else kind)
    sv.write(tmp_path / "mesh.su2b", mesh)
    if kind == "turned":
        again = sv.read(tmp_path / "mesh.su2b")
        order = np.random.default_rng(2).permutation(len(mesh.cells))
        sv.write(
            tmp_path / "mesh.su2b", replace(again, origin=replace(again.origin, order=order)), True
        )
        assert sv.read(tmp_path / "mesh.su2b").cells.same_as(mesh.cells)
    case = replace(odd_mesh(tmp_path / "odd.su2", "prism"), mesh_file=tmp_path / "mesh.su2b")
    stream(case, tmp_path / "out.su2")
    assert (tmp_path / "out.su2").read_bytes() == in_memory(case, tmp_path / "memory.su2")
    assert not list(tmp_path.glob(".*"))


def test_what_a_text_of_a_binary_mesh_will_not_have_is_told(tmp_path, capsys):
    case = odd_mesh(tmp_path / "odd.su2", "prism", zones=2)
    sv.convert(tmp_path / "odd.su2", tmp_path / "mesh.su2b")
    case.change(mesh_file=tmp_path / "mesh.su2b").write(tmp_path / "case.cfg")
    call = ["run", str(tmp_path / "case.cfg"), "-o", str(tmp_path / "out.su2")]
    told, texts = [], []
    for more in ([], ["--stream"]):
        assert run([*call, *more]) == 0
        told.append([one for one in capsys.readouterr().err.splitlines() if "warning" in one])
        texts.append((tmp_path / "out.su2").read_bytes())
    assert told[0] == told[1]
    assert "other zones of mesh.su2b; write a .su2b file to keep" in told[0][0]
    assert texts[0] == texts[1]
    data = (tmp_path / "mesh.su2b").read_bytes().replace(b"x_m\0", b"x%m\0")
    (tmp_path / "mesh.su2b").write_bytes(data)
    for more in ([], ["--stream"]):
        assert run([*call, *more]) == 1
        assert "'x%m' cannot be written to an SU2 file" in capsys.readouterr().err


def test_what_a_binary_mesh_has_no_place_for_is_told(tmp_path, capsys):
    case = odd_mesh(tmp_path / "mesh.su2", "prism", zones=2)
    case.write(tmp_path / "case.cfg")
    call = ["run", str(tmp_path / "case.cfg"), "-o", str(tmp_path / "out.su2b")]
    told = []
    for more in ([], ["--stream"]):
        assert run([*call, *more]) in (0, 3)
        told.append([one for one in capsys.readouterr().err.splitlines() if "warning" in one])
    assert told[0] == told[1]
    assert "lacks the FFD boxes, the other sections (UNKNOWN) and the" in told[0][0]
    text = (tmp_path / "mesh.su2").read_text().replace("x_m", "x" * 33)
    (tmp_path / "mesh.su2").write_text(text)
    for more in ([], ["--stream"]):
        assert run([*call, *more]) == 1
        assert "x' cannot be written to an SU2 binary file" in capsys.readouterr().err
        assert run([*call[:2], "-q", "-o", str(tmp_path / "out.su2"), *more]) == 0


@pytest.mark.parametrize("others", [False, True])
def test_boxes_move_as_in_memory(tmp_path, small, others):
    case = odd_mesh(tmp_path / "mesh.su2", "mixed")
    motions = (sv.Ffd("x_p", "BOX", (1, 0, 0), (0.03, 0.0, 0.02)),)
    if others:
        motions = (*motions, sv.Translate("x_p", (0.01, 0.0, 0.0)))
    case = case.change(motions=motions)
    done = stream(case, tmp_path / "out.su2")
    assert (tmp_path / "out.su2").read_bytes() == in_memory(case, tmp_path / "memory.su2")
    *_, last = sv.deform(case, sv.read(case.mesh_file))
    assert done.steps[-1].warnings == last.warnings


def test_the_command_writes_the_same_files_and_report(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made(tmp_path, "square", 25)
    call = ["run", "square.cfg", "--steps", "2"]
    texts = []
    for more in ([], ["--stream"]):
        assert run([*call, "-o", "out.su2", "--json", "-", *more]) == 0
        report = json.loads(capsys.readouterr().out)
        assert all(part >= 0 for part in report.pop("seconds").values())
        assert len(report.pop("condition")) == 2  # an estimate, which differs from run to run
        assert bool(report.pop("walls")) == (not more)  # streamed runs do not measure them
        texts.append((report, Path("out.su2").read_bytes(), Path("out_qual.txt").read_bytes()))
    assert texts[0] == texts[1]
    assert run([*call, "-o", "mesh.su2", "--stream"]) == 1
    assert "is the input mesh" in capsys.readouterr().err
    assert run([*call, "-o", "out.txt", "--set", "MESH_OUT_FORMAT=SU2", "--stream", "-q"]) == 0
    assert Path("out.txt").read_bytes() == texts[0][1]
    assert run([*call, "-o", "mesh.su2", "--stream", "--force", "-q"]) == 0
    assert Path("mesh.su2").read_bytes() == texts[0][1]
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("ending", ["su2", "su2b"])
def test_a_run_that_is_stopped_leaves_nothing(tmp_path, monkeypatch, small, ending):
    case = made(tmp_path, "square", 25, ("STEPS=2",))
    out = tmp_path / f"out.{ending}"
    out.write_bytes(b"older")
    parts = -(-len(sv.read(case.mesh_file).points) // 60)

    def stopped(*_, **__):
        raise StoppedError

    for stop in (-1, 0, 3, parts - 1, *([parts] if ending == "su2" else [])):
        with monkeypatch.context() as patch:
            patch.setattr(
                streamed_run, "write_points", stopped_after(streamed_run.write_points, stop)
            )
            if stop == -1:
                patch.setattr(binary_copy, "_write_points", stopped)
            if stop == parts:
                patch.setattr(streamed_run, "patched_text", stopped)
            with pytest.raises(StoppedError):
                stream(case, out)
        assert out.read_bytes() == b"older"
        assert not list(tmp_path.glob(".*"))


def test_an_error_leaves_nothing(tmp_path, monkeypatch, small):
    case = made(tmp_path, "square", 8, ("STEPS=1",))
    out = tmp_path / "out.su2"
    out.write_bytes(b"older")
    for phase in ("read", "evaluate", "quality", "write"):

        def stop(progress, phase=phase):
            if progress.phase == phase and progress.fraction > 0.5:
                raise RuntimeError

        with pytest.raises(RuntimeError):
            stream(case, out, report=stop)
        assert out.read_bytes() == b"older"
        assert not list(tmp_path.glob(".*"))


SCRIPT = """
import sys, time
from pathlib import Path
import slideviz as sv
from slideviz.streaming import run as streamed_run
from slideviz.formats import binary_copy
from slideviz.formats.su2 import text as su2_text
def late(what):
    def slow(*a):
        time.sleep(0.05)
        return what(*a)
    return slow
streamed_run.CHUNK, su2_text.BLOCK_BYTES, binary_copy.PIECES = 60, 2000, 3
streamed_run.write_points = late(streamed_run.write_points)
binary_copy._write_cells = late(binary_copy._write_cells)
from slideviz.formats.su2 import write
write._moved_rows = late(write._moved_rows)
streamed_run.stream(sv.Case.read(sys.argv[1]), Path(sys.argv[2]))
"""


@pytest.mark.slow
def test_killing_it_at_random_moments_leaves_no_half_mesh(tmp_path):
    """While it reads, makes the copy, displaces, measures and writes."""
    random = np.random.default_rng(3)
    case = made(tmp_path, "square", 40)
    case.change(steps=2).write(tmp_path / "square.cfg")
    case = sv.Case.read(tmp_path / "square.cfg")
    out = tmp_path / "out.su2"
    reference = in_memory(case, tmp_path / "memory.su2")
    call = [sys.executable, "-c", SCRIPT, str(tmp_path / "square.cfg"), str(out)]
    begin = time.monotonic()
    subprocess.run(call, check=True, cwd=ROOT)
    usual = time.monotonic() - begin
    assert out.read_bytes() == reference
    out.write_bytes(b"older")
    for _ in range(20):
        process = subprocess.Popen(call, cwd=ROOT)
        time.sleep(random.uniform(0.2, 1.1) * usual)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        assert out.read_bytes() in (b"older", reference)
    subprocess.run(call, check=True, cwd=ROOT)
    assert out.read_bytes() == reference
    assert not list(tmp_path.glob(".*"))  # also none of the killed runs


def with_halo(text):
    """Return a text with a marker of a halo."""
    marks = int(text.partition("NMARK= ")[2].split()[0])
    text = text.replace(f"NMARK= {marks}", f"NMARK= {marks + 1}")
    return text + "MARKER_TAG= SEND_RECEIVE\nMARKER_ELEMS= 1\nSEND_TO= 1\n1 0 0\n"


def test_what_cannot_be_streamed_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    case = made(tmp_path, "square", 8, ("STEPS=1",))
    text = case.mesh_file.read_text()
    out = tmp_path / "out.su2"
    Path("halo.su2").write_text(with_halo(text))
    with pytest.raises(MeshError, match=r"halo.su2:\d+: a mesh with SEND_RECEIVE markers"):
        stream(case.change(mesh_file=tmp_path / "halo.su2"), out)
    first = text.splitlines()[2]
    Path("wrong.su2").write_text(text.replace(first, first.replace("9 0", "9 999999", 1)))
    for words in (["run", "square.cfg", "--set", "MESH_FILENAME=wrong.su2", "-o", "o.su2"],):
        codes = []
        for more in ([], ["--stream"]):
            assert run([*words, *more, "-q"]) == 1
            codes.append(capsys.readouterr().err)
        assert codes[0] == codes[1]
        assert "wrong.su2:3: " in codes[0]
    number = text.split("NPOIN= ")[1].splitlines()[20]
    Path("far.su2").write_text(text.replace(number, "1e60 " + number.partition(" ")[2]))
    with pytest.raises(MeshError, match=r"far.su2: point 19 is at .*1e\+60.* larger than 1e\+50"):
        stream(case.change(mesh_file=tmp_path / "far.su2"), out)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(9, 9, 1000))
    with pytest.raises(MeshError, match=r"MB of disk are needed in .* but 0 MB are free"):
        stream(case, out)
    assert not out.exists()
    assert not list(tmp_path.glob(".*"))


def test_errors_name_the_text(tmp_path, small):
    mesh = grid((4, 4))
    turned = mesh.cells.connectivity.reshape(-1, 4).copy()
    turned[:8] = turned[:8, ::-1]
    cells = sv.Cells.from_types(mesh.cells.types, turned.ravel())
    # That they are not folded only the whole boundary can tell.
    sv.write(tmp_path / "mesh.su2", replace(mesh, cells=cells, markers=mesh.markers[:2]))
    case = sv.Case(
        mesh_file=tmp_path / "mesh.su2",
        roles={"x_p": "moving"},
        motions=(sv.Translate("x_p", (0.1, 0.0)),),
    )
    streamed_run.CHUNK = 8  # the fixture puts it back
    with pytest.raises(MeshError, match=r"mesh.su2: some cells are numbered the other way") as told:
        stream(case, tmp_path / "out.su2")
    assert ".binary" not in str(told.value)


def test_a_mesh_too_large_for_the_memory_is_streamed_by_itself(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    case = made(tmp_path, "square", 8)
    size = case.mesh_file.stat().st_size
    monkeypatch.setattr(stream_input, "free_memory", lambda: stream_input.NEEDED["su2"] * size - 1)
    call = ["run", "square.cfg", "--steps", "1"]
    assert run([*call, "-o", "out.su2"]) == 0
    assert "note: mesh.su2 needs about 0 GB of memory" in capsys.readouterr().err
    monkeypatch.setattr(streamed_run, "stream", None)
    assert run([*call, "-o", "out.vtu", "-q"]) == 0
    halo = with_halo(case.mesh_file.read_text())
    Path("halo.su2").write_text(halo)
    assert run([*call, "-o", "out.su2", "-q", "--set", "MESH_FILENAME=halo.su2"]) == 0
    monkeypatch.setattr(stream_input, "free_memory", lambda: stream_input.NEEDED["su2"] * size)
    assert run([*call, "-o", "out.su2", "-q"]) == 0
