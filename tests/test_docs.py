"""What the documentation shows is what the program does.

Blocks ``console`` of a page are run one after the other, in a folder of the page's own, and must
print what the page says (``...`` stands for anything). Between them blocks ``python`` run, and
blocks with a caption are written to the file that it names.
"""

import doctest
import inspect
import json
import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import slideviz as sv
from slideviz import cli
from slideviz.case.keys import KEYS
from slideviz.samples.table import write_sample

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BLOCK = re.compile(
    r"^```(console|python|\{code-block\} text\n:caption: .*?\n)\n(.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
COMMAND = re.compile(r"^\$ (.*(?:\\\n.*)*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE

EXAMPLES = sorted(path.name for path in DOCS.glob("examples/*.py"))
PAGES = sorted(
    str(path.relative_to(ROOT))
    for path in [ROOT / "README.md", *DOCS.rglob("*.md")]
    if BLOCK.search(path.read_text(encoding="utf-8"))
)


def run(command: list[str], folder: Path) -> str:
    """Return what a command prints; it finds this slideviz, and needs no screen."""
    found = dict(
        os.environ,
        PATH=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        PYTHONPATH=str(ROOT),
        PYTHONUNBUFFERED="1",
        MPLBACKEND="Agg",
        PYVISTA_OFF_SCREEN="true",
    )
    done = subprocess.run(
        command,
        cwd=folder,
        env=found,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=200,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    # The first command of all compiles, and says so.
    return re.sub(r"^slideviz: compiling .*\n", "", done.stdout, flags=re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_of_the_gallery_runs(name, tmp_path):
    run([sys.executable, str(DOCS / "examples" / name)], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_what_its_commands_print(page, tmp_path):
    python = ""
    for kind, text in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
        if kind == "python":
            python += text  # goes on with what stands before
            run([sys.executable, "-c", python], tmp_path)
            continue
        if kind != "console":
            (tmp_path / kind.split(":caption:")[1].strip()).write_text(text)
            continue
        commands = COMMAND.findall(text)
        assert commands, f"no command in {text!r}"
        for command, wanted in commands:
            got = run(["bash", "-c", command], tmp_path)
            alike = doctest.OutputChecker().check_output(wanted, got, FLAGS)
            assert alike or not wanted.strip(), f"$ {command}\n{got}"


@pytest.mark.slow
def test_the_commands_by_example_run_as_they_stand(tmp_path):
    page = (DOCS / "reference" / "index.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```sh\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    commands = block.splitlines()
    assert len(commands) > 20
    for command in commands:
        run(["bash", "-c", command], tmp_path)


def test_the_page_of_sweeps_has_what_sweep_json_holds(tmp_path):
    page = (DOCS / "how-to" / "sweep.md").read_text(encoding="utf-8")
    write_sample("passage", tmp_path, 12)
    case = sv.Case.read(tmp_path / "passage.cfg").change(steps=1)
    table = {"airfoil.translate.y": [0.01]}
    list(sv.sweep(case, table, workers=1, folder=tmp_path / "out"))
    found = json.loads((tmp_path / "out" / "sweep.json").read_text())
    assert {name for name in found if f"`{name}`" not in page} <= set(KEYS)
    assert {"slideviz", "mesh", "SLIDING_MODE"} <= set(found)


NAMES = [name for name in sv.__all__ if not name.startswith("_")]


def test_the_reference_of_python_has_every_public_name():
    page = (DOCS / "reference" / "python.rst").read_text(encoding="utf-8")
    assert {*NAMES} <= {*re.findall(r"^\.\. auto\w+:: (\w+)$", page, re.MULTILINE)}


@pytest.mark.parametrize("name", NAMES)
def test_examples_in_docstrings(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    thing = getattr(sv, name)
    tests = doctest.DocTestFinder(recurse=True).find(thing, name, globs={"sv": sv})
    if inspect.isfunction(thing):
        assert any(test.examples for test in tests), f"the docstring of {name} has no example"
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for test in tests:
        assert runner.run(test).failed == 0


def test_the_page_of_the_report_has_its_keys(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_sample("passage", tmp_path, 12)
    assert cli.run(["run", "passage.cfg", "-q", "--json", "report.json"]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    keys = set(report) | {
        f"{name}.{key}"
        for name in ("quality", "seconds", "node_counts")
        for key in report[name]
        if key != "undeformed"
    }
    page = (DOCS / "reference" / "report.md").read_text(encoding="utf-8")
    assert keys - {"quality", "seconds", "node_counts"} <= set(re.findall(r"`([a-z_.]+)`", page))


def test_the_page_of_exit_codes_has_them_all():
    page = (DOCS / "reference" / "exit-codes.md").read_text(encoding="utf-8")
    listed = {int(code) for code in re.findall(r"^\| (\d+) \|", page, re.MULTILINE)}
    names = vars(import_module("slideviz.cli.terminal"))
    named = {names[name] for name in names if name.isupper() and isinstance(names[name], int)}
    assert listed == named | {2, 143}  # of argparse, and of a signal
