"""slideviz compare: files, exit codes, sentences, and what a cancel leaves."""

from __future__ import annotations

import csv
import re
import signal
import subprocess
import sys
from io import StringIO
from pathlib import Path

import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import DeformError
from slideviz.samples.table import write_sample
from tests.builders import stage
from tests.processes import wait_until


@pytest.fixture
def square(tmp_path: Path) -> Path:
    """A case of 10 by 10 cells."""
    write_sample("square", tmp_path / "square", 10, "motion")
    return tmp_path / "square" / "square.cfg"


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "compare.csv").open() as file:
        return list(csv.DictReader(file))


def test_all_files_are_written_and_the_table_is_printed(square, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("slideviz.study.montage.DPI", 100)
    out = tmp_path / "out"
    argv = ["compare", str(square), "--methods", "none,ps", "--steps", "1,2", "-o", str(out)]
    assert run([*argv, "--periodic", "fixed,moving"]) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {
        "compare.csv",
        *(f"steps.{end}" for end in ("png", "svg")),
        *(f"histogram_0{n}_steps.{end}" for n in (1, 2) for end in ("png", "svg")),
        *(f"by_step_02_steps.{end}" for end in ("png", "svg")),
        *(f"quality_0{n}_steps.png" for n in (1, 2)),
    }
    printed = capsys.readouterr().out
    rows = table(out)
    assert len(rows) == 2 * 2 * 2
    for row in rows:
        if row["min"]:
            assert f"{float(row['min']):.6f}" in printed
    assert "6 combinations" in printed
    assert printed.count("needs a sliding method") == 1, "said once, before the rows"
    assert printed.index("needs a sliding method") < printed.index("max error")
    assert "not possible" not in printed
    assert str(out / "quality_02_steps.png") in printed


def test_quiet_and_without_pictures(square, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["compare", str(square), "--methods", "ps", "--periodic", "moving", "--steps", "2"]
    assert run([*argv, "-o", str(out), "-q", "--no-pictures", "--set", "RBF_KERNEL=ctps-c1"]) == 0
    assert capsys.readouterr().out == ""
    assert not list(out.glob("quality*"))
    (row,) = table(out)
    assert (row["method"], row["periodic"], row["steps_made"]) == ("ps", "moving", "2")


def test_other_methods_are_compared_too(square, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["compare", str(square), "--methods", "idw,elastic,ps", "--periodic", "moving"]
    assert run([*argv, "--steps", "2", "-o", str(out), "--no-pictures"]) == 0
    assert [row["method"] for row in table(out) if row["min"]] == ["idw", "elastic", "ps"]
    assert "inverse distance" in (out / "by_step_02_steps.svg").read_text()


def test_the_default_folder_is_named_after_the_case(square, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    argv = ["compare", str(square), "--methods", "none", "--periodic", "all", "--steps", "1"]
    assert run([*argv, "--no-pictures"]) == 0
    rows = table(tmp_path / "square_compared")
    assert [row["periodic"] for row in rows] == ["none", "periodic", "fixed", "moving"]


def test_data_reduction_leaves_its_convergence(square, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["compare", str(square), "--methods", "ps", "--periodic", "moving", "--steps", "1"]
    reduced = ["--set", "DATA_REDUCTION=YES", "--set", "DATA_RED_TOLERANCE=0.01"]
    assert run([*argv, *reduced, "-o", str(out), "--no-pictures"]) == 0
    assert (out / "convergence_01_steps.png").exists()
    with (out / "convergence.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert float(lines[-1]["error"]) <= 0.01 < float(lines[0]["error"])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--methods", "ps,pz"], "--methods: 'pz' is not one of none, ps, ds, idw, elastic"),
        (["--periodic", "sometimes"], "--periodic: 'sometimes' is not one of none, periodic"),
        (["--methods", ","], "--methods names none of none, ps"),
        (["--steps", "1,0"], "--steps: 0 is too small; expected a whole number from 1 to 9999, or"),
        (["--steps", "-2"], "--steps: -2 is too small; expected a whole number from 1 to 9999"),
        (["--steps", "1,10000"], "--steps: 10000 is too large; expected a whole number from 1"),
        (["--steps", " "], "--steps names no number"),
    ],
)
def test_what_cannot_be_compared_is_told_before_anything_is_done(
    square, tmp_path, capsys, more, words
):
    out = tmp_path / "out"
    arguments = [f"{more[0]}={more[1]}"]
    assert run(["compare", str(square), "-o", str(out), *arguments]) == 1
    assert words in capsys.readouterr().err
    assert not out.exists()


def test_when_nothing_can_be_computed_the_code_says_so(square, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["compare", str(square), "--methods", "none", "--periodic", "moving", "-o", str(out)]
    assert run(argv) == 1
    assert "no combination could be computed" in capsys.readouterr().err
    assert [row["problem"] != "" for row in table(out)] == [True] * 3


def test_what_fails_later_has_a_line_and_the_reason_once(square, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    argv = ["compare", str(square), "--methods", "ps", "--periodic", "none", "--steps", "1,2"]

    def through(prepared):
        raise DeformError("the motion puts BLOCK through RIGHT")

    monkeypatch.setattr("slideviz.study.combinations.make_setup", through)
    assert run([*argv, "-o", str(out), "--no-pictures"]) == 1
    printed = capsys.readouterr().out
    assert "2 combinations" in printed
    assert printed.count("not possible [1]") == 2
    assert printed.count("not possible [1]: ") == 1


def test_by_itself_it_takes_the_modes_of_the_case(square, tmp_path, capsys):
    out = tmp_path / "out"
    argv = ["compare", str(square), "--steps", "1", "-o", str(out), "--no-pictures"]
    assert run([*argv, "--set", "PERIODIC_MODE=fixed"]) == 0
    assert {(row["method"], row["periodic"]) for row in table(out)} == {
        *((method, "fixed") for method in ("none", "ps", "ds"))
    }
    assert "--periodic takes none, periodic, moving, too" in capsys.readouterr().out


class Terminal(StringIO):
    def isatty(self):
        return True


def test_the_bar_of_a_row_says_which_and_how_long(square, tmp_path, monkeypatch):
    import sys

    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr("slideviz.cli.progress._EVERY", 0.0)
    argv = ["compare", str(square), "--methods", "ps", "--periodic", "moving", "--steps", "1,3"]
    assert run([*argv, "-o", str(tmp_path / "out"), "--no-pictures"]) == 0
    shown = sys.stderr.getvalue()
    assert "1 of 2: ps, moving, step 1 of 1: " in shown
    first = re.findall(r"1 of 2: ps, moving, step 1 of 1: [a-z ]+(, about)?", shown)
    assert set(first) == {""}, "nothing is known yet"
    assert re.search(r"2 of 2: ps, moving, step 1 of 3: [a-z ]+, about \d+ s left", shown)


def test_a_case_without_mesh_and_a_folder_that_is_a_file_are_told(square, tmp_path, capsys):
    empty = tmp_path / "empty.cfg"
    empty.write_text("STEPS= 2\n")
    assert run(["compare", str(empty)]) == 1
    assert "MESH_FILENAME is missing" in capsys.readouterr().err
    assert run(["compare", str(square), "-o", str(square)]) == 1
    assert "cannot create this folder" in capsys.readouterr().err


def test_the_help_names_every_method(capsys):
    from slideviz.study.combinations import COMPARED_METHODS
    from slideviz.terms import PERIODIC_MODES

    assert run(["compare", "--help"]) == 0
    text = capsys.readouterr().out
    assert ",".join(COMPARED_METHODS) in text
    assert ",".join(PERIODIC_MODES) in text


def test_an_interrupt_leaves_what_was_finished(tmp_path):
    write_sample("square", tmp_path / "square", 60, "motion")
    out = tmp_path / "out"
    argv = ["compare", str(tmp_path / "square" / "square.cfg"), "--methods", "ps", "-o", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-m", "slideviz", *argv, "--periodic", "moving", "--steps", "1,2000"],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    wait_until((out / "compare.csv").exists)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130, told
    assert "cancelled" in told
    (row,) = table(out)
    assert row["steps"] == "1"
    assert float(row["mean"]) > 0
    assert [path.name for path in out.iterdir()] == ["compare.csv"]


def test_without_pictures_no_mesh_is_kept(square, tmp_path, monkeypatch):
    from slideviz.cli import compare_command

    kept = []

    def drawn(arguments, case, mesh, rows, folder):
        kept.extend(row.result.mesh for row in rows)
        return []

    monkeypatch.setattr(compare_command, "_drawn", drawn)
    argv = ["compare", str(square), "--methods", "ps", "--periodic", "none", "--steps", "1,2"]
    assert run([*argv, "-q", "-o", str(tmp_path / "a")]) == 0
    assert run([*argv, "-q", "-o", str(tmp_path / "b"), "--no-pictures"]) == 0
    assert [mesh is None for mesh in kept] == [False, False, True, True]


def test_limits_are_a_column_and_missed_ones_are_said(square, tmp_path, capsys):
    words = ["compare", str(square), "--methods", "none,ps", "--steps", "1", "--no-pictures"]
    limits = ["--set", "LIMITS=( inverted = 0 )"]
    assert run([*words, *limits, "-o", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    rows = [row for row in table(tmp_path / "out") if not row["problem"]]
    missed = [row for row in rows if int(row["inverted"])]
    assert missed
    for row in rows:
        count = int(row["inverted"])
        assert row["limits"] == (f"inverted = 0: {count}" if count else "met")
    assert out.count("not inverted = 0: ") == len(missed)


def test_zones_are_compared_together(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mesh = stage()
    sv.write("stage.su2", mesh)
    roles = dict.fromkeys(("1:blade", "2:blade"), "moving") | {"1:hub": "sliding"}
    motion = sv.Translate(("1:blade", "2:blade"), (0.0, 0.0, 0.01))
    case = sv.Case(mesh_file=tmp_path / "stage.su2", roles=roles, motions=(motion,))
    case.write("stage.cfg")
    words = ["compare", "stage.cfg", "--methods", "none,ps", "--steps", "2", "-o", "out"]
    assert run([*words, "--no-pictures"]) == 0
    for row, method in zip(table(tmp_path / "out"), ("none", "ps"), strict=True):
        *_, last = sv.deform(case.change(sliding=method, steps=2), mesh)
        assert float(row["min"]) == sv.quality(last.mesh, mesh).min
