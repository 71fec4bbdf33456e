"""Records what users get: ``python -m tests.golden.record [PART ...]``, or ``make golden``.

Files that say the same as before stay as they are, so that git shows what changed.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.golden.alike import difference
from tests.golden.desk import Desk
from tests.golden.parts import PARTS

HERE = Path(__file__).parent
KEPT, NEW = HERE / "kept", HERE / "new"
"""What was recorded; and what differed from it in the last test."""


def produce(part: str, folder: Path, place: Path) -> None:
    """Put what users get now into a folder; ``place`` is an empty one to work in."""
    folder.mkdir(parents=True, exist_ok=True)
    with working_in(place):
        PARTS[part](Desk(folder))


@contextmanager
def working_in(place: Path) -> Iterator[None]:
    """Work in a folder, on a terminal that is nobody's."""
    before, at = dict(os.environ), Path.cwd()
    # Not what the user of this machine likes.
    os.environ |= {"COLUMNS": "80", "LINES": "24", "NO_COLOR": "1", "LC_ALL": "C.UTF-8"}
    os.environ["PYTHONPATH"] = str(HERE.parents[1])
    os.chdir(place)
    try:
        yield
    finally:
        os.chdir(at)
        os.environ.clear()
        os.environ.update(before)


def changes(kept: Path, new: Path) -> dict[str, str]:
    """Return in words how each file of a folder differs from the one that is kept."""
    names = {path.name for folder in (kept, new) if folder.is_dir() for path in folder.iterdir()}
    found = {}
    for name in sorted(names):
        if not (kept / name).exists():
            found[name] = "  is new"
        elif not (new / name).exists():
            found[name] = "  is not made any more"
        elif words := difference(kept / name, new / name):
            found[name] = words
    return found


def take(kept: Path, new: Path) -> dict[str, str]:
    """Put what differs in the place of what is kept, and return what that is."""
    found = changes(kept, new)
    kept.mkdir(parents=True, exist_ok=True)
    for name in found:
        if (new / name).exists():
            shutil.copyfile(new / name, kept / name)
        else:
            (kept / name).unlink()
    return found


def main(names: list[str]) -> None:
    """Record parts, or all, and print what changed."""
    for name in names or PARTS:
        with tempfile.TemporaryDirectory() as place, tempfile.TemporaryDirectory() as folder:
            produce(name, Path(folder), Path(place))
            found = take(KEPT / name, Path(folder))
        told = [f"{name}: {len(found)} changed" if found else f"{name}: as before"]
        told += [f" {file}\n{words}" for file, words in found.items()]
        sys.stdout.write("\n".join(told) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
