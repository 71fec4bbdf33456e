"""Inputs that `make fuzz` found a fault with, minimised: none has one any more."""

import gzip
import shutil
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest

from slideviz.cli import run
from tools.fuzz.__main__ import Judge
from tools.fuzz.damage import damaged
from tools.fuzz.judge import Verdict, judged
from tools.fuzz.kinds import FOAM_FOLDERS, KINDS, PLAIN, damaged_file, write_base
from tools.fuzz.minimise import minimised
from tools.fuzz.plain_su2 import WrongError, plain_mesh

INPUTS = sorted((Path(__file__).parent / "fuzzed").iterdir())
"""Named ``KIND-what.ENDING``; blanks of the kind are ``_``."""


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz") / "base"
    write_base(folder)
    return folder


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_no_fault_comes_back(path, base, tmp_path):
    kind = KINDS[path.name.partition("-")[0].replace("_", " ")]
    (tmp_path / "input").write_bytes(path.read_bytes())
    assert judged(kind, tmp_path / "input", base, alone=True).problem == ""


def test_an_input_that_is_right_has_no_fault_and_is_accepted(base, tmp_path):
    for name in ("su2", "keys", "sensitivities", "session"):
        (tmp_path / "input").write_bytes(KINDS[name].make(base / PLAIN)[0])
        verdict = judged(KINDS[name], tmp_path / "input", base)
        assert (verdict.problem, verdict.accepted) == ("", True)


@pytest.mark.parametrize("name", [*FOAM_FOLDERS, "ugrid", "ugrid little", "msh text", "bdf"])
def test_meshes_of_other_programs_that_are_right_are_accepted(name, base, tmp_path):
    for content in KINDS[name].make(base / PLAIN):
        (tmp_path / "input").write_bytes(content)
        verdict = judged(KINDS[name], tmp_path / "input", base)
        assert (verdict.problem, verdict.accepted) == ("", True)


def test_damage_within_a_compressed_file_can_be_unpacked(base):
    rng = np.random.default_rng(0)
    contents = [one for one in KINDS["foam packed"].make(base / PLAIN) if b".gz\n" in one]
    found = [damaged_file(rng, contents, False).partition(b"\n")[2] for _ in range(20)]
    unpacked = [one for one in found if unpacks(one)]
    assert 8 < len(unpacked) < 20
    assert len(set(found)) > 15


def unpacks(content):
    try:
        return bool(gzip.decompress(content))
    except (OSError, EOFError, zlib.error):
        return False


def test_a_judge_goes_on_after_an_input_that_ends_it(base, tmp_path, monkeypatch):
    judge = Judge(tmp_path)
    shutil.copytree(base, tmp_path / "base")
    good = KINDS["su2"].make(base / PLAIN)[0]
    code = "import sys; sys.stdin.readline(); print('{}'); sys.exit(7)"
    command = subprocess.Popen
    with monkeypatch.context() as patch:
        patch.setattr(subprocess, "Popen", lambda words, **o: command([words[0], "-c", code], **o))
        patch.setattr(
            "tools.fuzz.__main__.Verdict", lambda *a, **k: Verdict(*(a or ("", "", True, 0.0)))
        )
        found = judge.verdicts([("su2", good), ("su2", good)])
    assert [one.problem for one in found] == ["", "crash: exit code 7"]
    assert [one.accepted for one in judge.verdicts([("su2", good), ("su2", b"")])] == [True, False]
    judge.end()


def broken(command, words):
    Path("out.su2").write_text("NDIME= 2\n")
    if command == "fails":
        raise ZeroDivisionError("no")
    return run(words)


@pytest.mark.parametrize(
    ("command", "words", "problem"),
    [("fails", [], "traceback: ZeroDivisionError"), ("ends", ["info", "none.su2"], "half file: ")],
)
def test_faults_are_noticed(base, tmp_path, monkeypatch, command, words, problem):
    monkeypatch.setattr("tools.fuzz.judge.run", lambda _: broken(command, words))
    (tmp_path / "input").write_bytes(KINDS["su2"].make(base / PLAIN)[0])
    assert problem in judged(KINDS["su2"], tmp_path / "input", base).problem


def test_inputs_are_made_as_small_as_their_fault_allows():
    content = b"a\nb\nfault here\nc\n" * 9
    assert minimised(content, lambda other: b"fault" in other, tries=500) == b"fault"


def test_damage_is_the_same_for_the_same_seed():
    def made(seed):
        rng = np.random.default_rng(seed)
        return [damaged(rng, b"NDIME= 2\nNPOIN= 3\n", [b"a= 1\n"], True) for _ in range(50)]

    assert made(1) == made(1) != made(2)
    assert len(set(made(1))) > 40


@pytest.mark.parametrize(
    "text", ["NDIME= 2\nNELEM= 1\n5 0 1 2\nNPOIN= 1\n0 0 0\n", "NPOIN= 2\n0 0\n", "NELEM= x\n"]
)
def test_the_plain_reader_refuses_what_is_wrong(text):
    with pytest.raises(WrongError, match=r"is|does not|too short"):
        plain_mesh(text)
