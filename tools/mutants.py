"""``python -m tools.mutants ROOM``: small faults that the tests of a package do not notice.

A mutant is the package with one fault: a comparison turned, a term subtracted instead of added.
Its tests (``tests/ROOM``, those that import the changed module first) run in a copy of the tree
until one fails. Where all pass, the mutant survives: either its line needs another test, or the
fault changes nothing that anyone could see. Mutants that run for too long count as killed.

Compiled loops keep their machine code on disk, and Numba does not look whether a loop that they
call has changed: modules that import the changed one, directly or not, are compiled anew.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from tools.quick import dotted, imported

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("slideviz", "tests", "tools", "sample_meshes", "pyproject.toml")
NOT_COPIED = shutil.ignore_patterns("golden", "benchmarks")
PYTEST = ("-m", "pytest", "-q", "-x", "-m", "not slow", "-p", "no:cacheprovider", "--no-xvfb")

BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
OPPOSITE = {
    ast.Lt: ast.GtE,
    ast.Gt: ast.LtE,
    ast.Eq: ast.NotEq,
    ast.Is: ast.IsNot,
    ast.In: ast.NotIn,
}
OPPOSITE |= {other: one for one, other in OPPOSITE.items()}
ARITHMETIC = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
TWINS = {
    "min": "max",
    "minimum": "maximum",
    "argmin": "argmax",
    "any": "all",
    "sin": "cos",
    "floor": "ceil",
    "zeros": "ones",
}
TWINS |= {other: one for one, other in TWINS.items()}


@dataclass(frozen=True)
class Mutant:
    """One fault: the text between two places of a module, and what replaces it."""

    module: str
    line: int
    begin: int
    end: int
    operator: str
    old: str
    new: str

    def source(self, original: bytes) -> bytes:
        """Return the module with the fault."""
        return original[: self.begin] + self.new.encode() + original[self.end :]

    def __str__(self) -> str:
        words = [" ".join(text.split())[:70] for text in (self.old, self.new)]
        return f"{self.module}:{self.line}: {self.operator}: {words[0]} -> {words[1]}"


def boundary(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a comparison that treats equality otherwise."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in BOUNDARY:
        yield ast.Compare(
            node.left, [BOUNDARY[type(node.ops[0])](), *node.ops[1:]], node.comparators
        )


def comparison(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a comparison that is turned."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OPPOSITE:
        yield ast.Compare(
            node.left, [OPPOSITE[type(node.ops[0])](), *node.ops[1:]], node.comparators
        )


def arithmetic(node: ast.AST) -> Iterator[ast.AST]:
    """Yield an expression with another arithmetic operator; texts keep theirs."""
    texts = (ast.JoinedStr, ast.List, ast.Tuple)
    if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        sides = (node.left, node.right)
        if not any(isinstance(side, texts) or _is(side, str) for side in sides):
            yield ast.BinOp(node.left, ARITHMETIC[type(node.op)](), node.right)


def augmented(node: ast.AST) -> Iterator[ast.AST]:
    """Yield an assignment such as ``a += b`` with another operator."""
    if isinstance(node, ast.AugAssign) and type(node.op) in ARITHMETIC:
        yield ast.AugAssign(node.target, ARITHMETIC[type(node.op)](), node.value)


def logical(node: ast.AST) -> Iterator[ast.AST]:
    """Yield ``or`` for ``and``, and the other way round."""
    if isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield ast.BoolOp(other, node.values)


def sign(node: ast.AST) -> Iterator[ast.AST]:
    """Yield an expression without its ``-``, ``not`` or ``~``."""
    if isinstance(node, ast.UnaryOp):
        yield node.operand


def number(node: ast.AST) -> Iterator[ast.AST]:
    """Yield another number: one more, twice as much, or the other truth."""
    if _is(node, bool):
        yield ast.Constant(not node.value)
    elif _is(node, int):
        yield ast.Constant(node.value + 1)
    elif _is(node, float):
        yield ast.Constant(node.value * 2 or 1.0)


def condition(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a condition that never holds, in place of that of a branch or loop."""
    if isinstance(node, ast.IfExp):
        yield node.orelse
    elif isinstance(node, ast.If | ast.While):
        yield ast.Constant(False)


def twin(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the call of a function that is easily mistaken for it."""
    if isinstance(node, ast.Call):
        name = node.func
        if isinstance(name, ast.Name) and name.id in TWINS:
            yield ast.Call(ast.Name(TWINS[name.id]), node.args, node.keywords)
        elif isinstance(name, ast.Attribute) and name.attr in TWINS:
            yield ast.Call(ast.Attribute(name.value, TWINS[name.attr]), node.args, node.keywords)


def statement(node: ast.AST) -> Iterator[ast.AST]:
    """Yield nothing for a call whose result nobody uses, and for an assignment to an element."""
    is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    is_element = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript)
    if is_call or is_element:
        yield ast.Pass()


OPERATORS: tuple[Callable[[ast.AST], Iterator[ast.AST]], ...] = (
    *(boundary, comparison, arithmetic, augmented, logical),
    *(sign, number, condition, twin, statement),
)


def _is(node: ast.AST, kind: type) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) is kind


def _mutable(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the parts of a module that compute; not types, messages, decorators and sizes."""
    yield node
    match node:
        case ast.Raise() | ast.JoinedStr() | ast.Assert():
            parts: list[ast.AST] = []
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            parts = []
        case ast.Assign(value=ast.Constant() | ast.BinOp() | ast.UnaryOp()) if node.col_offset == 0:
            parts = []  # a size or a tolerance
        case ast.AnnAssign():
            parts = [node.value] if node.value else []
        case ast.FunctionDef() | ast.ClassDef():
            parts = list(node.body)
        case _:
            parts = list(ast.iter_child_nodes(node))
    for part in parts:
        yield from _mutable(part)


def mutants_of(source: str, module: str) -> list[Mutant]:
    """Return all mutants of a module's text."""
    content = source.encode()
    starts = [0]
    for line in content.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    mutants = []
    for node in _mutable(ast.parse(source)):
        for operator in OPERATORS:
            for changed in operator(node):
                place = node.test if isinstance(node, ast.If | ast.While) else node
                begin = starts[place.lineno - 1] + place.col_offset
                end = starts[place.end_lineno - 1] + place.end_col_offset
                old = content[begin:end].decode()
                new = ast.unparse(changed)
                new = new if isinstance(changed, ast.stmt) else f"({new})"
                mutants.append(
                    Mutant(module, place.lineno, begin, end, operator.__name__, old, new)
                )
    return mutants


def compiled_callers(root: Path, module: str) -> list[Path]:
    """Return modules with compiled loops that call, directly or not, those of ``module``."""
    compiled = [path for path in (root / "slideviz").rglob("*.py") if "@njit" in path.read_text()]
    names = {path: imported(path) for path in compiled}
    reached = {dotted(module)} if root / module in names else set()
    callers: list[Path] = []
    while new := [path for path in names if path not in callers and names[path] & reached]:
        callers += new
        reached |= {dotted(str(path.relative_to(root))) for path in new}
    return callers


def tests_of(root: Path, room: str, module: str) -> list[str]:
    """Return the test files of a package, those that import ``module`` first."""
    paths = sorted((root / "tests" / room).rglob("test_*.py"))
    paths.sort(key=lambda path: dotted(module) not in imported(path))
    return [str(path.relative_to(root)) for path in paths]


def copy_tree(source: Path, target: Path) -> None:
    """Copy what tests need, with compiled loops."""
    for name in COPIED:
        if (source / name).is_dir():
            shutil.copytree(source / name, target / name, ignore=NOT_COPIED)
        elif (source / name).exists():
            shutil.copy2(source / name, target / name)


def passes(tree: Path, tests: Sequence[str], seconds: float) -> bool:
    """Return whether the tests pass in a copy of the tree within that time."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    command = [sys.executable, *PYTEST, *tests]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(
        command, cwd=tree, env=environment, start_new_session=True, **quiet
    ) as run:
        try:
            return run.wait(seconds) == 0
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            return False


def survives(mutant: Mutant, base: Path, room: str, seconds: float) -> bool:
    """Return whether all tests of the package pass with the fault."""
    with tempfile.TemporaryDirectory(dir=base.parent) as folder:
        tree = Path(folder)
        copy_tree(base, tree)
        path = tree / mutant.module
        path.write_bytes(mutant.source(path.read_bytes()))
        for caller in compiled_callers(tree, mutant.module):
            caller.touch()
        return passes(tree, tests_of(tree, room, mutant.module), seconds)


def main(argv: Sequence[str]) -> int:
    """Print the mutants that survive, and the share that was killed."""
    parser = argparse.ArgumentParser(prog="make mutants", description=__doc__.partition("\n")[0])
    parser.add_argument("room", help="a package: rbf, mesh, solver")
    parser.add_argument("--only", default="", metavar="TEXT", help="modules with it in their path")
    parser.add_argument("--sample", type=int, metavar="N", help="this many, drawn at random")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--root", type=Path, default=ROOT, help="the clone")
    options = parser.parse_args(argv)
    mutants = [
        mutant
        for path in sorted((options.root / "slideviz" / options.room).rglob("*.py"))
        if options.only in (module := str(path.relative_to(options.root)))
        for mutant in mutants_of(path.read_text("utf-8"), module)
    ]
    count = len(mutants)
    if options.sample is not None and options.sample < count:
        mutants = random.Random(options.seed).sample(mutants, options.sample)
    _say(f"{len(mutants)} of {count} mutants of {options.room}")
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(options.jobs) as pool:
        base = Path(scratch) / "base"
        base.mkdir()
        copy_tree(options.root, base)
        begin = monotonic()
        if not passes(base, tests_of(base, options.room, ""), 3600):
            _say("the tests fail without any fault")
            return 1
        seconds = 60 + 3 * (monotonic() - begin)
        survived = pool.map(lambda one: survives(one, base, options.room, seconds), mutants)
        survivors = 0
        for mutant, alive in zip(mutants, survived, strict=True):
            survivors += alive
            if alive:
                _say(str(mutant))
    killed = len(mutants) - survivors
    _say(f"{killed} of {len(mutants)} killed ({100 * killed / max(len(mutants), 1):.0f} %)")
    return 0


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
