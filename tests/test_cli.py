"""The commands: their JSON, exit codes, files and sentences."""

from __future__ import annotations

import json
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyvista as pv

import slideviz as sv
from slideviz.cli import run
from slideviz.cli.mesh_source import changed
from slideviz.cli.parser import parse
from slideviz.cli.report import CYCLE_KEYS, TRIAL_KEYS
from slideviz.errors import CaseError
from slideviz.rbf.problem import Cycle
from slideviz.samples.table import SAMPLES, write_sample
from slideviz.solver.steps import Trial
from slideviz.system.platform import needs_server
from tests.builders import grid, layered, stage
from tests.processes import wait_until

SECONDS = {
    *("read", "classify", "select", "solve", "evaluate", "project", "quality", "write", "total"),
}


@pytest.fixture
def square(tmp_path: Path) -> Path:
    """A folder with the 25 by 25 square case."""
    write_sample("square", tmp_path / "square")
    return tmp_path / "square"


def test_run_writes_mesh_and_report(square, tmp_path, capsys):
    report_file = tmp_path / "report.json"
    assert run(["run", str(square / "square.cfg"), "--json", str(report_file)]) == 0
    report = json.loads(report_file.read_text())
    assert set(report) >= {
        *("case", "sliding", "periodic", "steps", "quality", "control_nodes", "max_error"),
        *("seconds", "node_counts", "warnings"),
    }
    assert set(report["seconds"]) >= SECONDS
    assert report["sliding"] == "ps"
    assert report["periodic"] == "moving"
    assert report["steps"] == 20
    assert len(report["control_nodes"]) == 20
    assert report["quality"]["min"] == pytest.approx(0.389560, abs=1e-6)
    assert report["quality"]["mean"] == pytest.approx(0.666192, abs=1e-6)
    assert report["quality"]["inverted"] == 0
    assert report["quality"]["cells"] == 620
    assert report["node_counts"] == {
        "moving": 12,
        "fixed": 0,
        "sliding_edge": 52,
        "sliding_surface": 0,
        "internal": 612,
    }
    assert report["max_error"] < 1e-10
    out = capsys.readouterr().out
    assert "minimum quality" in out
    undeformed = sv.quality(sv.read(square / "mesh.su2"))
    assert report["quality"]["undeformed"] == {"min": undeformed.min, "mean": undeformed.mean}
    assert re.search(rf"minimum quality +0.38956 +undeformed {undeformed.min:.6g}\n", out)
    found = sv.quality(
        sv.read(square / "square_deformed.su2"), reference=sv.read(square / "mesh.su2")
    )
    assert found.min == report["quality"]["min"]


def test_a_report_has_every_field_of_trials_and_cycles():
    # A field more: name it there, or here as one that reports leave out.
    for kind, keys in ((Trial, TRIAL_KEYS), (Cycle, CYCLE_KEYS)):
        assert tuple(field.name for field in fields(kind)) == keys


def test_json_dash_prints_only_json(square, capsys):
    assert run(["run", str(square / "square.cfg"), "--json", "-", "--set", "STEPS=2"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 2


def test_set_changes_keys_and_output_is_chosen(square, tmp_path):
    out = tmp_path / "x.vtu"
    argv = ["run", str(square / "square.cfg"), "-o", str(out), "-q"]
    assert run([*argv, "--set", "SLIDING_MODE=ds", "--set", "STEPS= 3"]) == 0
    import meshio

    written = meshio.read(out)
    values = written.get_cell_data("size-skew", "quad")
    base, deformed = sv.read(square / "mesh.su2"), sv.read(out)
    assert np.array_equal(values, sv.quality(deformed, reference=base).values)


def test_inverted_cells_give_code_3_and_are_named(square, capsys):
    argv = ["run", str(square / "square.cfg"), "--set", "STEPS=1", "--set", "SLIDING_MODE=none"]
    assert run([*argv, "--set", "PERIODIC_MODE=none"]) == 3
    err = capsys.readouterr().err
    assert "cells are inverted" in err
    assert "the motion is safe up to " in err
    assert "quadrilateral" in err
    assert "STEPS" in err
    assert (square / "square_deformed.su2").exists()


def test_steps_dir_has_every_step(square, tmp_path):
    folder = tmp_path / "steps"
    argv = ["run", str(square / "square.cfg"), "--set", "STEPS=3", "--steps-dir", str(folder)]
    assert run([*argv, "-q"]) == 0
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["mesh_1.su2", "mesh_2.su2", "mesh_3.su2"]
    last = sv.read(folder / "mesh_3.su2")
    assert np.array_equal(last.points, sv.read(square / "square_deformed.su2").points)


def test_quiet_prints_nothing(square, capsys):
    assert run(["run", str(square / "square.cfg"), "-q", "--set", "STEPS=1"]) in (0, 3)
    assert capsys.readouterr().out == ""


def test_input_mesh_is_not_overwritten(square, capsys):
    before = (square / "mesh.su2").read_bytes()
    argv = ["run", str(square / "square.cfg"), "-o", str(square / "mesh.su2")]
    assert run(argv) == 1
    assert "is the input mesh" in capsys.readouterr().err
    assert (square / "mesh.su2").read_bytes() == before
    assert run([*argv, "--force", "-q"]) == 0
    assert (square / "mesh.su2").read_bytes() != before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-o", "none/a.su2"], "none/a.su2: cannot be written: the folder does not exist"),
        (["-o", "a.xyz"], "a.xyz: no mesh format has the ending .xyz"),
        (["--json", "none/a.json"], "none/a.json: cannot be written"),
        (["--json", "mesh.su2/a.json"], "a part of the path is a file, not a folder"),
        (["--history", "."], "cannot be written: it is a folder; give the name of a file"),
        (["--picture", "none/a.png"], "none/a.png: cannot be written"),
        (["--picture", "a.jpg"], "a.jpg: pictures are PNG"),
        (["--picture", "a.png", "--picture-size", "0x0"], "0x0 pixels cannot be drawn"),
        (["--picture", "a.png", "--zoom", "9,9,0.1"], "misses the mesh, which has x from 0 to 1"),
        (["--picture", "a.png", "--zoom", "0,0,0,1"], "is not a place in a 2D mesh"),
        (["--steps-dir", "mesh.su2/a"], "mesh.su2/a: cannot create this folder: a part of"),
        (["--steps-dir", "mesh.su2"], "mesh.su2: cannot create this folder: it is a file"),
        (["--steps", "0"], "STEPS=0: 0 is too small; expected a whole number from 1"),
        (["--zone", "0"], "there is no zone 0"),
    ],
)
def test_what_cannot_be_written_is_told_before_the_work(
    square, monkeypatch, capsys, words, message
):
    def never(*_):
        raise AssertionError("too late")

    monkeypatch.chdir(square)
    monkeypatch.setattr("slideviz.cli.run_command.run_steps", never)
    before = sorted(square.iterdir())
    assert run(["run", "square.cfg", *words]) == 1
    err = capsys.readouterr().err
    assert message in err
    assert err.count("\n") == 1
    assert sorted(square.iterdir()) == before


@pytest.mark.parametrize(
    "words",
    [
        ["info", "mesh.su2", "--json", "none/a"],
        ["quality", "mesh.su2", "--json", "none/a"],
        ["quality", "mesh.su2", "-o", "none/a.vtu"],
        ["quality", "mesh.su2", "-o", "none/a.csv"],
        ["section", "mesh.su2", "--plane", "y=0.5", "-o", "none/a.png"],
        ["section", "mesh.su2", "--plane", "y=0.5", "-o", "a.png", "--json", "none/a"],
        ["film", "square.cfg", "-o", "none/a.gif"],
    ],
)
def test_a_folder_that_is_missing_is_told_before_the_mesh_is_read(
    square, monkeypatch, capsys, words
):
    def never(*_, **__):
        raise AssertionError("too late")

    monkeypatch.chdir(square)
    for module in ("mesh_source", "repair_command"):
        monkeypatch.setattr(f"slideviz.cli.{module}.read", never)
    assert run(words) == 1
    assert "the folder" in (err := capsys.readouterr().err)
    assert "does not exist" in err
    assert not (square / "a.png").exists()


def test_the_summary_says_that_nothing_slides_where_all_is_fixed(square, capsys):
    case = square / "square.cfg"
    lines = [line for line in case.read_text().splitlines() if "MARKER_SLIDING" not in line]
    lines = [line for line in lines if "PERIODIC" not in line]
    assert any(line.startswith("SLIDING_MODE= ps") for line in lines)
    case.write_text("\n".join([*lines, "PERIODIC_MODE= none"]))
    run(["run", str(case), "-o", str(square / "a.su2"), "--steps", "1"])
    assert ": 1 step, sliding none, periodic none" in capsys.readouterr().out


def test_one_step_is_one_step(square, capsys):
    argv = ["run", str(square / "square.cfg"), "-o", str(square / "a.su2"), "--steps"]
    run([*argv, "1"])
    assert ": 1 step, sliding" in capsys.readouterr().out
    run([*argv, "2"])
    assert ": 2 steps, sliding" in capsys.readouterr().out


def test_wrong_usage_is_one_sentence(square, capsys):
    assert run(["run", str(square / "square.cfg"), "--zoom", "nan,0,1"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("slideviz run: argument --zoom: 'nan,0,1' is neither X,Y,WIDTH")
    assert err.endswith("see `slideviz run --help`\n")
    assert err.count("\n") == 1


def test_run_writes_the_quality_of_each_cell(square, tmp_path):
    assert run(["run", str(square / "square.cfg"), "-q"]) == 0
    found = sv.quality(sv.read(square / "square_deformed.su2"), sv.read(square / "mesh.su2"))
    text = (square / "square_deformed_qual.txt").read_text()
    assert text.endswith("\n")
    assert [float(line) for line in text.splitlines()] == found.values.tolist()


def test_info_tells_what_is_there(square, capsys):
    assert run(["info", str(square / "mesh.su2"), "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["dimension"] == 2
    assert report["cells_by_type"] == {"quadrilateral": 620}
    assert [m["name"] for m in report["markers"]] == ["LEFT", "RIGHT", "LOWER", "UPPER", "BLOCK"]
    assert ["LOWER", "UPPER"] in [pair["markers"] for pair in report["periodic_pairs"]]
    assert report["quality"]["min"] == pytest.approx(1.0)
    assert run(["info", str(square / "mesh.su2")]) == 0
    assert "quadrilateral" in capsys.readouterr().out


def test_quality_against_reference(square, tmp_path, capsys):
    assert run(["run", str(square / "square.cfg"), "-q"]) == 0
    deformed, table = square / "square_deformed.su2", tmp_path / "q.csv"
    argv = ["quality", str(deformed), "--reference", str(square / "mesh.su2")]
    assert run([*argv, "--json", "-", "-o", str(table)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["min"] == pytest.approx(0.389560, abs=1e-6)
    assert sum(report["histogram"]["counts"]) == 620
    assert report["worst"][0]["quality"] == report["min"]
    rows = table.read_text().splitlines()
    assert rows[0] == "cell,size_skew,size,skew,status"
    assert min(float(row.split(",")[1]) for row in rows[1:]) == report["min"]
    assert run(argv) == 0
    assert "worst cells" in capsys.readouterr().out


def test_metrics_are_printed_reported_and_written_where_they_are_asked_for(tmp_path, capsys):
    base = grid((3, 3))
    points = base.points.copy()
    points[5] += (0.1, 0.05)
    sv.write(tmp_path / "bent.su2", replace(base, points=points))
    call = ["quality", str(tmp_path / "bent.su2"), "--metrics"]
    found = sv.metrics(sv.read(tmp_path / "bent.su2"))
    assert (
        run([*call, "all", "--json", str(tmp_path / "q.json"), "-o", str(tmp_path / "q.csv")]) == 0
    )
    printed = capsys.readouterr().out
    report = json.loads((tmp_path / "q.json").read_text())["metrics"]
    table = np.genfromtxt(tmp_path / "q.csv", delimiter=",", names=True)
    for name, values in found.items():
        field = name.replace("-", "_")
        assert report[field] == values.summary()
        assert values.values[report[field]["worst_at"]] == values.worst
        assert re.search(rf"^  {field} .*{values.max:.6g} ", printed, re.MULTILINE)
        assert np.array_equal(table[field], values.of_cells)
    assert run([*call, "warpage"]) == 2
    assert "'warpage' is not one of all | size_skew" in capsys.readouterr().err
    assert run([*call, "skewness,growth,size", "--stream"]) == 1
    error = capsys.readouterr().err
    assert "--metrics skewness,growth needs the mesh in memory" in error
    alone = re.search(r"use --metrics (\S+), or", error)[1]
    assert run([*call, alone, "--stream", "--json", str(tmp_path / "s.json")]) == 0
    streamed = json.loads((tmp_path / "s.json").read_text())["metrics"]
    assert streamed == {name: report[name] for name in alone.split(",")}
    assert set(streamed) >= {"size", "skew", "scaled_jacobian", "aspect_ratio"}


@pytest.fixture
def channel(tmp_path: Path) -> tuple[sv.Mesh, sv.Case]:
    """A channel with layers at its lower wall, which moves, and its case; both are in files."""
    mesh = layered(8, 0.001)
    case = sv.Case(roles={"y_m": "moving", "x_m": "internal", "x_p": "sliding"}, sliding="ps")
    case = case.change(motions=(sv.Translate("y_m", (0, 1e-4)),), mesh_file=tmp_path / "mesh.su2")
    sv.write(tmp_path / "mesh.su2", mesh)
    case.write(tmp_path / "case.cfg")
    return mesh, case


@pytest.mark.parametrize("ending", [".vtu", ".vtkhdf"])
def test_metrics_and_walls_are_in_files_for_paraview(channel, tmp_path, ending):
    base, case = channel
    out = tmp_path / f"out{ending}"
    words = ["--metrics", "ALL", "-q", "--json", str(tmp_path / "report.json")]
    assert run(["run", str(tmp_path / "case.cfg"), "-o", str(out), *words]) == 0
    assert run(["run", str(tmp_path / "case.cfg"), "-o", str(tmp_path / "moved.su2"), "-q"]) == 0
    moved = sv.read(tmp_path / "moved.su2")
    layers = sv.walls(moved, base, case.walls(base.marker_names)).with_layers()
    count = len(moved.cells)  # a VTU file has those of boundaries, too

    def check(path, reference, names):
        if ending == ".vtu":
            grid = pv.read(path)
            of_cells, of_points = (dict(part) for part in (grid.cell_data, grid.point_data))
        else:
            with h5py.File(path) as file:
                parts = (file[f"VTKHDF/volume/{kind}Data"] for kind in ("Cell", "Point"))
                of_cells, of_points = ({k: v[:] for k, v in part.items()} for part in parts)
        for name, one in sv.metrics(moved, reference=reference).items():
            if name in ("size-skew", "size", "skew"):
                continue
            field = name.replace("-", "_")
            np.testing.assert_allclose(of_cells[field][:count], one.of_cells, rtol=1e-9)
            if one.term.where == "nodes":
                np.testing.assert_allclose(of_points[field], one.values, rtol=1e-9)
        for name in names:
            np.testing.assert_allclose(of_cells[name][:count], layers.at_cells(name), rtol=1e-9)
        return of_cells

    check(out, base, layers.values)
    rated = tmp_path / f"rated{ending}"
    words = ["--metrics", "all", "--case", str(tmp_path / "case.cfg")]
    shutil.move(tmp_path / "mesh.su2", tmp_path / "away.su2")
    assert run(["quality", str(tmp_path / "moved.su2"), *words, "-o", str(rated)]) == 0
    alone = check(rated, None, ("first_height", "growth", "equal_layers", "wall_angle"))
    assert "height_ratio" not in alone


def test_a_run_says_that_file_and_motions_move_a_boundary_one_after_the_other(
    channel, tmp_path, capsys
):
    mesh, _ = channel
    nodes = mesh.marker("y_m").nodes
    (tmp_path / "moved.txt").write_text("".join(f"{node} 0 1e-4\n" for node in nodes))
    call = ["run", f"{tmp_path}/case.cfg", "-o", str(tmp_path / "out.su2")]
    file = f"DEFORMATION_FILENAME={tmp_path / 'moved.txt'}"
    assert run([*call, "--set", file, "--json", str(tmp_path / "report.json")]) == 0
    note = (
        "moved.txt moves y_m first (DEFORMATION_FILENAME), and then MOTION does so: y_m: translate "
        "by (0, 0.0001); DEFORMATION_FILENAME= NONE leaves the file out"
    )
    assert f"slideviz: note: {note}\n" in capsys.readouterr().err
    assert note in json.loads((tmp_path / "report.json").read_text())["warnings"]
    both = sv.read(tmp_path / "out.su2").points[nodes] - mesh.points[nodes]
    np.testing.assert_allclose(both[:, 1], 2e-4)
    for one in (file, "MOTION=NONE"), ("DEFORMATION_FILENAME=NONE", "STEPS=1"):
        assert run([*call, "--set", one[0], "--set", one[1]]) == 0
        assert "moves y_m first" not in capsys.readouterr().err


def test_numbers_of_walls_are_printed_as_metrics(channel, square, tmp_path, capsys):
    names = ["--metrics", "growth,height_ratio"]
    out = tmp_path / "out.su2"
    assert run(["run", f"{tmp_path}/case.cfg", "-o", str(out), *names]) == 0
    printed = capsys.readouterr().out
    values = sv.walls(sv.read(out), channel[0]).summary()["y_m"]
    growth, ratio = values["growth"], values["first_height"]["ratio"]
    for label, one in (
        ("growth at y_m", growth["after"]),
        ("  undeformed", growth["before"]),
        ("height_ratio at y_m", ratio),
    ):
        numbers = " +".join(f"{one[end]:.6g}" for end in ("min", "mean", "max"))
        assert re.search(rf"^  {label} +{numbers}$", printed, re.MULTILINE)
    assert run(["quality", str(square / "mesh.su2"), "--metrics", "growth"]) == 0
    assert "metrics:\n  growth: no boundary layers at LEFT, RIGHT, " in capsys.readouterr().out
    assert run(["quality", str(out), *names]) == 1
    assert "height-ratio compares with the undeformed mesh; give a ref" in capsys.readouterr().err


def test_a_run_reports_metrics_before_and_after(square, tmp_path, capsys):
    call = ["run", str(square / "square.cfg"), "--metrics", "skewness"]
    assert run([*call, "--json", str(tmp_path / "r.json")]) == 0
    report = json.loads((tmp_path / "r.json").read_text())["metrics"]
    before, after = report["before"]["skewness"], report["after"]["skewness"]
    assert before["max"] < after["max"]
    assert re.search(r"skewness .*\n    undeformed", capsys.readouterr().out)


def test_quality_says_what_it_is_measured_against(square, capsys):
    assert run(["run", str(square / "square.cfg"), "-q"]) == 0
    argv = ["quality", str(square / "square_deformed.su2")]
    assert run(argv) == 0
    assert (
        "no reference: relative to itself; give --reference UNDEFORMED" in capsys.readouterr().out
    )
    assert run([*argv, "--reference", str(square / "mesh.su2")]) == 0
    asked = capsys.readouterr().out
    assert f"reference: {square / 'mesh.su2'}" in asked
    assert run([*argv, "--case", str(square / "square.cfg")]) == 0
    assert capsys.readouterr().out == asked


def test_sample_lists_and_refuses_unknown(capsys, tmp_path):
    assert run(["sample"]) == 0
    assert "cylindrical" in capsys.readouterr().out
    assert run(["sample", "sqare", "-o", str(tmp_path)]) == 1
    assert "square" in capsys.readouterr().err


def test_keys_lists_every_key(capsys):
    assert run(["keys"]) == 0
    text = capsys.readouterr().out
    for key in ("MESH_FILENAME", "SLIDING_MODE", "MARKER_PERIODIC", "MOTION", "FEATURE_ANGLE"):
        assert key in text


@pytest.mark.parametrize(
    ("argv", "code"),
    [
        (["run"], 2),
        (["run", "a.cfg", "--nonsense"], 2),
        (["--nonsense"], 2),
        (["quality", "a.su2", "--metric", "other"], 2),
        (["run", "missing.cfg"], 1),
        (["info", "missing.su2"], 1),
        (["missing.su2"], 1),
        (["--help"], 0),
        (["run", "--help"], 0),
        (["--version"], 0),
    ],
)
def test_exit_codes(argv, code, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(argv) == code
    out = capsys.readouterr()
    assert (out.out or out.err).strip()
    assert "Traceback" not in out.err


def test_set_must_be_an_assignment(square, capsys):
    assert run(["run", str(square / "square.cfg"), "--set", "STEPS"]) == 1
    assert "KEY=VALUE" in capsys.readouterr().err


def test_case_without_mesh_is_told(tmp_path, capsys):
    (tmp_path / "a.cfg").write_text("STEPS= 2\n")
    assert run(["run", str(tmp_path / "a.cfg")]) == 1
    assert "MESH_FILENAME" in capsys.readouterr().err


def test_an_unforeseen_error_is_one_message(square, monkeypatch, capsys):
    def broken(*_, **__):
        raise ZeroDivisionError("boom")

    monkeypatch.setattr("slideviz.cli.run_command.quality", broken)
    assert run(["run", str(square / "square.cfg")]) == 1
    err = capsys.readouterr().err
    assert "internal error (ZeroDivisionError: boom)" in err
    assert "Traceback" not in err


@pytest.mark.parametrize("package", ["pyvista", "matplotlib"])
def test_a_package_that_is_missing_is_named_before_anything_is_computed(
    square, tmp_path, monkeypatch, capsys, package
):
    monkeypatch.setitem(sys.modules, package, None)
    case = square / "square.cfg"
    assert run(["compare", str(case), "-o", str(tmp_path / "compared")]) == 1
    needed = f"this needs {package}, which is not installed; use `pip install {package}"
    assert needed in capsys.readouterr().err
    assert not (tmp_path / "compared").exists()


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_too_large_for_memory_ends_with_the_remedy(name, tmp_path, capsys):
    for size in ("1e12", "1e17"):
        assert run(["sample", name, "--size", size, "-o", str(tmp_path)]) == 1
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "internal error" not in said
        assert "size" in said or "use 5000 or 20000" in said
        assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    "option", [("-o", "/proc/s.su2"), ("--steps-dir", "/proc/s"), ("--steps-dir", "/proc/s/t")]
)
def test_where_no_folder_can_be_made_none_is_asked_for(square, capsys, option, tmp_path):
    output = ["-o", str(tmp_path / "o.su2")] if option[0] != "-o" else []
    assert run(["run", str(square / "square.cfg"), *output, *option]) == 1
    assert capsys.readouterr().err.endswith("nothing can be made there; choose another folder\n")


def test_a_configuration_and_a_case_file_are_told_apart(square, capsys):
    path = str(square / "square.cfg")
    for command in ("def", "dot"):
        assert run([command, path]) == 1
        told = f"{path}: is a case file, not a configuration of SU2; use `slideviz run {path}`"
        assert capsys.readouterr().err == f"slideviz: {told}\n"


def test_out_of_memory_is_one_sentence(square, monkeypatch, capsys):
    def broken(*_, **__):
        raise MemoryError

    monkeypatch.setattr("slideviz.cli.run_command.deform", broken)
    assert run(["run", str(square / "square.cfg")]) == 1
    assert "out of memory" in capsys.readouterr().err


def test_a_pipe_that_closes_is_no_error(square):
    call = (
        f"{sys.executable} -m slideviz info {square / 'mesh.su2'} | true; echo ${{PIPESTATUS[0]}}"
    )
    done = subprocess.run(["bash", "-c", call], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "0"
    assert "Traceback" not in done.stderr


def test_interrupt_leaves_nothing_half_written(square, tmp_path):
    made = tmp_path / "steps"
    argv = [sys.executable, "-m", "slideviz", "run", str(square / "square.cfg")]
    child = subprocess.Popen(
        [*argv, "--set", "STEPS=9999", "--steps-dir", str(made)],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    wait_until(lambda: made.is_dir() and any(made.iterdir()))
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=60)
    assert child.returncode == 130
    assert "cancelled" in err
    assert "Traceback" not in err
    assert sorted(path.name for path in square.iterdir()) == [
        "displacement.txt",
        "mesh.su2",
        "square.cfg",
    ]


def test_version_loads_nothing_heavy():
    code = (
        "import sys; sys.argv=['slideviz','--version']\n"
        "from slideviz.__main__ import main; main()\n"
        "heavy={'numpy','scipy','numba','pyvista','vtk','matplotlib','qtpy','meshio'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == f"slideviz {sv.__version__}\n"


def test_public_names_are_what_they_say():
    for name in sv.__all__:
        assert getattr(sv, name) is not None
    assert callable(sv.deform)
    assert callable(sv.quality)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        sv.nonsense  # noqa: B018


def test_readme_python_example(square, monkeypatch):
    """The example of the Python interface, as the README has it."""
    monkeypatch.chdir(square)
    mesh, case = sv.read("mesh.su2"), sv.Case.read("square.cfg")
    *_, last = sv.deform(case, mesh)
    found = sv.quality(last.mesh, reference=mesh)
    sv.write("out.su2", last.mesh)
    assert found.inverted == 0
    assert np.array_equal(sv.read("out.su2").points, last.mesh.points)


@pytest.mark.parametrize(("quiet", "times"), [(False, 1), (True, 0)])
def test_compiling_is_told_once_when_it_happens(quiet, times, capsys, monkeypatch):
    numba = pytest.importorskip("numba")

    def command(arguments):
        for _ in range(2):  # two loops are compiled, and one line is enough
            numba.njit(lambda x: x + 1)(1)
        return 0

    arguments = parse(["keys"])
    arguments.command = command
    arguments.quiet = quiet
    monkeypatch.setattr("slideviz.cli.parse", lambda argv: arguments)
    assert run([]) == 0
    told = capsys.readouterr()
    assert told.err.count("compiling") == times
    assert told.out == ""


def test_nothing_is_said_where_all_is_compiled(square, capsys):
    argv = ["run", str(square / "square.cfg"), "--set", "STEPS=2"]
    assert run(argv) == 0
    capsys.readouterr()
    assert run(argv) == 0
    assert "compiling" not in capsys.readouterr().err


def test_what_is_harmless_is_a_note_and_no_warning(square, capsys):
    argv = ["run", str(square / "square.cfg"), "--set", "CURVED=YES", "--set", "SLIDING_MODE=none"]
    for quiet in ([], ["-q"]):
        run([*argv, "--set", "PERIODIC_MODE=fixed", *quiet])
        told = capsys.readouterr().err
        assert ("slideviz: note: CURVED= YES has no effect" in told) == (not quiet)
        assert "slideviz: warning: SLIDING_MODE= none: " in told


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("MARKER_MOVING", "( BLOK )", ": MARKER_MOVING: mesh.su2 has no marker 'BLOK'; did you"),
        ("MARKER_PERIODIC", "( LOWER )", ": MARKER_PERIODIC has an odd number of markers"),
        ("SUPPORT_RADIUS", "1e30", ": SUPPORT_RADIUS: 1e+30 does not fit mesh.su2"),
        ("MOTION", "(BLOCK, translate, 1, 2, 3)", ": motion 2: the shift has 3 components"),
        ("LIMITS", "growth@BLOK < 2", ": LIMITS: mesh.su2 has no marker 'BLOK'"),
    ],
)
def test_what_does_not_fit_the_mesh_has_its_line_in_the_case(square, capsys, key, value, said):
    path = square / "square.cfg"
    entries = dict(line.split("= ") for line in path.read_text().splitlines() if "= " in line)
    lines = [f"{name}= {old}" for name, old in (entries | {key: value}).items()]
    path.write_text("\n".join(lines))
    assert run(["run", str(path)]) == 1
    line = next(at for at, text in enumerate(lines, 1) if text.startswith(f"{key}="))
    assert f"{path}:{line}{said}" in capsys.readouterr().err
    path.write_text("\n".join(text for text in lines if not text.startswith(f"{key}=")))
    assert run(["run", str(path), "--set", f"{key}={value}"]) == 1
    assert f"{path}{said}" in capsys.readouterr().err


def test_a_missing_list_is_called_missing(square, capsys):
    path = square / "square.cfg"
    lines = [*path.read_text().splitlines(), "MOTION= (BLOCK, translate, 0.1, 0)"]
    path.write_text("\n".join(line for line in lines if not line.startswith("MARKER_MOVING")))
    assert run(["run", str(path)]) == 1
    said = f"{path}: no marker moves: MARKER_MOVING is missing; write MARKER_MOVING= (BLOCK)"
    assert capsys.readouterr().err.strip() == f"slideviz: {said}"


def test_roles_that_the_method_does_not_use_are_told(square, capsys):
    argv = ["run", str(square / "square.cfg"), "--set", "STEPS=3", "--set", "SLIDING_MODE=none"]
    run([*argv, "--set", "PERIODIC_MODE=none", "--json", "-"])
    out = capsys.readouterr()
    assert "LOWER and UPPER will not stay periodic" in out.err
    assert "LEFT, RIGHT will not slide" in out.err
    assert len(json.loads(out.out)["warnings"]) == 2


@pytest.mark.skipif(not needs_server(), reason="there always is a screen")
def test_without_a_screen_the_window_says_so(square, capsys, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert run([str(square / "square.cfg")]) == 1
    err = capsys.readouterr().err
    assert "there is no screen" in err
    assert "slideviz run CASE" in err


def test_meshes_are_shown_in_a_line(square):
    mesh = sv.read(square / "mesh.su2")
    text = repr(mesh)
    assert "2D, 676 points, Cells(620 quadrilateral), markers: LEFT, RIGHT" in text
    assert len(text) < 300


def test_the_number_of_steps_has_an_option_and_no_option_is_cut_short(tmp_path, capsys):
    write_sample("square", tmp_path, size=8)
    case, out = str(tmp_path / "square.cfg"), tmp_path / "o.su2"
    report = tmp_path / "r.json"
    given = ["--steps", "3", "-q", "-o", str(out), "--json", str(report)]
    assert run(["run", case, *given]) == 0
    assert json.loads(report.read_text())["steps"] == 3
    assert run(["run", case, "--steps", "text"]) == 1
    assert "'text' is not a whole number from 1 to 9999, or auto" in capsys.readouterr().err
    assert run(["run", case, "--step", "3"]) == 2


def test_a_case_is_told_from_a_mesh(tmp_path, capsys):
    write_sample("square", tmp_path, size=8)
    assert run(["info", str(tmp_path / "square.cfg")]) == 1
    assert "is a case file, not a mesh; name the mesh itself" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said", "code"),
    [
        (["rn", "x"], "there is no command or file 'rn'; did you mean run?", 2),
        (["rn"], "no such file or command (commands: run, ", 1),
        (["run", "a.cfg", "--stepz", "3"], "arguments: --stepz 3; did you mean --steps?", 2),
        (
            ["info", "a", "--jsn=b"],
            "arguments: --jsn=b; did you mean --json?; see `slideviz info",
            2,
        ),
        (["section", "a", "--cylinder", "r=0,275"], "write a decimal point, e.g. 0.275", 2),
        (["section", "a", "--cylinder", "0,275,x,0,0,0"], "a decimal point, e.g. 0.275", 2),
        (["section", "a", "--plane", "z=0,5"], "'z=0,5': a comma separates numbers", 2),
    ],
)
def test_what_is_misspelt_is_named_with_what_is_meant(words, said, code, capsys):
    assert run(words) == code
    assert said in capsys.readouterr().err


def test_a_file_without_any_key_is_told_in_one_line(tmp_path, capsys):
    path = tmp_path / "m.vtu"
    path.write_text('<?xml version="1.0"?>\n' + "<a>\n" * 50)
    assert run(["run", str(path)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        "m.vtu: is not a case file, for it has no line with a key of slideviz (line 1: '<?x" in line
    )


def test_all_wrong_values_are_told_at_once(square, capsys):
    sets = ["A=1", "STEPS=x", "STEPS", "SLIDING_MODE=zz", "FEATURE_ANGLE=30"]
    words = [word for text in sets for word in ("--set", text)]
    assert run(["run", str(square / "square.cfg"), *words]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[1 + (k == 0)] for k, line in enumerate(lines)] == [
        *("A=1:", "STEPS=x:", "'STEPS'", "SLIDING_MODE=zz:")
    ]


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("BLOCK", "takes BLOCK from MARKER_MOVING, and no other marker moves"),
        ("LOWER", "takes LOWER from MARKER_PERIODIC, which has UPPER left"),
    ],
)
def test_a_list_of_markers_is_blamed_for_what_it_takes(square, names, said, capsys):
    case = sv.Case.read(square / "square.cfg")
    lower, upper = case.markers_with("periodic")
    names, said = (text.replace("LOWER", lower).replace("UPPER", upper) for text in (names, said))
    names = names.replace("BLOCK", case.markers_with("moving")[0])
    said = said.replace("BLOCK", case.markers_with("moving")[0])
    option = f"MARKER_SLIDING=({names})"
    assert run(["run", str(square / "square.cfg"), "--set", option]) == 1
    assert capsys.readouterr().err.startswith(f"slideviz: --set {option} {said}")
    # Another option that gives it back makes it right.
    back = f"{'MARKER_PERIODIC' if upper in said else 'MARKER_MOVING'}=({names})"
    back = back.replace(lower, f"{lower}, {upper}") if upper in said else back
    words = ["run", str(square / "square.cfg"), "--set", option, "--set", back]
    assert run([*words, "--steps", "1", "-q", "-o", str(square / "out.su2")]) in (0, 3)


def test_a_refusal_comes_alone(square, capsys):
    case, out = str(square / "square.cfg"), str(square / "out.su2")
    (square / "out_qual.txt").write_text("old")
    assert run(["run", case, "-o", out, "--set", "SLIDING_MODE=none"]) == 1
    assert "replaced" not in capsys.readouterr().err
    assert run(["run", case, "-o", out, "--steps", "1"]) in (0, 3)
    assert "note: there already, and replaced by this run: " in capsys.readouterr().err


def test_a_list_of_markers_that_takes_what_a_motion_names_is_blamed():
    case = sv.Case(
        roles=dict.fromkeys("ab", "moving"),
        motions=(sv.Translate("a", (1.0, 0.0)), sv.Translate("b", (1.0, 0.0))),
    )
    with pytest.raises(
        CaseError, match=r"--set MARKER_FIXED=\(a\) takes a from MARKER_MOVING, but MO"
    ):
        changed(case, ["MARKER_FIXED=(a)"])
    moved = changed(case, ["MARKER_FIXED=(a)", "MOTION=(b, translate, 1, 0)"])
    assert moved.roles == {"a": "fixed", "b": "moving"}


def test_a_limit_that_is_not_met_gives_code_4_and_its_cells(square, tmp_path, capsys):
    report = tmp_path / "report.json"
    limits = "LIMITS=( min > 0.39, inverted = 0 )"
    call = ["run", str(square / "square.cfg"), "-q", "--set", limits, "-o", str(tmp_path / "o.su2")]
    for streamed in ([], ["--stream"]):
        assert run([*call, "--json", str(report), *streamed]) == 4
        low, folded = json.loads(report.read_text())["limits"]
        assert low["limit"] == "min > 0.39"
        assert (low["name"], low["op"], low["value"]) == ("min", ">", 0.39)
        assert low["actual"] == pytest.approx(0.389560, abs=1e-6)
        assert low["undeformed"] == pytest.approx(1.0)
        assert (low["passed"], low["failing"], low["cells"]) == (False, 1, [505])
        assert (folded["passed"], folded["actual"], folded["cells"]) == (True, 0, [])
        err = capsys.readouterr().err
        assert "the limit min > 0.39 is not met, in 1 cell (505): 0.38956, undeformed 1\n" in err
        relax = "" if streamed else "RELAX= YES; "
        assert f"what may help: {relax}more STEPS" in err
    assert run([*call[:4], "LIMITS=( min > 0.38 )", *call[5:]]) == 0
    limited = ["--set", "LIMITS=( size > 0.1 )", "--stream"]
    assert run([*call[:3], *limited, "-o", str(tmp_path / "o.su2")]) == 1
    assert "needs the mesh in memory" in capsys.readouterr().err


def test_inverted_cells_come_before_limits(square, tmp_path, capsys):
    words = ["--set", "STEPS=1", "--set", "SLIDING_MODE=none", "--set", "PERIODIC_MODE=none"]
    words += ["--set", "LIMITS=( min > 0.1, inverted < 1000 )", "-o", str(tmp_path / "o.su2")]
    assert run(["run", str(square / "square.cfg"), "-q", *words]) == 3
    err = capsys.readouterr().err
    assert "the limit min > 0.1 is not met" in err
    assert "inverted < 1000" not in err
    assert err.count("what may help") == 1


def test_quality_checks_limits(square, tmp_path, capsys):
    mesh = str(square / "mesh.su2")
    assert run(["quality", mesh, "--limits", "min > 0.9, skew > 0.9"]) == 0
    assert "skew > 0.9  1  met" in capsys.readouterr().out
    assert run(["quality", mesh, "--limits", "largest_angle < 61", "--json", "-"]) == 4
    (entry,) = json.loads(capsys.readouterr().out)["limits"]
    assert entry["failing"] == 620
    assert len(entry["cells"]) == 100
    assert run(["quality", mesh, "--stream", "--limits", "skew > 0.5"]) == 1
    assert run(["quality", mesh, "--limits", "mni > 1"]) == 2
    assert "did you mean min?" in capsys.readouterr().err
    assert run(["quality", mesh, "--limits", " "]) == 2
    assert run(["quality", mesh, "-o", str(tmp_path / "rated.su2")]) == 1
    assert "use .vtu, .vtkhdf or .csv" in capsys.readouterr().err
    assert not (tmp_path / "rated.su2").exists()


def test_periodic_sides_are_no_walls_without_a_case(tmp_path, capsys):
    mesh = str(tmp_path / "stage.su2")
    sv.write(mesh, stage())
    assert run(["quality", mesh, "--limits", "equal_layers@1:per1 > 0"]) == 1
    assert "1:per1 is periodic or internal, so it has no wall" in capsys.readouterr().err
    # Of boundaries that match by chance, as ends of a duct, nothing is left out.
    sv.write(mesh, grid((4, 4)))
    assert run(["quality", mesh, "--limits", "equal_layers@x_m > 0"]) != 1


def test_layers_are_in_reports_and_summaries(channel, tmp_path, capsys):
    mesh, _ = channel
    out, report = tmp_path / "out.su2", tmp_path / "report.json"
    assert run(["run", f"{tmp_path}/case.cfg", "-o", str(out), "--json", str(report)]) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if "layers at" in x)
    walls = json.loads(report.read_text())["walls"]
    assert list(walls) == ["y_m", "y_p", "x_p"]
    assert walls == sv.walls(sv.read(out), mesh, list(walls)).summary()
    low = walls["y_m"]["first_height"]["ratio"]["min"]
    assert line.startswith(f"  layers at y_m  first heights {low:.3f} to ")
    assert run(["quality", str(out), "--case", f"{tmp_path}/case.cfg"]) == 0
    assert line in capsys.readouterr().out
    assert run(["quality", str(out), "--json", "-"]) == 0
    alone = json.loads(capsys.readouterr().out)["walls"]
    assert alone["y_m"]["first_height"] == {"after": walls["y_m"]["first_height"]["after"]}
    assert alone["y_m"]["growth"] == {"after": walls["y_m"]["growth"]["after"]}
    assert "x_m" in alone


def test_a_number_without_end_is_infinite_and_one_of_no_cell_has_no_value(tmp_path, capsys):
    mesh = grid((6, 6))
    points, cell = mesh.points.copy(), mesh.cells.by_type[9][1][10]
    points[cell[2:]] = points[cell[1::-1]]
    sv.write(tmp_path / "flat.su2", mesh.with_points(points))
    call = ["quality", str(tmp_path / "flat.su2"), "--limits", "expansion < 5, growth < 3"]
    assert run([*call, "--json", str(tmp_path / "report.json")]) == 3
    said = capsys.readouterr()
    assert re.search(r"expansion < 5 +infinite +not met, in \d cells", said.out)
    none = "no boundary layers at x_m, x_p, y_m, ..."
    assert re.search(rf"growth < 3 +{re.escape(none)} +not met\n", said.out)
    assert f"limit growth < 3 is not met: {none}\n" in said.err
    assert "the limit expansion < 5 is not met, in " in said.err
    assert [
        each["actual"] for each in json.loads((tmp_path / "report.json").read_text())["limits"]
    ] == [None, None]


@pytest.mark.usefixtures("channel")
def test_a_missed_limit_of_walls_says_where_and_whether_the_undeformed_mesh_misses_it(
    tmp_path, capsys
):
    call = ["run", str(tmp_path / "case.cfg"), "-q", "-o", str(tmp_path / "out.su2")]
    report = ["--json", str(tmp_path / "report.json")]
    limits = "LIMITS=( height_ratio@y_m > 0.99999, equal_layers@y_m > 4 )"
    assert run([*call, "--set", limits, *report]) == 4
    error = capsys.readouterr().err
    assert re.search(
        r"height_ratio@y_m > 0.99999 is not met at y_m, in \d+ cells \(.*, undef", error
    )
    missed = r"equal_layers@y_m > 4 is not met at y_m, .*: 1, the undeformed mesh misses it, too: "
    assert re.search(missed, error)
    assert "what may help: LAYERS= AUTO; RELAX= YES; " in error
    ratio, equal = json.loads((tmp_path / "report.json").read_text())["limits"]
    assert (ratio["boundaries"], ratio["undeformed_passed"]) == (["y_m"], True)
    assert (equal["boundaries"], equal["undeformed_passed"]) == (["y_m"], False)
    assert run([*call, "--set", "LIMITS=( equal_layers@y_m > 4 )"]) == 4
    assert "may help" not in capsys.readouterr().err
    assert run([*call, "--set", "LIMITS=( growth@x_m < 1.2 )"]) == 1
    assert "x_m is periodic or internal" in capsys.readouterr().err
    mesh = ["quality", str(tmp_path / "mesh.su2"), "--limits"]
    assert run([*mesh, "height_ratio > 0.5"]) == 1
    assert "compares with the undeformed mesh; give it (--ref" in capsys.readouterr().err


@pytest.mark.parametrize(
    "problem",
    [
        ImportError("libopenblas.so: failed to map segment from shared object"),
        ImportError("libmkl.so: cannot allocate memory in static TLS block"),
        OSError("Could not find/load shared object file 'libllvmlite.so'"),
    ],
)
def test_a_library_that_finds_no_memory_is_told_as_that(problem, monkeypatch, capsys):
    def fails(_):
        raise problem

    monkeypatch.setattr("slideviz.cli.parse", fails)
    assert run(["info", "a.su2"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("slideviz: there is not enough memory to load the libraries that this")


@pytest.mark.parametrize("limit_kb", [300_000, 600_000])
def test_a_command_with_too_little_memory_ends_with_one_line(square, limit_kb):
    """OpenBLAS waits for memory without an end, even at a signal."""
    call = f"ulimit -v {limit_kb}; exec {sys.executable} -m slideviz run {square}/square.cfg -q"
    done = subprocess.run(
        ["sh", "-c", call], cwd=Path(sv.__file__).parents[1], capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stderr.startswith("slideviz: there is not enough memory")
    assert done.stderr.count("\n") == 1
