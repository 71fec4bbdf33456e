"""Check that a tag may be published: ``python -m tools.release v0.1.0``.

The version is written in `slideviz/__init__.py` alone. CITATION.cff repeats it, and CHANGELOG.md
has a heading with it and its date.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def faults(tag: str, root: Path = ROOT) -> list[str]:
    """Return what keeps a tag from being published."""
    texts = {
        name: (root / name).read_text(encoding="utf-8")
        for name in ("slideviz/__init__.py", "CITATION.cff", "CHANGELOG.md")
    }
    (version,) = re.findall(r'^__version__ = "(.+)"$', texts["slideviz/__init__.py"], re.MULTILINE)
    found = []
    if tag != f"v{version}":
        found.append(f"the tag is {tag}, and __version__ is {version}; tag v{version}")
    if f"\nversion: {version}\n" not in texts["CITATION.cff"]:
        found.append(f"CITATION.cff has another version; write version: {version}")
    heading = re.search(r"^## .*$", texts["CHANGELOG.md"], re.MULTILINE)
    newest = heading[0] if heading else "no heading"
    if not re.fullmatch(rf"## \[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d", newest):
        words = f"write e.g. ## [{version}] - 2026-12-01"
        found.append(f"the newest heading of CHANGELOG.md is {newest!r}; {words}")
    return found


if __name__ == "__main__":
    wrong = faults(sys.argv[1])
    sys.stdout.writelines(f"release: {line}\n" for line in wrong)
    sys.exit(1 if wrong else 0)
