"""``make quick`` runs the tests of what changed: those of its name, and those that import it."""

import subprocess

import pytest

from tools import quick

FILES = {
    "slideviz/__init__.py": "",
    "slideviz/mesh/model.py": "class Mesh: ...\n",
    "slideviz/mesh/inner.py": "",
    "slideviz/mesh/repair.py": "from slideviz.mesh import inner\n",
    "slideviz/gui/panels/motions.py": "from slideviz.mesh.model import Mesh\n",
    "slideviz/cli/gap_command.py": "",
    "tests/mesh/test_model.py": "import slideviz.mesh.model\n",
    "tests/mesh/test_first.py": "from slideviz.mesh.model import Mesh\n",
    "tests/mesh/test_repair.py": "def test():\n    from slideviz.mesh.repair import repair\n",
    "tests/gui/test_motions.py": "",
    "tests/case/test_motions.py": "from slideviz.mesh.model import Mesh\n",
    "tests/test_cli.py": "",
    "tests/test_fail.py": "def test_fail():\n    assert False\n",
}


@pytest.fixture
def clone(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "pyproject.toml").write_text('[tool.pytest.ini_options]\nmarkers = ["slow"]\n')
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-qm", "A clone")
    return tmp_path


def git(folder, *words):
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    subprocess.run(["git", *who, *words], cwd=folder, check=True)


@pytest.mark.parametrize(
    ("file", "tests"),
    [
        ("slideviz/mesh/model.py", ["tests/mesh/test_model.py", "tests/mesh/test_first.py"]),
        ("slideviz/gui/panels/motions.py", ["tests/gui/test_motions.py"]),
        ("slideviz/mesh/inner.py", ["tests/mesh/test_repair.py"]),
        ("slideviz/cli/gap_command.py", ["tests/test_cli.py"]),
        ("slideviz/errors.py", []),
        ("tests/case/test_motions.py", ["tests/case/test_motions.py"]),
    ],
)
def test_tests_have_the_name_of_a_module_or_import_it(clone, file, tests):
    assert quick.tests_of(clone, file) == tests


def test_those_of_changed_and_new_files_run(clone, monkeypatch, capfd):
    monkeypatch.setattr(quick, "ROOT", clone)
    assert quick.main([]) == 0
    assert capfd.readouterr().out == "no tested file has changed\n"
    (clone / "slideviz/mesh/model.py").write_text("")
    (clone / "tests/test_new.py").touch()
    (clone / "notes.txt").touch()
    (clone / "tests/gui/test_motions.py").unlink()
    assert quick.changed_files(clone, "HEAD") == ["slideviz/mesh/model.py", "tests/test_new.py"]
    (clone / "slideviz/mesh/model.py").write_text(FILES["slideviz/mesh/model.py"])
    (clone / "tests/test_new.py").write_text("def test_new(): ...\n")
    assert quick.main(["--no-xvfb"]) == 0
    assert "1 passed" in capfd.readouterr().out
    (clone / "tests/test_fail.py").write_text(FILES["tests/test_fail.py"] + "\n")
    assert quick.main(["--no-xvfb", "-n0"]) == 1
    assert "1 failed, 1 passed" in capfd.readouterr().out
    git(clone, "add", ".")
    git(clone, "commit", "-qm", "A change")
    assert quick.changed_files(clone, "HEAD") == []
    assert quick.changed_files(clone, "HEAD~1") == ["tests/test_fail.py", "tests/test_new.py"]


def test_of_many_test_files_only_the_first_run(clone, monkeypatch, capfd):
    monkeypatch.setattr(quick, "ROOT", clone)
    monkeypatch.setattr(quick, "MOST", 1)
    (clone / "slideviz/mesh/model.py").write_text("")
    monkeypatch.setattr(quick.subprocess, "call", lambda command, cwd: command[-1:])
    assert quick.main([]) == ["tests/mesh/test_model.py"]
    assert "model.py: 1 of 2 test files; make test runs all" in capfd.readouterr().out
