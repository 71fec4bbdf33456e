"""Inputs that `make fuzz` found a fault with, minimised: none has one any more."""

from pathlib import Path

import numpy as np
import pytest

from slideviz.cli import run
from tools.fuzz.damage import damaged
from tools.fuzz.judge import judged
from tools.fuzz.kinds import KINDS, write_base
from tools.fuzz.minimise import minimised
from tools.fuzz.plain_su2 import WrongError, plain_mesh

INPUTS = sorted((Path(__file__).parent / "fuzzed").iterdir())
"""Named ``KIND-what.ENDING``; blanks of the kind are ``_``."""


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    folder = tmp_path_factory.mktemp("base")
    write_base(folder)
    return folder


@pytest.mark.parametrize("path", INPUTS, ids=lambda path: path.name)
def test_no_fault_comes_back(path, base, tmp_path):
    kind = KINDS[path.name.partition("-")[0].replace("_", " ")]
    (tmp_path / "input").write_bytes(path.read_bytes())
    assert judged(kind, tmp_path / "input", base, alone=True).problem == ""


def test_an_input_that_is_right_has_no_fault_and_is_accepted(base, tmp_path):
    for name in ("su2", "keys", "sensitivities", "session"):
        (tmp_path / "input").write_bytes(KINDS[name].make(base)[0])
        verdict = judged(KINDS[name], tmp_path / "input", base)
        assert (verdict.problem, verdict.accepted) == ("", True)


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
    (tmp_path / "input").write_bytes(KINDS["su2"].make(base)[0])
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
