"""What is printed is text; a terminal that is closed or knows ASCII only is no mistake."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from slideviz.cli import run
from slideviz.cli.terminal import Terminal, plain
from slideviz.errors import SlidevizError
from slideviz.samples.table import write_sample


@pytest.fixture
def square(tmp_path: Path) -> Path:
    write_sample("square", tmp_path)
    return tmp_path


def test_control_characters_of_a_case_are_shown(square, capsys):
    text = (square / "square.cfg").read_text()
    (square / "a.cfg").write_text(text.replace("BLOCK", '"BLOCK\x1b[31m\x07\x9b\u202eRED"'))
    assert run(["run", str(square / "a.cfg")]) == 1
    err = capsys.readouterr().err
    assert r"BLOCK\x1b[31m\x07\x9b\u202eRED" in err
    assert plain(err) == err


def test_control_characters_of_a_file_name_and_of_an_option_are_shown(square, capsys):
    name = square / "a\x1b[2Jb\udcff.su2"
    (square / "mesh.su2").rename(name)
    assert run(["info", str(name)]) == 0
    assert r"a\x1b[2Jb\udcff.su2: 2D" in capsys.readouterr().out
    assert run(["run", str(square / "square.cfg"), "--steps", "\x1b[2J"]) == 1
    assert "\x1b" not in capsys.readouterr().err
    assert run(["run", "--nonsense\x1b[2J"]) == 2
    assert "\x1b" not in capsys.readouterr().err


def test_text_stays_as_it_is():
    text = "█ ▏ é 部 \u2009 tab\tand\nlines"
    assert plain(text) == text
    assert plain("a\rb\x00c\x7f") == r"a\rb\x00c\x7f"


@pytest.mark.parametrize(
    ("encoding", "words"),
    [("ascii", "##| it's \\xe9\n"), ("latin-1", "##| it's é\n"), ("utf-8", "██▏ it’s é\n")],
)
def test_what_an_encoding_does_not_have_is_written_otherwise(encoding, words):
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding)
    out = Terminal(stream, needed=True)
    out.write("██▏ it’s é\n")
    out.flush()
    assert raw.getvalue().decode(encoding).endswith(words)


class Full(io.StringIO):
    encoding = "utf-8"

    def flush(self):
        raise OSError(28, "No space left on device")


def test_a_full_disk_under_the_output_is_told_and_under_the_errors_not():
    with pytest.raises(SlidevizError, match="the standard output cannot be written: No space"):
        Terminal(Full(), needed=True).flush()
    Terminal(Full(), needed=False).flush()


@pytest.mark.parametrize(
    ("end", "code", "said"),
    [
        pytest.param(">&-", 0, "", marks=pytest.mark.slow),
        pytest.param("2>&-", 0, "cells by quality", marks=pytest.mark.slow),
        (">&- 2>&- <&-", 0, ""),
        (">/dev/full", 1, "slideviz: the standard output cannot be written: No space left on "),
        ("| head -c 1", 0, "m"),
        ("--help >/dev/full", 1, "slideviz: the standard output cannot be written: No space left"),
    ],
)
def test_streams_that_are_closed_or_full(square, end, code, said):
    call = f"exec {sys.executable} -m slideviz quality mesh.su2 --json a.json {end}"
    places = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(
        ["sh", "-c", call], cwd=square, env=places, capture_output=True, text=True
    )
    assert done.returncode == code
    told = done.stdout + done.stderr
    assert said in told
    assert "Traceback" not in told
    assert "Exception" not in told
    if code == 0:
        assert (square / "a.json").read_text().endswith("}\n")


def test_a_screen_that_is_not_there_is_told(square, monkeypatch, capsys):
    monkeypatch.setenv("DISPLAY", ":93")
    monkeypatch.setenv("WAYLAND_DISPLAY", "nowhere")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(square))
    assert run([str(square / "square.cfg")]) == 1
    err = capsys.readouterr().err
    assert "there is no screen (DISPLAY=:93 and WAYLAND_DISPLAY=nowhere: no server answers" in err
    assert "slideviz run CASE" in err


@pytest.mark.slow
def test_pictures_are_drawn_without_the_screen_that_is_named(square):
    call = [sys.executable, "-m", "slideviz", "run", "square.cfg", "--steps", "1", "-q"]
    done = subprocess.run(
        [*call, "--picture", "a.png"],
        cwd=square,
        env={**os.environ, "DISPLAY": ":93"},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (square / "a.png").exists()
