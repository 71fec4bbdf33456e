"""Every module can be imported where the system has less than Linux has."""

import ast
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


PARSED = """
import sys
from slideviz.cli.parser import parse

parse(["quality", "mesh.su2"])
print(*(name for name in ("numpy", "scipy", "numba") if name in sys.modules))
"""


def test_a_command_line_is_parsed_before_numpy_is_loaded():
    call = [sys.executable, "-c", PARSED]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    assert not done.stdout.strip()


PACKAGE = Path(__file__).parents[1] / "slideviz"
UNFINISHED = ("case/model.py",)
"""Modules whose circle of imports is still to be cut; there shall be none."""


def _late(source: str) -> list[int]:
    """Return the lines of imports in functions that no comment ``# Late: why`` precedes."""
    lines = source.splitlines()
    imports = (ast.Import, ast.ImportFrom)
    within = {
        node.lineno: node.end_lineno or node.lineno
        for function in ast.walk(ast.parse(source))
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef)
        for node in ast.walk(function)
        if isinstance(node, imports)
    }
    told = set()
    for first, last in sorted(within.items()):
        above = first - 1
        while above and not lines[above - 1].strip():
            above -= 1
        if lines[above - 1].strip().startswith("# Late: ") or above in told:
            told.add(last)
    return [first for first, last in sorted(within.items()) if last not in told]


def test_an_import_in_a_function_says_which_time_it_saves():
    names = [path.relative_to(PACKAGE).as_posix() for path in sorted(PACKAGE.rglob("*.py"))]
    silent = [
        f"slideviz/{name}:{line}"
        for name in names
        if name not in UNFINISHED
        for line in _late((PACKAGE / name).read_text(encoding="utf-8"))
    ]
    assert not silent, "move them to the top, or say why above them: # Late: NAME takes 0.4 s."


@pytest.mark.parametrize(
    ("source", "lines"),
    [
        ("import a\ndef f():\n    # Late: b takes 0.1 s.\n    import b\n    import c\n", []),
        ("def f():\n    import b\n", [2]),
        ("def f():\n    # Late: b takes 0.1 s.\n    import b\n    b()\n    import c\n", [5]),
        ("def f():\n    def g():\n        from b import c\n", [3]),
    ],
)
def test_late_imports_are_noticed(source, lines):
    assert _late(source) == lines
