"""``tools/mutants.py`` makes faults and says which of them no test notices."""

import ast

import pytest

from tools import mutants

MODULE = '''"""A module."""

SIZE = 4096


@njit(**OPTIONS)
def clip(x: float, low: float = 0.0) -> float:
    """Return x, but at least ``low``."""
    if x < low:
        raise ValueError(f"{x - low}")
    return -x
'''
TEST = """
from slideviz.room.clip import clip

def test_clip():
    assert clip(2) == 2
    assert clip(-1) == 0
"""


@pytest.mark.parametrize(
    ("operator", "old", "new"),
    [
        ("boundary", "a < b", "a <= b"),
        ("comparison", "a in b", "a not in b"),
        ("arithmetic", "a + b", "a - b"),
        ("augmented", "a += b", "a -= b"),
        ("logical", "a and b", "a or b"),
        ("sign", "not a", "a"),
        ("number", "7", "8"),
        ("number", "0.0", "1.0"),
        ("number", "True", "False"),
        ("condition", "a if b else c", "c"),
        ("twin", "np.argmin(a)", "np.argmax(a)"),
        ("twin", "min(a)", "max(a)"),
        ("statement", "f(a)", "pass"),
        ("statement", "a[b] = c", "pass"),
    ],
)
def test_each_operator_makes_its_fault(operator, old, new):
    sources = {
        ast.unparse(ast.parse(one.source(old.encode())))
        for one in mutants.mutants_of(old, "x.py")
        if one.operator == operator
    }
    assert new in sources


def test_all_ten_operators_have_a_row_above():
    assert len(mutants.OPERATORS) == 10


def test_messages_decorators_sizes_and_types_have_no_faults():
    made = mutants.mutants_of(MODULE, "clip.py")
    assert {(one.operator, one.old) for one in made} == {
        ("boundary", "x < low"),
        ("comparison", "x < low"),
        ("condition", "x < low"),
        ("sign", "-x"),
    }
    never = next(one for one in made if one.operator == "condition")
    assert b"if (False):" in never.source(MODULE.encode())
    assert not mutants.mutants_of('"a" + b\n[a] + c\n', "x.py")


def test_callers_of_compiled_loops_are_compiled_anew(tmp_path):
    folder = tmp_path / "slideviz"
    folder.mkdir()
    (folder / "a.py").write_text("@njit()\ndef f(): ...\n")
    (folder / "b.py").write_text("from slideviz.a import f\n@njit()\ndef g(): ...\n")
    (folder / "c.py").write_text("from slideviz import b\n@njit()\ndef h(): ...\n")
    (folder / "d.py").write_text("import slideviz.a\n")
    callers = mutants.compiled_callers(tmp_path, "slideviz/a.py")
    assert [path.name for path in callers] == ["b.py", "c.py"]
    assert mutants.compiled_callers(tmp_path, "slideviz/d.py") == []


@pytest.mark.slow
def test_survivors_are_printed_with_the_share_that_was_killed(tmp_path, capsys):
    package = tmp_path / "slideviz" / "room"
    package.mkdir(parents=True)
    (package.parent / "__init__.py").touch()
    (package / "clip.py").write_text("def clip(x):\n    return x if x > 0 else 0\n")
    test = tmp_path / "tests" / "room" / "test_clip.py"
    test.parent.mkdir(parents=True)
    test.write_text(TEST)
    (tmp_path / "pyproject.toml").write_text('[tool.pytest.ini_options]\nmarkers = ["slow"]\n')
    assert mutants.main(["room", "--root", str(tmp_path), "--jobs=1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "5 of 5 mutants of room"
    assert lines[1:-1] == [
        "slideviz/room/clip.py:2: boundary: x > 0 -> (x >= 0)",
        "slideviz/room/clip.py:2: number: 0 -> (1)",
    ]
    assert lines[-1] == "3 of 5 killed (60 %)"
    test.write_text("def test(): assert False")
    assert mutants.main(["room", "--root", str(tmp_path), "--sample=1"]) == 1
    assert "1 of 5 mutants of room\nthe tests fail without any" in capsys.readouterr().out
