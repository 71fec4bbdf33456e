"""A line says one thing: what packs several into one is refused in the package."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "slideviz"
EXCEPTIONS: tuple[str, ...] = ()
"""Places, as ``mesh/model.py:12``, that are allowed to; there are none."""
TRUTHS = ("bool", "isinstance", "any", "all")


def _are_unrelated(targets: list[ast.expr], values: list[ast.expr]) -> bool:
    """Return whether no value reads what an assignment before it changes."""
    for place, target in enumerate(targets[:-1], 1):
        read = {ast.unparse(node) for one in values[place:] for node in ast.walk(one)}
        if any(ast.unparse(one) in read for one in _changed(target)):
            return False
    return True


def _changed(target: ast.expr) -> Iterator[ast.expr]:
    """Yield the variables, attributes and containers that assigning ``target`` changes."""
    if isinstance(target, ast.Tuple | ast.List):
        for one in target.elts:
            yield from _changed(one)
    elif isinstance(target, ast.Subscript):
        yield from _changed(target.value)
    else:
        yield target


def _is_condition(node: ast.expr) -> bool:
    if isinstance(node, ast.Call):
        return getattr(node.func, "id", "") in TRUTHS
    negation = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
    return negation or isinstance(node, ast.Compare | ast.BoolOp)


def _is_text_or_list(node: ast.expr) -> bool:
    is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return is_text or isinstance(node, ast.JoinedStr | ast.List | ast.Tuple)


def _faults(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the line and the remedy of each place that packs."""
    for node in ast.walk(tree):
        match node:
            case ast.Assign(targets=[ast.Tuple() | ast.List()], value=ast.GeneratorExp()):
                yield node.lineno, "unpacks a generator; write an assignment for each variable"
            case ast.Assign(targets=[ast.Tuple() | ast.List()], value=ast.ListComp()):
                yield node.lineno, "unpacks a list; write an assignment for each variable"
            case ast.Assign(
                targets=[ast.Tuple(elts=targets) | ast.List(elts=targets)],
                value=ast.Tuple(elts=values) | ast.List(elts=values),
            ):
                starred = any(isinstance(one, ast.Starred) for one in [*targets, *values])
                if not starred and _are_unrelated(targets, values):
                    yield node.lineno, "assigns unrelated values as a tuple; write a line for each"
            case ast.BinOp(op=ast.Mult(), left=left, right=right):
                for one, other in ((left, right), (right, left)):
                    if _is_text_or_list(one) and _is_condition(other):
                        yield node.lineno, "multiplies by a condition; write `... if ... else ...`"
            case ast.IfExp():
                inner = [one for part in ast.iter_child_nodes(node) for one in ast.walk(part)]
                if any(isinstance(one, ast.IfExp) for one in inner):
                    yield node.lineno, "has a conditional in a conditional; write if statements"


def test_a_line_says_one_thing():
    wrong = [
        f"{place}: {remedy}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for line, remedy in _faults(ast.parse(path.read_text("utf-8")))
        if (place := f"{path.relative_to(PACKAGE)}:{line}") not in EXCEPTIONS
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "packed",
    [
        "a, b = 1, f(x)",
        "self.a, self.b = 1, 2",
        "self.a, self.b = x, f(self.c)",
        "x[i], y[i] = a.b, c[i]",
        "a, a.b = f(), g()",
        "a, (b, c) = x, f(y)",
        "a, b = (f(x) for x in (u, v))",
        "*a, b = [f(x) for x in u]",
        "t = 's' * (n > 1)",
        "t = (not x) * [y]",
        "t = f'{x}' * bool(x)",
        "t = 1 if a else 2 if b else 3",
        "t = f(1 if a else 2) if b else 3",
    ],
)
def test_packing_is_noticed(packed):
    assert len(list(_faults(ast.parse(packed)))) == 1


@pytest.mark.parametrize(
    "plain",
    [
        "a, b = b, a",
        "a, b = b, a + b",
        "a, b = f(x)",
        "a, b = map(f, x)",
        "x[0], x[1] = x[1], x[0]",
        "self.a, self.b = self.b, self.a",
        "(a, b), c = x, a + y",
        "for a, b in ((1, 2),): pass",
        "t = '-' * width",
        "t = [0] * len(x)",
        "t = 1 if a else 2",
    ],
)
def test_what_says_one_thing_passes(plain):
    assert not list(_faults(ast.parse(plain)))
