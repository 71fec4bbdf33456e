"""Cases with which RBF-SliDe, the thesis's program, was timed: read from ``../shared``.

They are no part of the project; where they are absent, the benchmarks that need them are
skipped.
"""

from __future__ import annotations

import csv
import functools
import lzma
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import slideviz as sv
from slideviz.case.displacement import read_displacements
from slideviz.case.model import Case
from slideviz.case.motions.file import FromFile
from slideviz.rbf.reduction import Reduction

SHARED = Path(__file__).parents[3] / "shared"
MESHES = SHARED / "meshes" / "thesis"
TABLE = SHARED / "reference" / "rbf_slide.csv"
GROUP = "greedy rows of RBF-SliDe"

FILES = {
    "square_200_severe": ("square_200.su2", "square_200_severe.txt", "translational"),
    "hexa_25_severe": ("hexa_25.su2", "hexa_25_severe.txt", "translational"),
    "cylindrical_25": ("cylindrical_25.su2", "cylindrical_25_def.txt", "rotational"),
    "stator": ("stator.su2.xz", "stator_def.txt", "rotational"),
}
"""Mesh, displacement and kind of periodicity by the name of a case."""

ROLES = {
    "BLADE": "moving",
    "BLOCK": "moving",
    "HUB": "internal",
    "SHROUD": "internal",
} | dict.fromkeys(("LOWER", "UPPER", "PER1", "PER2"), "periodic")
"""All other markers slide."""


@dataclass(frozen=True)
class Row:
    """A greedy row of the table: case and method, and what RBF-SliDe's result was.

    Attributes
    ----------
    seconds, quality : float
        nan where it did not return; a negative quality means inverted cells there.
    """

    case: str
    sliding: str
    periodic: str
    steps: int
    tolerance: float
    pick: str
    seconds: float
    quality: float
    control_nodes: float

    def __str__(self):
        return " ".join(str(v) for v in (self.case, self.sliding, self.periodic, self.steps))


def greedy_rows() -> list[Row]:
    """Return the rows with data reduction; none where the table is absent."""
    if not TABLE.is_file():
        return []
    with TABLE.open(newline="") as lines:
        return [
            Row(
                *(line[k] for k in ("case", "sliding", "periodic")),
                int(line["steps"]),
                float(line["tolerance"]),
                "pairs" if line["double_edge"] == "YES" else "single nodes",
                *(number(line[k]) for k in ("cpu_s", "q_min", "control_nodes_last_step")),
            )
            for line in csv.DictReader(lines)
            if line["tolerance"]
        ]


def number(text: str) -> float:
    """Return a number of the table; nan for what is none."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


@functools.cache
def load(name: str) -> tuple[sv.Mesh, Case]:
    """Return mesh and case of a name in ``FILES``, without a method."""
    file, displacement, kind = FILES[name]
    mesh = sv.read(MESHES / file) if file.endswith(".su2") else unpacked(MESHES / file)
    case = Case(
        roles={marker.name: ROLES.get(marker.name, "sliding") for marker in mesh.markers},
        motions=(FromFile(MESHES / displacement),),
        periodic_type=kind,
        quality_metric="rbf-slide",
    )
    return mesh, case


def unpacked(path: Path) -> sv.Mesh:
    """Return the mesh of a packed file."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / path.stem
        plain.write_bytes(lzma.decompress(path.read_bytes()))
        return sv.read(plain)


def asked(row: Row) -> tuple[sv.Mesh, Case]:
    """Return mesh and case of a row."""
    mesh, case = load(row.case)
    return mesh, case.change(
        sliding=row.sliding,
        periodic=row.periodic,
        steps=row.steps,
        reduction=Reduction(tolerance=row.tolerance),
    )


def write_whole_boundary(folder: Path, scale: float, nodes: int) -> Path:
    """Write the stator with all boundary nodes as candidates, and return its case file."""
    mesh, case = load("stator")
    sv.write(folder / "stator.su2", mesh)
    blade = mesh.marker("BLADE").nodes
    source = MESHES / FILES["stator"][1]
    moved = read_displacements(source, mesh, blade, "BLADE")
    table = np.column_stack([moved.nodes, scale * moved.vectors])
    np.savetxt(folder / "moved.txt", table, fmt=["%d", "%.17g", "%.17g", "%.17g"])
    case.change(
        mesh_file=folder / "stator.su2",
        mesh_out=folder / "out.su2",
        roles={marker.name: "fixed" for marker in mesh.markers} | {"BLADE": "moving"},
        motions=(FromFile(folder / "moved.txt"),),
        periodic_type="auto",
        reduction=Reduction(tolerance=1e-12, max_nodes=nodes),
    ).write(folder / "stator.cfg")
    return folder / "stator.cfg"
