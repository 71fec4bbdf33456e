"""``slideviz doctor``: what it finds, and what it says is missing."""

import json
import re
from importlib import metadata

import pytest

from slideviz.cli import doctor_command, run
from slideviz.system import missing_libraries


def test_it_prints_every_section_and_that_nothing_is_missing(capsys, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(doctor_command, "missing_for_window", list)
    assert run(["doctor"]) == 0
    out = capsys.readouterr().out
    assert re.findall(r"^(\w+):$", out, re.MULTILINE) == list(doctor_command.SECTIONS)
    assert f"numpy              {metadata.version('numpy')}" in out
    assert "OpenGL renderer" in out
    assert out.endswith("nothing is missing\n")


def test_json_has_the_sections_and_the_problems(tmp_path, capsys):
    assert run(["doctor", "--json", "-"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert set(report) == {*doctor_command.SECTIONS, "problems"}
    assert report["threads"]["compiled loops"] >= 1
    file = tmp_path / "doctor.json"
    assert run(["doctor", "--json", str(file)]) == 0
    assert json.loads(file.read_text())["program"] == report["program"]
    assert "program:" in capsys.readouterr().out


def _lacking(name):
    def version(asked):
        if asked == name:
            raise metadata.PackageNotFoundError(asked)
        return "1.0"

    return version


@pytest.mark.parametrize(
    ("target", "value", "what", "remedy"),
    [
        ("metadata.version", _lacking("vtk"), "the package vtk is not inst", "pip install vtk"),
        (
            "missing_for_window",
            lambda: ["libegl1"],
            "the window lacks libraries of the system",
            "sudo apt-get install libegl1",
        ),
        ("FONTS", (), "finds no font", "sudo apt-get install fontconfig-config fonts-dejavu-core"),
        ("free_memory", lambda: 1e6, "of memory are free", "close other programs"),
        ("LEAST_DISK", float("inf"), "are free for temporary files", "free some space in /"),
    ],
)
def test_what_is_missing_comes_with_the_line_that_mends_it(
    target, value, what, remedy, monkeypatch, capsys
):
    monkeypatch.setattr(f"slideviz.cli.doctor_command.{target}", value)
    assert run(["doctor"]) == 0
    _, missing = capsys.readouterr().out.split("\nmissing:\n")
    lines = missing.splitlines()
    (at,) = [k for k, line in enumerate(lines) if what in line]
    assert lines[at + 1].strip().startswith(remedy)


def test_memory_is_unknown_where_the_system_does_not_say(monkeypatch, capsys):
    monkeypatch.setattr("slideviz.cli.doctor_command.free_memory", lambda: float("inf"))
    assert run(["doctor"]) == 0
    assert re.search("free +unknown\n", capsys.readouterr().out)


def test_without_opengl_the_packages_are_named(monkeypatch, capsys):
    monkeypatch.setattr("slideviz.export.offscreen.has_opengl", lambda: False)
    assert run(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "OpenGL             missing" in out
    command = missing_libraries.apt_install(missing_libraries.OPENGL)
    assert f"pictures, films and the window lack OpenGL\n    {command}" in out


def test_a_broken_library_hides_nothing_else(monkeypatch, capsys):
    def broken(_):
        raise ImportError("libllvm is damaged")

    sections = doctor_command.SECTIONS | {"threads": broken}
    monkeypatch.setattr(doctor_command, "SECTIONS", sections)
    assert run(["doctor"]) == 0
    out = capsys.readouterr().out
    assert "threads: ImportError: libllvm is damaged\n    pip install --force-reinst" in out
    assert "OpenGL" in out
