"""A displacement file as a text that the user edits: checked while typed, completed, written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slideviz.case.displacement import parse_displacements
from slideviz.case.lines import read_text
from slideviz.case.model import Case, Target, named
from slideviz.errors import CaseError
from slideviz.mesh.model import IntArray, Mesh
from slideviz.system.atomic import atomic_write

NAMED = Path("table")
"""Stands for the file in messages of `parse_displacements`; `TableRows.check` replaces it."""
LARGEST = 5_000_000
"""Most bytes of a file that can be edited by hand."""


@dataclass(frozen=True, eq=False)
class TableRows:
    """The nodes that a table of displacements may list."""

    of: str
    """Their boundaries, in words."""
    nodes: IntArray
    """(k,): the nodes, sorted."""
    shape: tuple[int, ...]
    """(n, d): shape of the points of the mesh."""

    @classmethod
    def on(cls, mesh: Mesh, case: Case, marker: Target) -> TableRows:
        """Return the rows for the boundaries of a motion; all moving ones where it is empty."""
        names = named(marker) or case.markers_with("moving")
        nodes = np.unique(np.concatenate([mesh.marker(name).nodes for name in names]))
        return cls(", ".join(names), nodes, mesh.points.shape)

    @property
    def heading(self) -> str:
        """Return the names of the columns, with blanks between."""
        return " ".join(["node", "dx", "dy", "dz"][: 1 + self.shape[1]])

    def check(self, text: str) -> str:
        """Return a sentence on how many nodes a table moves, and how far.

        Raises
        ------
        CaseError
            It has no rows, or mistakes; the message has the first one.
        """
        if not text.strip():
            raise CaseError(f"Type or paste rows: {self.heading}")
        try:
            read = parse_displacements(text, NAMED, self.nodes, self.shape, self.of)
        except CaseError as error:
            first, *others = str(error).replace(f"{NAMED}:", "Line ").splitlines()
            raise CaseError(f"{first} ({len(others)} more)" if others else first) from error
        moved = np.linalg.norm(read.vectors, axis=1)
        return (
            f"{np.count_nonzero(moved):,} of {len(self.nodes):,} nodes of {self.of} move, "
            f"by at most {moved.max():.4g}"
        )

    def fill(self, text: str) -> str:
        """Return a table with a row of zeros for each node that is not listed yet."""
        listed = set()
        for line in text.splitlines():
            word = line.replace(",", " ").replace(";", " ").split()[:1]
            if word and word[0].isdecimal():
                listed.add(int(word[0]))
        zeros = "\t0" * self.shape[1]
        rows = [f"{node}{zeros}" for node in self.nodes.tolist() if node not in listed]
        head = [f"% {self.heading}"] if not text.strip() else text.rstrip("\n").split("\n")
        return "\n".join([*head, *rows]) + "\n"


def write_table(path: Path, text: str, replaces: Path | None = None) -> None:
    """Write a table as a displacement file, whole or not at all.

    ``replaces`` is the only input file that may be overwritten: the one the table was read from.

    Raises
    ------
    CaseError
        It cannot be written.
    """
    with atomic_write(path, CaseError, replaces) as file:
        file.write(f"{text.rstrip()}\n".encode())


def table_text(path: Path) -> str:
    """Return the text of a displacement file; "" where there is no such file.

    Raises
    ------
    CaseError
        It is too large to be edited by hand, or cannot be read.
    """
    if not path.is_file():
        return ""
    size = path.stat().st_size
    if size > LARGEST:
        raise CaseError(
            f"{path}: the table has {size / 1e6:.0f} MB, too much to be edited here; write it with "
            "another program"
        )
    return read_text(path, "displacement file")[0]
