"""``slideviz film``, and the size and detail of ``run --picture``."""

from __future__ import annotations

import os
import pty
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import slideviz as sv
from slideviz.cli import run
from slideviz.samples.table import write_sample
from slideviz.session.state import second_view


@pytest.fixture
def case(kept_passage: Path, tmp_path: Path) -> Path:
    """A small case of three steps."""
    shutil.copytree(kept_passage, tmp_path / "case")
    return tmp_path / "case" / "passage.cfg"


def film(case: Path, *words: str) -> int:
    return run(["film", str(case), "--set", "STEPS=3", "--size", "320x200", *words])


def test_film_writes_the_steps_and_says_so(case, tmp_path, capsys):
    file = tmp_path / "a.gif"
    assert film(case, "-o", str(file), "--fps", "4", "--hold", "2", "--between", "1") == 0
    with Image.open(file) as image:
        assert image.size == (320, 200)
        assert image.n_frames == 7
        image.seek(6)
        assert image.info["duration"] == 2000
    out = capsys.readouterr().out
    assert "3 steps, min 0." in out
    assert f"film: {file} (7 images, 4 a second)" in out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.gif", "case"]


def test_quiet_is_quiet_and_few_steps_get_a_hint(case, tmp_path, capsys):
    assert film(case, "-o", str(tmp_path / "a.gif"), "-q") == 0
    assert capsys.readouterr() == ("", "")
    assert film(case, "-o", str(tmp_path / "a.gif"), "--force") == 0
    assert "few steps; --between 20 puts 20 images" in capsys.readouterr().out


def test_colors_say_what_is_asked_for(case, tmp_path):
    for what in ("size-skew", "displacement"):
        assert film(case, "-o", str(tmp_path / f"{what}_%d.png"), "--color", what) == 0
    with (
        Image.open(tmp_path / "size-skew_0.png") as quality,
        Image.open(tmp_path / "displacement_0.png") as moved,
    ):
        good, still = (np.asarray(i).astype(int)[60:180, :240] for i in (quality, moved))
    yellow, violet = [253, 231, 37], [68, 1, 84]
    assert (np.abs(good - yellow).max(axis=2) < 40).sum() > 1000
    assert (np.abs(still - violet).max(axis=2) < 40).sum() > 1000


def test_two_runs_stand_beside_each_other(case, tmp_path, capsys):
    file = tmp_path / "a.gif"
    beside = ["--beside", "SLIDING_MODE=none", "--beside", "PERIODIC_MODE=none"]
    words = ["film", str(case), "--steps", "2", "--size", "800x400", "-o", str(file)]
    assert run([*words, *beside]) == 0
    with Image.open(file) as image:
        assert (image.size, image.n_frames) == ((800, 400), 3)
    out = capsys.readouterr()
    assert "SLIDING_MODE= ps, PERIODIC_MODE= moving: 2 steps, min 0." in out.out
    assert "SLIDING_MODE= none, PERIODIC_MODE= none: 2 steps, min 0." in out.out
    assert "SLIDING_MODE= none: inflow, outflow will not slide" in out.err


def test_the_difference_of_two_runs_has_diverging_colors(case, tmp_path, capsys):
    words = [*("film", str(case), "-o", str(tmp_path / "a_%d.png"), "-q", "--size", "800x400")]
    words += ["--steps", "1", "--color", "quality-gain"]
    assert run(words) == 2
    assert "--color quality-gain compares two runs; give --beside too" in capsys.readouterr().err
    beside = ["--beside", "SLIDING_MODE=none", "--beside", "PERIODIC_MODE=none"]
    assert run([*words, *beside]) in (0, 3)
    with Image.open(tmp_path / "a_1.png") as image:
        red, _, blue = np.moveaxis(np.asarray(image).astype(int)[60:380, :340, :3], -1, 0)
    with Image.open(tmp_path / "a_1.png") as image:
        beside = np.asarray(image).astype(int)[60:380, 350:690, :3]
    for here in ((red, blue), (beside[..., 2], beside[..., 0])):  # what one gains the other loses
        assert (here[0] - here[1] > 60).sum() > 100


def test_each_run_judges_the_undeformed_mesh_by_its_own_metric(tmp_path, monkeypatch):
    write_sample("cylindrical", tmp_path / "case", 8)
    case = tmp_path / "case" / "cylindrical.cfg"
    drawn = []

    def draw(session, file, *_, **__):
        drawn.extend((session, second_view(session)))
        yield from ()

    monkeypatch.setattr("slideviz.cli.film_command.draw", draw)
    words = ["film", str(case), "-o", str(tmp_path / "a.gif"), "--set", "STEPS=2", "-q"]
    run([*words, "--beside", "QUALITY_METRIC=rbf-slide"])
    metrics = [[frame.quality.metric for frame in one.frames] for one in drawn]
    assert metrics == [["knupp"] * 3, ["rbf-slide"] * 3]
    left, right = (one.frames[0].quality.mean for one in drawn)
    assert left != right


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--beside", "STEPS"], "--beside 'STEPS' is not of the form KEY=VALUE"),
        (["--beside", "STEP=2"], "--beside STEP=2: unknown key 'STEP'; did you mean STEPS?"),
        (["--beside", "MESH_FILENAME=other.su2"], "must deform the same mesh"),
        (["--beside", "STEPS=1", "--size", "320x300"], "too narrow for two runs"),
    ],
)
def test_what_cannot_stand_beside_is_told_before_the_work(
    case, tmp_path, capsys, monkeypatch, words, message
):
    def never(*_):
        raise AssertionError("too late")

    monkeypatch.setattr("slideviz.cli.film_command._frames", never)
    assert run(["film", str(case), "-o", str(tmp_path / "a.gif"), *words]) == 1
    assert message in capsys.readouterr().err


def test_a_picture_of_two_runs_is_of_one_mesh(case, tmp_path, capsys):
    words = ["picture", str(case), "-o", str(tmp_path / "a.png")]
    assert run([*words, "--beside", "MESH_FILENAME=other.su2"]) == 1
    assert "must deform the same mesh" in capsys.readouterr().err


@pytest.mark.parametrize("beside", ["SLIDING_MODE=none", "undeformed"])
def test_a_picture_of_the_undeformed_mesh_has_nothing_beside_it(case, tmp_path, capsys, beside):
    words = ["picture", str(case), "-o", str(tmp_path / "a.png"), "--step", "0"]
    assert run([*words, "--beside", beside]) == 1
    assert "--step 0 is the undeformed mesh, beside which no" in capsys.readouterr().err
    assert not (tmp_path / "a.png").exists()


def test_inverted_cells_are_code_3_and_the_film_is_written(tmp_path, capsys):
    write_sample("square", tmp_path / "square")
    file, case = tmp_path / "a.mp4", tmp_path / "square" / "square.cfg"
    words = ["film", str(case), "-o", str(file), "--set", "STEPS=1", "--set", "SLIDING_MODE=none"]
    code = run([*words, "--set", "PERIODIC_MODE=none"])
    err = capsys.readouterr().err
    assert code == 3, err
    assert "cells are inverted in the last step; `slideviz run" in err
    assert file.stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-o", "a.avi"], r"no film can be written as .avi"),
        (["-o", "a.mp4", "--size", "321x200"], r"must be even; take 322x200"),
        (["-o", "there.gif"], r"there.gif exists already; choose another name"),
        (["-o", "no/a.gif"], r"the folder no does not exist; create it first"),
        (["-o", "a.gif", "--fps", "0"], r"0 images per second cannot be shown"),
        (["-o", "a.gif", "--set", "STEPS"], r"is not of the form KEY=VALUE"),
    ],
)
def test_wrong_input_is_told_and_leaves_nothing(
    case, tmp_path, monkeypatch, capsys, words, message
):
    monkeypatch.chdir(tmp_path)
    Path("there.gif").write_bytes(b"before")
    assert film(case, *words) == 1
    assert message in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["case", "there.gif"]
    assert Path("there.gif").read_bytes() == b"before"


def test_a_case_without_mesh_is_told(tmp_path, capsys):
    (tmp_path / "a.cfg").write_text("STEPS= 2\n")
    assert film(tmp_path / "a.cfg", "-o", str(tmp_path / "a.gif")) == 1
    assert "MESH_FILENAME is missing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--size", "320"], "is not of the form WIDTHxHEIGHT; write e.g. 1280x800"),
        (["--size", "-3x4"], "expected one argument"),
        (["--zoom", "1,2"], "is neither X,Y,WIDTH"),
        (["--zoom", "0,0,0"], "is neither X,Y,WIDTH"),
        (["--zoom", "near"], "is neither X,Y,WIDTH"),
        (["--color", "red"], "invalid choice"),
    ],
)
def test_wrong_usage_is_code_2(case, tmp_path, capsys, words, message):
    assert run(["film", str(case), "-o", str(tmp_path / "a.gif"), *words]) == 2
    assert message in capsys.readouterr().err


def test_a_picture_has_the_size_and_the_detail_asked_for(tmp_path):
    write_sample("square", tmp_path / "square")
    out, file = tmp_path / "out.su2", tmp_path / "a.png"
    words = ["run", str(tmp_path / "square" / "square.cfg"), "-o", str(out), "-q"]
    words += ["--set", "STEPS=2", "--picture", str(file), "--picture-size", "400x300"]
    colors = []
    for zoom in ("all", "block"):
        if zoom == "block":
            moved = sv.read(out)
            middle = moved.points[moved.marker("BLOCK").nodes].mean(axis=0)
            zoom = f"{middle[0]},{middle[1]},0.02"
        assert run([*words, "--zoom", zoom]) == 0
        with Image.open(file) as image:
            assert image.size == (400, 300)
            colors.append(np.asarray(image.convert("RGB"))[100:200, 50:250])
    assert (colors[0].min(axis=2) < 250).any(), "cells"
    assert (colors[1] == 255).all(), "inside the block"


def test_a_detail_may_lie_where_coordinates_are_negative(case, tmp_path):
    from slideviz.cli.parser import parse
    from slideviz.scene.overview import Detail

    words = ["film", str(case), "-o", "a.gif", "--zoom", "-0.5,.25,-1e-3,2"]
    assert parse(words).zoom == Detail((-0.5, 0.25, -1e-3), 2.0)


def test_designs_of_equal_times_are_refused(case, tmp_path, capsys):
    for times, said in (
        ("0.5 1 0.5", "designs 1 and 3 are at time 0.5 both; keep one"),
        ("1 2", ""),
    ):
        rows = "".join(f"{time},{k}\n" for k, time in enumerate(times.split()))
        (tmp_path / "t.csv").write_text(f"time,airfoil.rotate.angle_deg\n{rows}")
        code = film(case, "-q", "-o", str(tmp_path / "a.gif"), "--designs", str(tmp_path / "t.csv"))
        assert code == (1 if said else 0)
        assert said in capsys.readouterr().err


@pytest.mark.slow
def test_interrupted_it_leaves_nothing_and_says_so(case, tmp_path):
    """Ctrl+C while images are drawn, told by the progress on a terminal."""
    reader, terminal = pty.openpty()
    words = ["film", str(case), "-o", str(tmp_path / "a.mp4"), "--between", "500"]
    with subprocess.Popen(
        [sys.executable, "-m", "slideviz", *words],
        stdout=subprocess.DEVNULL,
        stderr=terminal,
        start_new_session=True,
        # A shell lets what it starts in the background ignore Ctrl+C, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        os.close(terminal)
        told = b""
        while b"image 2 of" not in told and process.poll() is None:
            told += os.read(reader, 4096)
        drafts = [path.suffix for path in tmp_path.iterdir() if path.is_file()]
        process.send_signal(signal.SIGINT)
        with suppress(OSError):  # the terminal is gone when the process is
            while more := os.read(reader, 4096):
                told += more
        assert process.wait() == 130
    assert drafts == [".tmp"]
    assert b"step 1 of" in told
    assert b"cancelled; it leaves nothing half-written" in told
    assert [path.name for path in tmp_path.iterdir()] == ["case"]
