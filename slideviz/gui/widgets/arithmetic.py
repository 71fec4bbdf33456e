"""Parse numbers as people type them into a field: with a decimal comma, or as an expression."""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable

_ALLOWED = re.compile(r"[\d.eE+\-*/() ]+\Z")
"""The letters that an expression may have."""

_SIGNS: dict[type[ast.unaryop], Callable[[float], float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_OPERATIONS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def typed_number(text: str) -> float:
    """Return the value of a text such as ``2.5``, ``2,5`` or ``360/7 + 1``.

    Raises
    ------
    ValueError
        The text is not a number or an expression of ``+ - * / ( )``.
    """
    plain = text.strip().replace(",", ".")
    try:
        return float(plain)
    except ValueError:
        if not _ALLOWED.match(plain):
            raise
    try:
        return _value(ast.parse(plain, mode="eval").body)
    except (SyntaxError, ArithmeticError, RecursionError, MemoryError) as problem:
        raise ValueError(f"{text!r} is not a number") from problem


def _value(node: ast.expr) -> float:
    """Return the value of a node of the parsed expression; raise ValueError for other nodes."""
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]  # only digits came here
    if isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        return _SIGNS[type(node.op)](_value(node.operand))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_value(node.left), _value(node.right))
    raise ValueError("is not a number")
