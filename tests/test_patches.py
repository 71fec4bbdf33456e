"""What a test replaces in a module is looked up there: else the test would run without it."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda


def _imports(tree: ast.AST) -> dict[str, str]:
    """Return the dotted names of what a module imports, by their names in it."""
    names = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {a.asname: a.name for a in node.names if a.asname}
            names |= {a.name.split(".")[0]: a.name.split(".")[0] for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {a.asname or a.name: f"{node.module}.{a.name}" for a in node.names}
    return names


def _within_functions(node: ast.AST) -> Iterator[ast.AST]:
    """Yield all that is in functions, each once; defaults and decorators are read before."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, FUNCTIONS):
            body = child.body if isinstance(child.body, list) else [child.body]
            yield from (inner for part in body for inner in ast.walk(part))
        else:
            yield from _within_functions(child)


def _read_late(tree: ast.AST, module: str) -> Iterator[str]:
    """Yield the dotted names that functions of a module look up when they are called."""
    imports = _imports(tree)
    for node in _within_functions(tree):
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{a.name}" for a in node.names)
        elif isinstance(node, ast.Name):
            yield f"{module}.{node.id}"
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield f"{imports.get(node.value.id)}.{node.attr}"


def _patched(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and dotted name of what a test replaces with ``setattr`` of a patch."""
    imports = _imports(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "setattr":
            place, name, *_ = node.args
            if isinstance(place, ast.Constant):
                yield node.lineno, place.value
            elif isinstance(place, ast.Name) and isinstance(name, ast.Constant):
                yield node.lineno, f"{imports.get(place.id)}.{name.value}"


TEXTS = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts): path.read_text(encoding="utf-8")
    for folder in ("slideviz", "tools")
    for path in (ROOT / folder).rglob("*.py")
}


@cache
def _names_of(module: str) -> frozenset[str]:
    return frozenset(_read_late(ast.parse(TEXTS[module]), module.removesuffix(".__init__")))


def _is_looked_up(name: str) -> bool:
    """Return whether a function looks up a name in its module, or as an attribute of it."""
    module, _, last = name.rpartition(".")
    of_it = [one for one in (module, f"{module}.__init__") if one in TEXTS]
    others = (one for one, text in TEXTS.items() if last in text)
    return not of_it or any(name in _names_of(one) for one in (*of_it, *others))


def _without_effect(source: str) -> list[int]:
    """Return the lines where a name of a module is replaced that no function looks up there."""
    if "setattr(" not in source:
        return []
    return [line for line, name in _patched(ast.parse(source)) if not _is_looked_up(name)]


def test_what_a_test_replaces_is_looked_up_there():
    found = {
        str(path.relative_to(ROOT)): lines
        for path in sorted((ROOT / "tests").rglob("*.py"))
        if (lines := _without_effect(path.read_text(encoding="utf-8")))
    }
    assert found == {}, "replace them in the module that uses them"


@pytest.mark.parametrize(
    ("source", "lines"),
    [
        ("patch.setattr('slideviz.cli.film', 1)", [1]),
        ("from slideviz import cli\n\npatch.setattr(cli, 'x', 1)", [3]),
        ("import slideviz.cli as c\npatch.setattr(c, 'parse', 1)\npatch.setattr(c, 'x', 1)", [3]),
        ("patch.setattr(window, 'update', 1)\npatch.setattr(window.store, 'x', 1)", []),
    ],
)
def test_what_has_no_effect_is_noticed(source, lines):
    assert _without_effect(source) == lines
