"""Count the tokens of slideviz/ by package, and fail above the budget in pyproject.toml.

A token is a name, an operator, a number, or a string that documents nothing: what a reader has to
take in. Comments, docstrings and line ends count nothing, so that no layout changes the number. In
a table (TOML, JSON) each key and each value is one, so that words that move into it still count.
The budget only falls; a commit that raises it says why.
"""

from __future__ import annotations

import io
import json
import sys
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LAYOUT = {tokenize.NEWLINE, tokenize.NL, tokenize.INDENT, tokenize.DEDENT, tokenize.COMMENT}
SILENT = LAYOUT | {tokenize.ENCODING, tokenize.ENDMARKER}
FSTRING_START = getattr(tokenize, "FSTRING_START", -1)  # from Python 3.12 on; one STRING before
FSTRING_END = getattr(tokenize, "FSTRING_END", -1)


def tokens_in(source: str) -> int:
    """Return the number of tokens of a module; a string that is a statement is a docstring."""
    count = 0
    depth = 0  # of interpolated strings
    statement: list[int] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.NEWLINE:
            if set(statement) != {tokenize.STRING}:
                count += len(statement)
            statement = []
        elif token.type == FSTRING_END:
            depth -= 1
        elif token.type == FSTRING_START:
            if depth == 0:
                statement.append(token.type)
            depth += 1
        elif token.type not in SILENT and depth == 0:
            statement.append(token.type)
    return count


def entries_in(table: object) -> int:
    """Return the number of keys and values of a table, at all depths."""
    if isinstance(table, dict):
        return len(table) + sum(map(entries_in, table.values()))
    return sum(map(entries_in, table)) if isinstance(table, list) else 1


def _entries_of_toml(source: str) -> int:
    return entries_in(tomllib.loads(source))


def _entries_of_json(source: str) -> int:
    return entries_in(json.loads(source))


def by_package(folder: Path) -> Counter[str]:
    """Return the number of tokens of each package and module directly in ``folder``."""
    counts: Counter[str] = Counter()
    readers = {".py": tokens_in, ".toml": _entries_of_toml, ".json": _entries_of_json}
    for path in sorted(folder.rglob("*.*")):
        if path.suffix in readers:
            count = readers[path.suffix](path.read_text(encoding="utf-8"))
            counts[path.relative_to(folder).parts[0]] += count
    return counts


def main() -> int:
    """Print the table; return 1 above the budget."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    budget = settings["tool"]["slideviz"]["token-budget"]
    counts = by_package(ROOT / "slideviz")
    rows = [f"{count:9,}  {name}" for name, count in counts.most_common()]
    rows.append(f"{counts.total():9,}  tokens, of a budget of {budget:,}")
    within = counts.total() <= budget
    if not within:
        rows.append("size: above the budget; take something away, or say why it must rise")
    sys.stdout.write("\n".join(rows) + "\n")
    return 0 if within else 1


if __name__ == "__main__":
    sys.exit(main())
