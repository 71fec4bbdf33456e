"""``make demo``: what it writes, and what it says that it writes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="needs bash")
def test_the_demo_tells_every_file_that_it_writes(tmp_path):
    (tmp_path / "tools").mkdir()
    shutil.copy(HERE / "tools" / "demo.sh", tmp_path / "tools")
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    command = tmp_path / ".venv" / "bin" / "slideviz"
    # A small sample, to be quick.
    command.write_text(
        f'#!/bin/sh\n[ "$1" = sample ] && set -- "$@" --size 12\n'
        f'exec {sys.executable} -m slideviz "$@"\n'
    )
    command.chmod(0o755)
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "mine.txt").write_text("keep")
    environment = os.environ | {"WINDOW": "no", "PYTHONPATH": str(HERE)}
    done = subprocess.run(
        ["bash", "tools/demo.sh"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=True,
    )
    written = {str(path.relative_to(tmp_path)) for path in (tmp_path / "demo").rglob("*.*")}
    _, listed = done.stdout.split("written:\n")
    told = {line.split()[0]: line.split()[1:] for line in listed.splitlines() if "demo/" in line}
    told.pop("the", None)  # the last line: how to open the window
    assert told.keys() == written - {"demo/mine.txt"}
    assert all(told.values()), "each has a few words"
    assert (tmp_path / "demo" / "mine.txt").read_text() == "keep"
