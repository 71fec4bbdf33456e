"""What POSIX systems have and Windows has not stands in one module."""

import ast
import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

import slideviz
from slideviz.errors import MeshError
from slideviz.formats.files import read, write
from slideviz.system import platform
from slideviz.system.atomic import reason_of
from slideviz.system.cleanup import open_temporary
from tests.builders import square
from tests.portable.rules import LACKING, MISSING

ROOT = Path(slideviz.__file__).parent
NAMES = {name for names in LACKING.values() for name in names.split()}
PLACES = ("/proc", "libX11.so")


def used(path):
    """The names and texts of a module that only `platform` may have."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Attribute) and node.attr in NAMES:
            yield node.attr
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names if each.name in (*MISSING, "select"))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from (place for place in PLACES if node.value.startswith(place))


def test_only_one_module_uses_what_windows_lacks():
    found = {
        str(path.relative_to(ROOT)): names
        for path in ROOT.rglob("*.py")
        if path.name != "platform.py" and (names := sorted(set(used(path))))
    }
    assert found == {}
    assert len(set(used(ROOT / "system" / "platform.py"))) > 15


def test_each_name_has_a_row_that_says_what_happens_elsewhere():
    page = (ROOT.parent / "docs" / "reference" / "systems.md").read_text("utf-8")
    table = page.partition("| of Linux | what for | elsewhere |\n")[2].partition("\n\n")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[1:]
    ]
    told = {name.strip("`") for names, _, _ in rows for name in names.split(", ")}
    allowed = {"SIGKILL", "getpriority", "sysconf", "set_blocking"}  # of `prctl`, `setpriority` ...
    assert set(used(ROOT / "system" / "platform.py")) - told - allowed - {*PLACES} == set()
    assert len(rows) == 19
    assert all(names and use and elsewhere for names, use, elsewhere in rows)


def test_a_row_without_pread_and_pwrite(tmp_path, monkeypatch):
    path = tmp_path / "a"
    path.write_bytes(b"0123456789")
    for name in ("pread", "pwrite", "copy_file_range"):
        monkeypatch.delattr(os, name)
    with open_temporary(path) as file:
        assert platform.read_at(file.fileno(), 3, 4) == b"456"
        assert platform.copied(file.fileno(), file.fileno(), 2, 5) == 5
    assert path.read_bytes() == b"0123456789"


def test_links_are_not_followed_without_the_flag(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "O_NOFOLLOW")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with pytest.raises(OSError, match="b is a symbolic link, whose target would be overwritten"):
        open_temporary(tmp_path / "b", new=True)


def test_a_file_that_is_open_cannot_be_replaced_on_windows():
    problem = PermissionError(errno.EACCES, "used")
    assert "no permission" in reason_of(problem)
    problem.winerror = 32
    assert reason_of(problem).startswith("it is open, here or in another program; close it")


def test_a_reader_is_ended_by_the_clock_without_limits_of_processor_time(tmp_path, monkeypatch):
    monkeypatch.setattr("slideviz.formats.files.limits_time", lambda: False)
    monkeypatch.setattr("slideviz.formats.files._ON_THE_CLOCK", 0)
    write(tmp_path / "a.vtu", square(4))
    with pytest.raises(MeshError, match="it takes longer than a file of this size should"):
        read(tmp_path / "a.vtu")


def test_the_rules_of_windows_hold_in_programs_that_are_started(tmp_path):
    """A run and a file of another format; with names removed, and no file replaced while open."""
    script = (
        "import slideviz as sv, slideviz.system.platform as p; from slideviz.cli import run\n"
        "assert not hasattr(p.os, 'pread') and p.resource is None and not p.needs_server()\n"
        "assert p.is_alive(str(p.os.getpid())) and not p.is_alive('0')\n"
        "assert run('sample square --size 12 -o .'.split()) == 0\n"
        "assert run('run square.cfg -q --steps 1 -o a.su2'.split()) in (0, 3)\n"
        "assert run('convert a.su2 b.vtu'.split()) == 0 and run('info b.vtu'.split()) == 0\n"
        "assert run('convert mesh.su2 c.su2b'.split()) == 0\n"
        "words = 'run square.cfg -q --steps 1 --set MESH_FILENAME=c.su2b -o d.su2b --stream'\n"
        "assert run(words.split()) in (0, 3)\n"
    )
    variables = os.environ | {
        "SLIDEVIZ_TESTS": "portable",
        "PYTHONPATH": os.pathsep.join([str(ROOT.parent / "tests" / "portable"), str(ROOT.parent)]),
    }
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, env=variables, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert not list(tmp_path.glob(".slideviz-*"))
