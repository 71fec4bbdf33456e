"""Restart files of SU2: a table of all points, as text or binary."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from slideviz.case.lines import read_text
from slideviz.errors import CaseError
from slideviz.mesh.model import FloatArray
from slideviz.system.file_checks import require_regular_file

MAGIC = 535532
"""The first number of SU2's binary restart files."""
NAME_BYTES = 33
"""Length of a column's name in these files."""


def read_restart(path: Path) -> tuple[list[str], FloatArray]:
    """Return the names of the columns of a restart, and its rows (n, c).

    Raises
    ------
    CaseError
        The file is cut off, or has a value that is not a number.
    """
    require_regular_file(path, CaseError)
    with path.open("rb") as file:
        binary = file.read(4) == np.int32(MAGIC).tobytes()
    return _binary(path) if binary else _csv(path)


def angle_sensitivity(path: Path) -> float | None:
    """Return the derivative with respect to the angle of attack in degrees, or None.

    SU2 notes it at the end of a restart in text: ``SENS_AOA= 0.1``.
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 10_000))
        notes = file.read().decode("latin-1").splitlines()
    words = [line.partition("=")[2].strip() for line in notes if line.startswith("SENS_AOA")]
    return float(words[-1]) if words and is_number(words[-1]) else None


def is_number(word: str) -> bool:
    """Return whether Python reads a word as a number."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def _csv(path: Path) -> tuple[list[str], FloatArray]:
    """Return the names of the columns and the rows of a restart in text."""
    text, _ = read_text(path, "file of sensitivities")
    head, _, body = text.partition("\n")
    names = [name.strip().strip('"').strip() for name in head.split(",")]
    lines = body.splitlines()
    while lines and not is_number(lines[-1].partition(",")[0].strip()):
        lines.pop()  # what SU2 notes at the end
    if not lines:
        raise CaseError(f"{path}: has no row of numbers; needed is one for each point")
    try:
        table = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
    except ValueError:
        table = np.empty((0, 0))
    if table.shape[1:] != (len(names),):
        rows = enumerate((line.split(",") for line in lines), start=2)
        line = next(k for k, row in rows if len(row) != len(names) or not all(map(is_number, row)))
        raise CaseError(
            f"{path}:{line}: needed is a number for each of the {len(names)} columns, separated by "
            "commas; decimals are written with a point"
        )
    return names, table


def _binary(path: Path) -> tuple[list[str], FloatArray]:
    """Return the names of the columns and the rows of a binary restart.

    Five ``int32``: 535532, columns, points and two more; a name of 33 bytes for each column; the
    numbers, point by point.
    """
    data = path.read_bytes()
    _, width, count = np.frombuffer(data[:12].ljust(12, b"\0"), np.int32).tolist()
    begin = 20 + NAME_BYTES * width
    if width < 1 or count < 0 or len(data) < begin + 8 * width * count:
        raise CaseError(f"{path}: is cut off: {width} columns of {count} points do not fit in it")
    names = [
        data[20 + NAME_BYTES * k : 20 + NAME_BYTES * (k + 1)].split(b"\0")[0].decode("latin-1")
        for k in range(width)
    ]
    table = np.frombuffer(data, np.float64, width * count, begin).reshape(count, width)
    return [name.strip().strip('"') for name in names], table
