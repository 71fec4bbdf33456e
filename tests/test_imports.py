"""Every module can be imported where the system has less than Linux has."""

import subprocess
import sys
from pathlib import Path

import pytest

ELSEWHERE = """
import importlib, pkgutil, signal, sys

for name in ("resource", "fcntl", "termios", "pwd", "grp"):
    sys.modules[name] = None
for name in ("SIGHUP", "SIGKILL", "SIGXCPU"):
    delattr(signal, name)

def refuse(event, arguments):
    if event == "open" and str(arguments[0]).startswith("/proc"):
        raise FileNotFoundError(arguments[0])

sys.addaudithook(refuse)

import slideviz

names = [found.name for found in pkgutil.walk_packages(slideviz.__path__, "slideviz.")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""
"""What Windows and macOS lack is taken away before anything is imported."""


@pytest.mark.slow
def test_modules_import_without_what_only_linux_has():
    done = subprocess.run(
        [sys.executable, "-c", ELSEWHERE], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout.split()[-1]) > 100


SMALL = """
import sys
from slideviz.cli import run

run(["run", *sys.argv[1:], "--steps", "1", "--quiet"])
slow = ("scipy.spatial", "scipy.sparse", "h5py", "matplotlib", "slideviz.streaming.run")
print(*(name for name in slow if name in sys.modules))
"""


def test_a_small_run_loads_nothing_that_takes_long_and_is_not_needed(tmp_path):
    case = Path(__file__).parents[1] / "sample_meshes" / "square" / "square.cfg"
    call = [sys.executable, "-c", SMALL, case, "-o", tmp_path / "out.su2"]
    done = subprocess.run(call, capture_output=True, text=True, timeout=120, check=True)
    assert (tmp_path / "out.su2").exists()
    assert not done.stdout.strip()
