"""``python -m tools.quick``: run the tests of what changed since the last commit.

Tests of a module have its name, or import it. Where none does, as with the inner modules of a
package, those of the modules that import it are taken. Tests in the folder of the package come
alone where there are any, and of many only the first: ``make test`` runs all.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTEST = ("-m", "pytest", "-q", "-m", "not slow")
MOST = 8
"""Test files of one changed file; a module that everything uses has more than a hundred."""


@cache
def imported(path: Path) -> frozenset[str]:
    """Return the dotted names that a module imports, with and without the names in modules."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(names)


def dotted(module: str) -> str:
    """Return the name under which ``slideviz/mesh/model.py`` is imported."""
    return module.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def changed_files(root: Path, since: str) -> list[str]:
    """Return the Python files that differ from a commit, and new ones, relative to the root."""
    commands = (
        ["diff", "--name-only", "--diff-filter=d", since],
        ["ls-files", "--others", "--exclude-standard"],
    )
    lines = [
        line
        for command in commands
        for line in subprocess.check_output(["git", *command], cwd=root, text=True).splitlines()
    ]
    return sorted(line for line in lines if line.endswith(".py"))


def tests_of(root: Path, file: str) -> list[str]:
    """Return the test files of a file, the closest first: itself if it is one."""
    if Path(file).name.startswith("test_"):
        return [file]
    tests = _files(root, "tests", "test_*.py")
    modules = _files(root, "slideviz", "*.py")
    room = Path(file).with_suffix("").parts[1]
    names = {dotted(file)}
    seen: set[str] = set()
    while names:
        named = {test for test in tests if _is_named(test, names)}
        tested = [test for test in tests if test in named or names & imported(root / test)]
        own = [test for test in tested if test.startswith(f"tests/{room}/")]
        if tested:
            return sorted(own or tested, key=lambda test: test not in named)
        seen |= names
        names = {dotted(one) for one in modules if names & imported(root / one)} - seen
    return [test for test in tests if test.startswith((f"tests/{room}/", f"tests/test_{room}"))]


def _files(root: Path, folder: str, pattern: str) -> list[str]:
    return sorted(str(path.relative_to(root)) for path in (root / folder).rglob(pattern))


def _is_named(test: str, names: set[str]) -> bool:
    """Return whether ``tests/gui/test_motions.py`` is of ``slideviz.gui.panels.motions``."""
    *folders, stem = Path(test).with_suffix("").parts[1:]
    places = [name.split(".") for name in names]
    return any(
        stem == f"test_{place[-1]}" and folders == place[1 : 1 + len(folders)] for place in places
    )


def main(argv: Sequence[str]) -> int:
    """Print which tests there are, and run them."""
    parser = argparse.ArgumentParser(prog="make quick", description=__doc__.partition("\n")[0])
    parser.add_argument("--since", default="HEAD", metavar="COMMIT", help="files changed since it")
    options, more = parser.parse_known_args(argv)
    tests: dict[str, None] = {}
    for file in changed_files(ROOT, options.since):
        found = tests_of(ROOT, file)
        if len(found) > MOST:
            sys.stdout.write(f"{file}: {MOST} of {len(found)} test files; make test runs all\n")
        tests |= dict.fromkeys(found[:MOST])
    if not tests:
        sys.stdout.write("no tested file has changed\n")
        return 0
    sys.stdout.write(" ".join(tests) + "\n")
    sys.stdout.flush()
    parallel = ["-n2", "--dist=loadfile"] if len(tests) > 1 else []
    return subprocess.call([sys.executable, *PYTEST, *parallel, *more, *tests], cwd=ROOT)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
