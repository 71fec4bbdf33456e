"""Where commands are run as a user runs them, and what they give is written down."""

from __future__ import annotations

import csv
import json
import re
import shlex
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from hashlib import sha256
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import slideviz
from slideviz.cli import run as command
from tests.golden.drawings import facts
from tools.shots import shrink

DIGITS = 12
"""Significant digits of the numbers that are kept."""

BLOCKS = 8
"""Parts of a mesh whose coordinates are summed up for themselves."""

CHANCE = ("second", "condition")
"""Words in the heads of columns whose numbers are others in every run."""

_LONG = re.compile(r"-?\d+\.\d+(?:e[-+]\d+)?")
_SECONDS = re.compile(r"\b\d+\.\d+ s\b( \(.*\))?")


class Desk:
    """Runs commands in the current folder, and keeps what they give in ``folder``.

    What is written down goes into one text, until ``close`` names the file for it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.lines: list[str] = []

    def run(self, *words: str) -> int:
        """Run ``slideviz`` with these words, write down what it says, and return its exit code."""
        out, err = StringIO(), StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            code = command(words)
        self.say(f"$ slideviz {shlex.join(words)}")
        if out.getvalue().startswith("{"):
            self.lines += flat(json.loads(out.getvalue()))
        else:
            self.say("\n".join(untimed(out.getvalue().splitlines())))
        # A loop is compiled once in a while, wherever it is needed first.
        told = [line for line in err.getvalue().splitlines() if "compiling loops" not in line]
        self.lines += [tidy(f"! {line}") for line in told]
        self.lines += [f"exit code {code}", ""]
        return code

    def say(self, text: str) -> None:
        """Write down a text."""
        self.lines += [tidy(line) for line in text.splitlines()]

    def file(self, name: str) -> None:
        """Write down what is in a file: a mesh, a table, a drawing or a text."""
        path = Path(name)
        self.say(f"{name}:")
        if path.suffix == ".su2":
            lines = list(mesh_lines(path.read_text()))
        elif path.suffix in (".svg", ".pdf"):
            lines = facts(path)
        elif path.suffix == ".csv":
            lines = steady(path.read_text())
        elif path.suffix == ".json":
            lines = list(flat(json.loads(path.read_text())))
        else:
            lines = path.read_text().splitlines()
        self.lines += [f"  {tidy(line)}".rstrip() for line in lines]

    def picture(self, path: Path | str, name: str = "", part: float = 1.0) -> None:
        """Keep a picture; ``part`` is the size that it gets."""
        with Image.open(path) as image:
            keep_picture(image, self.folder / f"{name or Path(path).stem}.png", part)

    def close(self, name: str) -> None:
        """Put what was written down into a file."""
        (self.folder / f"{name}.txt").write_text("\n".join(self.lines) + "\n", "utf-8")
        self.lines = []


def keep_picture(image: Image.Image, path: Path, part: float = 1.0) -> None:
    """Write a picture as a small PNG file."""
    drawn = image.convert("RGB")
    if part != 1.0:
        size = (round(part * drawn.width), round(part * drawn.height))
        drawn = drawn.resize(size, Image.Resampling.LANCZOS)
    drawn.save(path)
    shrink(path)


def tidy(line: str) -> str:
    """Return a line without seconds and version, whose numbers have no digits of rounding."""
    text = line.replace(slideviz.__version__, "VERSION") if "slideviz" in line else line
    return _LONG.sub(lambda found: shorter(found[0]), _SECONDS.sub("... s", text)).rstrip()


def shorter(number: str) -> str:
    """Return a number with as many digits as are kept."""
    digits = number.partition("e")[0].lstrip("-0.").replace(".", "")
    return number if len(digits) <= DIGITS else f"{float(number):.{DIGITS}g}"


def flat(value: Any, name: str = "") -> Iterator[str]:
    """Yield a line for each value of a JSON report, with the way to it, without the seconds."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if "seconds" not in key:
                yield from flat(inner, f"{name}.{key}" if name else key)
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for number, inner in enumerate(value):
            yield tidy(f"{name}[{number}] = {', '.join(flat(inner))}")
    else:
        yield tidy(f"{name} = {json.dumps(value)}")


def steady(table: str) -> list[str]:
    """Return the rows of a table with commas, without those columns that no two runs share."""
    rows = list(csv.reader(table.splitlines()))
    left = [at for at, head in enumerate(rows[0]) if not any(word in head for word in CHANCE)]
    return [" , ".join(row[at] for at in left) for row in rows]


def untimed(lines: list[str]) -> list[str]:
    """Return lines in which the last column of a table has gone, if it has seconds."""
    width = next((len(line) for line in lines if line.endswith(" seconds")), 0)
    return [line[: -len("seconds")] if len(line) == width else line for line in lines]


def mesh_lines(text: str) -> Iterator[str]:
    """Yield what a mesh in SU2's format is: a checksum of all but the coordinates, and their sums.

    Bits of coordinates depend on the processor, so sums are kept, over parts of the nodes in their
    order. Each node has a weight of its own, so that an exchange of two is seen, too. Lengths are
    parts of the mesh's extent.
    """
    lines = text.splitlines()
    at, count = next(
        (row, int(line.split("=")[1].split()[0]))
        for row, line in enumerate(lines)
        if line.startswith("NPOIN")
    )
    dim = int(next(line for line in lines if line.startswith("NDIME")).split("=")[1])
    nodes = [line.split() for line in lines[at + 1 : at + 1 + count]]
    points = np.array([row[:dim] for row in nodes], dtype=float)
    numbers = [" ".join(row[dim:]) for row in nodes]
    rest = [" ".join(line.split()) for line in lines[:at] + numbers + lines[at + 1 + count :]]
    checksum = sha256("\n".join(rest).encode()).hexdigest()[:16]
    low, high = points.min(axis=0), points.max(axis=0)
    extent = (high - low).max()
    yield f"{count} nodes, {len(lines)} lines; all but coordinates has the checksum {checksum}"
    yield f"from {words(low)} to {words(high)}"
    weights = 1.0 + np.arange(count) * 0.6180339887498949 % 1.0
    for part in np.array_split(np.arange(count), min(count, BLOCKS)):
        sums = (weights[part, None] * points[part] / extent).mean(axis=0)
        yield f"nodes {part[0]} to {part[-1]}: {words(sums)}"


def words(values: np.ndarray) -> str:
    """Return numbers with commas."""
    return ", ".join(f"{value + 0.0:.{DIGITS}f}" for value in values)
