"""``slideviz sweep``: the table of results, the report, and signs of what is wrong."""

from __future__ import annotations

import csv
import json
import shutil
import signal
import subprocess
import sys

import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.design.sweeps import sweep as sweeping
from slideviz.samples.table import write_sample
from tests.processes import wait_until


@pytest.fixture
def folder(kept_passage, tmp_path, monkeypatch):
    shutil.copytree(kept_passage, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "designs.csv").write_text("airfoil.translate.dy,STEPS\n0.01,1\n0.1,2\n30,1\n")
    return tmp_path


@pytest.fixture
def in_threads(monkeypatch):
    """Let threads of this process do what processes do: they start at once."""
    from concurrent.futures import ThreadPoolExecutor

    def workers(executor, *_):
        return ThreadPoolExecutor(1)

    monkeypatch.setattr(sweeping, "Processes", type("Threads", (), {"__new__": workers}))


def said(capsys, *words):
    code = run(list(map(str, words)))
    out, err = capsys.readouterr()
    return code, out, err


def test_one_design_is_no_designs(folder, in_threads, capsys):
    (folder / "one.csv").write_text("STEPS\n1\n")
    code, out, _ = said(capsys, "sweep", "passage.cfg", "one.csv", "-o", "one")
    assert code == 0
    assert "1 design of STEPS" in out
    assert "designs" not in out.replace("designs:", "")


def test_a_table_of_results(folder, in_threads, capsys):
    words = ("sweep", "passage.cfg", "designs.csv", "-o", "out", "--json", "report.json")
    code, out, err = said(capsys, *words)
    assert (code, err) == (0, "")
    assert "3 designs of airfoil.translate.dy, STEPS" in out
    assert "with inverted cells" in out
    with (folder / "out" / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["design"], row["airfoil.translate.dy"], row["STEPS"]) for row in rows] == [
        ("1", "0.01", "1"),
        ("2", "0.1", "2"),
        ("3", "30.0", "1"),
    ]
    report = json.loads((folder / "report.json").read_text())
    assert report["columns"] == ["airfoil.translate.dy", "STEPS"]
    assert (report["designs"], report["failed"], report["inverted"]) == (3, 0, [3])
    assert report["best"]["min"] == max(float(row["min"]) for row in rows)
    assert (report["worst"]["design"], report["worst"]["min"]) == (3, 0.0)
    code, out, err = said(capsys, *words[:5])
    assert code == 1
    assert "there are results already" in err
    code, out, err = said(capsys, *words[:5], "--resume")
    assert code == 0
    assert "0 designs in" in out
    assert "(3 were there)" in out


def test_a_run_with_the_same_values_gives_the_same_mesh(folder, in_threads, capsys):
    assert said(capsys, "sweep", "passage.cfg", "designs.csv", "-o", "out", "--meshes", "-q") == (
        (0, "", "")
    )
    motion = "(airfoil, rotate, -8, centroid) ; (airfoil, translate, 0, 0.1)"
    code, *_ = said(
        capsys, "run", "passage.cfg", "--set", f"MOTION={motion}", "--steps", 2, "-o", "one.su2"
    )
    assert code == 0
    assert (folder / "one.su2").read_bytes() == (folder / "out" / "design_2.su2").read_bytes()


def test_columns_are_listed(folder, capsys):
    code, out, _ = said(capsys, "sweep", "passage.cfg", "--columns")
    assert code == 0
    assert "airfoil.rotate.angle_deg" in out
    assert "SLIDING_MODE" in out


@pytest.mark.parametrize(("name", "dim"), [("square", 2), ("hexahedron", 3)])
def test_a_plane_mesh_has_no_column_for_an_axis(tmp_path, name, dim, capsys):
    write_sample(name, tmp_path, 5)
    path = tmp_path / f"{name}.cfg"
    case = sv.Case.read(path)
    moving = case.markers_with("moving")[0]
    case.change(motions=(sv.Rotate(moving, 1.0),)).write(path)
    code, out, _ = said(capsys, "sweep", str(path), "--columns")
    assert code == 0
    assert f"{moving}.rotate.angle_deg" in out
    assert ("axis_" in out) == (dim == 3)
    case.mesh_file.unlink()
    assert "axis_" in said(capsys, "sweep", str(path), "--columns")[1]


def test_designs_that_fail(folder, in_threads, capsys):
    (folder / "designs.csv").write_text("SLIDING_MODE\nnone\nps\n")
    code, _, err = said(capsys, "sweep", "passage.cfg", "designs.csv", "-o", "out", "-q")
    assert code == 0
    assert "slideviz: warning: design 1: PERIODIC_MODE= moving needs a sliding method" in err
    words = ("sweep", "passage.cfg", "designs.csv", "-o", "out", "-q", "--force")
    (folder / "designs.csv").write_text("SLIDING_MODE,PERIODIC_TYPE\nnone,auto\nps,rotational\n")
    code, _, err = said(capsys, *words)
    assert code == 1
    assert "no design could be computed; out/results.csv says why for each" in err
    for count in (1, 2):  # one reason is one line
        (folder / "designs.csv").write_text("SLIDING_MODE\n" + count * "none\n")
        code, _, err = said(capsys, *words)
        assert code == 1
        assert err.startswith("slideviz: no design could be computed: PERIODIC_MODE= moving needs")
        assert err.count("\n") == 1
    (folder / "designs.csv").write_text("airfoil.translate.y\n0.1\n0.2\n")
    code, _, err = said(capsys, *words, "--meshes", "--stream", "--zone", "9")
    assert code == 1
    assert "there is no zone 9" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("passage.cfg",), "the table of designs is missing"),
        (("passage.cfg", "none.csv"), "none.csv: there is no such table of designs"),
        (("passage.cfg", "designs.csv", "--scheduler", "tcp://127.0.0.1:1"), "no scheduler"),
        (
            ("passage.cfg", "designs.csv", "--scheduler", "x", "--workers", "2"),
            "a Dask cluster has its own",
        ),
        (("passage.cfg", "designs.csv", "--json", "designs.csv"), "the table of designs"),
    ],
    ids=["no table", "no file", "no scheduler", "two kinds", "over the table"],
)
def test_what_is_wrong(folder, capsys, monkeypatch, words, problem):
    from slideviz.cli import sweep_command

    monkeypatch.setattr(sweep_command, "_CONNECTING", 0.5)
    code, _, err = said(capsys, "sweep", *words)
    assert code == 1
    assert problem in err


@pytest.mark.parametrize(
    "number",
    [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)],
    ids=["SIGINT", "SIGTERM"],
)
def test_a_signal_ends_it_and_resume_goes_on(folder, number):
    lines = "\n".join(f"{0.0001 * k},5" for k in range(400))
    (folder / "designs.csv").write_text(f"airfoil.translate.dy,STEPS\n{lines}\n")
    words = [sys.executable, "-m", "slideviz", "sweep", "passage.cfg", "designs.csv", "-o", "out"]
    with subprocess.Popen(
        [*words, "--workers", "1"],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as child:
        results = folder / "out" / "results.csv"
        wait_until(lambda: results.exists() and results.read_bytes().count(b"\n") >= 4)
        child.send_signal(number)
        _, err = child.communicate(timeout=60)
    assert child.returncode == 128 + number
    assert "of 400 designs, and --resume continues" in err
    assert len([line for line in err.splitlines() if "compiling loops" not in line]) == 1


def test_limits_are_a_column_and_designs_that_miss_one_are_grouped(folder, in_threads, capsys):
    words = ("sweep", "passage.cfg", "designs.csv", "-o", "out")
    limited = ("--set", "LIMITS=( min > 0.3, mean > 0.999 )", "--json", "report.json")
    code, out, err = said(capsys, *words, *limited)
    assert (code, err) == (0, "")
    with (folder / "out" / "results.csv").open(newline="") as file:
        cells = {row["design"]: (row["limits"], row) for row in csv.DictReader(file)}
    for text, row in cells.values():
        expected = [f"min > 0.3: {float(row['min']):.6g}"] * (float(row["min"]) <= 0.3)
        assert text == "; ".join([*expected, f"mean > 0.999: {float(row['mean']):.6g}"])
    assert cells["3"][0].startswith("min > 0.3: 0; mean")
    report = json.loads((folder / "report.json").read_text())
    assert report["limits"] == [
        {"limit": "mean > 0.999", "designs": [1, 2, 3]},
        {"limit": "min > 0.3", "designs": [3]},
    ]
    assert "not min > 0.3          1  (design 3)" in out
    assert "not mean > 0.999       3  (design 1, 2, 3)" in out
    code, out, _ = said(capsys, *words, *limited, "--resume")
    assert "3 were there" in out
    assert json.loads((folder / "report.json").read_text())["limits"] == report["limits"]
    met = ("--set", "LIMITS=( mean > 0 )", "--force")
    assert "not mean" not in said(capsys, *words, *met)[1]
    assert (folder / "out" / "results.csv").read_text().count(",met,") == 3
