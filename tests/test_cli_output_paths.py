"""No command writes over what it reads, nor two results into one file."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import pytest

from slideviz.cli import parser, run
from slideviz.cli.output_paths import input_paths
from slideviz.errors import MeshError
from slideviz.samples.table import write_sample
from slideviz.system.atomic import atomic_write, require_writable
from slideviz.system.file_checks import protected

ODD = "a\udcff"
"""A name that is not UTF-8."""
CASE = ["square.cfg", "--set", "STEPS=1"]
PLANE = ["--plane", "y=0.5"]


@pytest.fixture
def square(tmp_path: Path, monkeypatch) -> Path:
    write_sample("square", tmp_path)
    (tmp_path / "base.su2").write_bytes((tmp_path / "mesh.su2").read_bytes())
    (tmp_path / "link").symlink_to("mesh.su2")
    (tmp_path / "hard.csv").hardlink_to(tmp_path / "displacement.txt")
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def content(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize("folder", ["/", "."])
def test_a_mesh_is_not_written_to_a_folder(square, capsys, folder):
    assert run(["run", *CASE, "-o", folder]) == 1
    assert (
        f"{folder}: is a folder; expected the name of the mesh to write" in capsys.readouterr().err
    )


def test_names_need_not_be_utf_8(square):
    (square / f"{ODD}.su2").write_bytes((square / "mesh.su2").read_bytes())
    (square / f"{ODD}.cfg").write_bytes((square / "square.cfg").read_bytes())
    call = ["run", f"{ODD}.cfg", *CASE[1:], "--set", f"MESH_FILENAME={ODD}.su2", "-q"]
    more = ["--picture", f"{ODD}.png", "--picture-size", "100x100"]
    assert run([*call, "-o", f"{ODD}2.su2", *more]) == 0
    assert (square / f"{ODD}.png").exists()


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["run", *CASE, "-o", "sub/../mesh.su2"], r"is the input mesh \(mesh.su2\).*--force"),
        (["run", *CASE, "--json", "mesh.su2"], "mesh.su2 is the input mesh; choose another name"),
        (["run", *CASE, "--json", "./square.cfg"], "square.cfg is the case file"),
        (["run", *CASE, "--json", "square.cfg", "--force"], "square.cfg is the case file"),
        (["run", *CASE, "--history", "link"], r"link is the input mesh \(mesh.su2\)"),
        (["run", *CASE, "--history", "hard.csv"], r"a file of a motion \(displacement.txt\)"),
        (["run", *CASE, "--set", "MESH_OUT_FILENAME=mesh.su2"], "mesh.su2 is the input mesh"),
        (["info", "mesh.su2", "--json", "mesh.su2"], "mesh.su2 is the input mesh"),
        (["quality", "mesh.su2", "-o", "link/../mesh.su2"], "mesh.su2"),
        (
            ["quality", "mesh.su2", "--reference", "base.su2", "-o", "base.su2"],
            "base.su2 is the reference mesh",
        ),
        (["quality", "mesh.su2", "--case", "square.cfg", "--json", "square.cfg"], "the case file"),
        (["quality", "base.su2", "--case", "square.cfg", "--json", "mesh.su2"], "the input mesh"),
        (["section", "mesh.su2", *PLANE, "-o", "a.png", "--json", "mesh.su2"], "the input mesh"),
    ],
)
def test_inputs_are_not_written_over(square, capsys, argv, words):
    before = content(square)
    assert run(argv) == 1
    assert re.search(words, capsys.readouterr().err)
    assert content(square) == before


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--json", "a", "--history", "sub/../a"], "--json and --history both name sub/../a"),
        (["-o", "a.vtu", "--json", "a.vtu"], "-o and --json both name a.vtu"),
        (["--json", "square_deformed_qual.txt"], "GENERATE_QUALITY and --json both name"),
        (["--json", "square_deformed.su2"], "MESH_OUT_FILENAME and --json both name"),
        (["--steps-dir", "sub", "--json", "sub/mesh_1.su2"], "--json and --steps-dir both name"),
        (["--steps-dir", "sub", "-o", "./sub/mesh_1.su2"], "-o and --steps-dir both name"),
        (["--steps-dir", "new", "--json", "new"], "--json and --steps-dir both name"),
    ],
)
def test_results_do_not_go_to_one_file(square, capsys, argv, words):
    before = content(square)
    assert run(["run", *CASE, *argv]) == 1
    assert words in capsys.readouterr().err
    assert content(square) == before


def test_steps_do_not_replace_an_input(square, capsys):
    (square / "sub" / "mesh_1.su2").hardlink_to(square / "displacement.txt")
    before = content(square)
    assert run(["run", *CASE, "--steps-dir", "sub"]) == 1
    assert "mesh_1.su2 is a file of a motion (displacement.txt)" in capsys.readouterr().err
    assert content(square) == before


def test_comparison_and_film_spare_their_inputs(square, capsys):
    table = square / "out" / "compare.csv"
    table.parent.mkdir()
    (square / "displacement.txt").rename(table)
    text = (square / "square.cfg").read_text().replace("displacement.txt", "out/compare.csv")
    (square / "square.cfg").write_text(text)
    (square / "mesh.gif").write_bytes((square / "square.cfg").read_bytes())
    before = content(square)
    assert run(["compare", "square.cfg", "-o", "out", "--steps", "1", "--no-pictures"]) == 1
    assert run(["film", "mesh.gif", "-o", "./mesh.gif", "--force", "--steps", "1"]) == 1
    err = capsys.readouterr().err
    assert "out/compare.csv is a file of a motion" in err
    assert "mesh.gif is the case file" in err
    assert content(square) == before


def test_what_the_user_did_not_name_is_not_replaced_without_a_word(square, capsys):
    words = ["run", *CASE, "--steps-dir", "sub", "--json", "a.json"]
    assert run(words) == 0
    assert "there already" not in capsys.readouterr().err
    assert run(words) == 0
    note = capsys.readouterr().err
    assert note.count("\n") == 1
    for told in (
        "square_deformed.su2 (MESH_OUT_FILENAME)",
        "square_deformed_qual.txt (GENERATE_QUALITY)",
        "sub/mesh_1.su2 (--steps-dir)",
    ):
        assert told in note
    assert "a.json" not in note
    assert run([*words, "-o", "square_deformed.su2", "-q"]) == 0
    assert capsys.readouterr().err == ""


def path_options(name: str) -> set[str]:
    """Return what the arguments of a command are called that are paths."""
    calls = next(
        action
        for action in parser.command_parser([name])._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    return {action.dest for action in calls.choices[name]._actions if action.type is Path}


@pytest.mark.parametrize("name", parser.COMMANDS)
def test_every_path_of_every_command_is_known_as_read_or_written(name):
    given = argparse.Namespace(**{option: Path(option) for option in path_options(name)})
    read = {str(path) for path in input_paths(given)}
    assert path_options(name) - read <= {
        "output",
        "json",
        "history",
        "steps_dir",
        "steps_file",
        "picture",
    }


def test_nothing_that_writes_gets_round_it(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with protected(lambda: {path: "the input mesh"}):
        for other in (tmp_path / "b", tmp_path / "c"):
            other.unlink(missing_ok=True)
        (tmp_path / "b").hardlink_to(path)
        (tmp_path / "c").symlink_to("a")
        for name in "abc":
            with pytest.raises(MeshError, match="is the input mesh"):
                require_writable(tmp_path / name)
            with (
                pytest.raises(MeshError, match="is the input mesh"),
                atomic_write(tmp_path / name) as file,
            ):
                file.write(b"new")
        with atomic_write(path, replaces=path) as file:
            file.write(b"asked for")
    assert path.read_bytes() == b"asked for"
    with atomic_write(path) as file:
        file.write(b"later")
    assert path.read_bytes() == b"later"
