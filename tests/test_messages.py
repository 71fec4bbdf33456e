"""Messages, labels and tips say in plain words that a value is wrong and what is right instead."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "slideviz"
EXCEPTIONS: tuple[str, ...] = ()
"""Texts that may use one of the refused forms; there are none."""
REMEDIES = {
    re.compile(r"\b(?<!there )(is|are) no (?!longer\b|more\b)", re.IGNORECASE): (
        'write "is not a ..." instead of "is no ..."'
    ),
    re.compile(r"\b(is|are) none\b"): 'write "does not exist" or "is not one of ..."',
    re.compile(r""", as (in )?(?!SU2)([\d"'“(<{*]|[A-Z_]{2,}|\w+[.,_]\w|\w+ ?[<>=:])"""): (
        'write "e.g." or "such as" instead of "as" before an example'
    ),
}


def _texts(node: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and text of the strings in a tree, without docstrings; values are ``{}``."""
    match node:
        case ast.Expr(value=ast.Constant()):
            return
        case ast.Constant(value=str(text)):
            yield node.lineno, text
        case ast.JoinedStr(values=parts):
            texts = (part.value if isinstance(part, ast.Constant) else "{}" for part in parts)
            yield node.lineno, "".join(map(str, texts))
            for part in parts:
                if isinstance(part, ast.FormattedValue):
                    yield from _texts(part.value)
        case _:
            for child in ast.iter_child_nodes(node):
                yield from _texts(child)


def _faults(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and remedy of each text that uses a refused form."""
    for line, text in _texts(tree):
        if text not in EXCEPTIONS:
            yield from (
                (line, f"{remedy}: {text!r}")
                for form, remedy in REMEDIES.items()
                if form.search(text)
            )


def _tree(path: Path) -> ast.AST:
    """Return the tree of a module, or that of the values in a table of words."""
    text = path.read_text("utf-8")
    return ast.parse(text if path.suffix == ".py" else repr(tomllib.loads(text)))


def test_messages_need_no_second_reading():
    paths = sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.toml")])
    wrong = [
        f"{path.relative_to(PACKAGE)}:{line}: {remedy}"
        for path in paths
        for line, remedy in _faults(_tree(path))
    ]
    assert not wrong, "\n".join(wrong)


def test_tables_of_words_are_read_too():
    assert len(list(_texts(_tree(PACKAGE / "terms.toml")))) > 200


@pytest.mark.parametrize(
    "text",
    [
        "\"'x' is no whole number\"",
        'f"{a} and {b} are no pairs"',
        'f"names node {k}, which is none"',
        '"give a table, as designs.csv"',
        '"write a range, as 0.2,0.9"',
        '"a coordinate, as in z=0.5"',
        '"give markers, as BLADE,HUB"',
        'f"say which, as {name}"',
        "f\"{'is no table' if wrong else 1}\"",
    ],
)
def test_a_refused_form_is_noticed(text):
    assert len(list(_faults(ast.parse(f"f({text})")))) == 1


@pytest.mark.parametrize(
    "text",
    [
        '"there is no zone 3"',
        '"it is no longer there"',
        '"the upper side, as in SU2"',
        '"the grid, as it was read"',
        '"is not a number; write e.g. 0.5"',
    ],
)
def test_plain_messages_pass(text):
    assert not list(_faults(ast.parse(f"f({text})")))
    assert not list(_faults(ast.parse('def f():\n    """It is no message."""')))
