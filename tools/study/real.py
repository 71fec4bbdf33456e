"""``python -m tools.study.real SU2_TESTCASES``: radial basis functions beside linear elasticity.

Prints a table, in Markdown, of the lowest and the mean quality on meshes of SU2's test cases, one
step each, all other boundaries held. With ``--repair`` after the folder, it prints the cells that
are inverted before and after repair instead, for parts of the motions that fold at most 300 cells.
The meshes are not part of this project: the argument is the folder TestCases of SU2's repository,
or one with the same files whose names have ``_`` for ``/``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

import slideviz as sv
from slideviz.case.motions.motion import Motion
from slideviz.errors import SlidevizError
from slideviz.terms import Role
from tools.study.contest import METHODS as CONTEST


class Row(NamedTuple):
    """A mesh: its file, zone, the boundaries of its body, and the part of each motion it takes."""

    file: str
    body: tuple[str, ...]
    zone: int = 1
    part: float = 1.0
    has_layers: bool = False


_STAGE = "turbomachinery/centrifugal_stage/su2mesh_periodic.su2"
ROWS = (
    Row("disc_adj_euler/naca0012_pitching/mesh_NACA0012_inv_FFD.su2", ("airfoil",)),
    Row("coupled_cht/disc_adj_unsteadyCHT_cylinder/MeshCHT.su2", ("cylinder_fluid",)),
    Row("coupled_cht/disc_adj_unsteadyCHT_cylinder/MeshCHT.su2", ("inner_pin",), 2, 0.25),
    Row("disc_adj_rans/cylinder/mesh_cylinder.su2", ("Cylinder",)),
    Row("sliding_interface/channel_2D/channel_2D.su2", ("domain_interface",), 1, 0.0625),
    Row("sliding_interface/channel_2D/channel_2D.su2", ("internal_interface",), 2, 0.25),
    Row("optimization_rans/naca0012_FFD.su2", ("AIRFOIL",), has_layers=True),
    Row("nicf/LS89/mesh_vki_turbine_prepbc.su2", ("airfoil",), 1, 0.25, True),
    Row("turbomachinery/transonic_stator_2D/su2mesh_per.su2", ("airfoil",), 1, 0.25, True),
    Row("turbomachinery/centrifugal_blade.su2", ("wall1", "wall2"), 1, 0.125, True),
    Row(_STAGE, ("wall1", "wall2"), 1, 0.125, True),
    Row(_STAGE, ("wall3", "wall4"), 2, 0.125, True),
)
METHODS = {"rbf": CONTEST["rbf"], "elastic": CONTEST["elastic"], "SU2's default": CONTEST["su2"]}
FOLDED = 300
"""Most cells that a motion may fold whose cells are repaired."""


def main(folder: Path) -> None:
    """Print the table, and how many times each method is the better one."""
    wins = {True: np.zeros((2, 2, 2), int), False: np.zeros((2, 2, 2), int)}
    for row in ROWS:
        path = folder / row.file
        path = path if path.exists() else folder / row.file.replace("/", "_")
        mesh = sv.read(path, zone=row.zone)
        cells = []
        for motion in motions(mesh, row):
            found = [rated(mesh, row, motion, method) for method in METHODS]
            ours, *theirs = np.array(found)
            wins[row.has_layers] += [[ours > other, other > ours] for other in theirs]
            cells += [shown(mean, low) for mean, low in found]
        name = row.file.removesuffix(".su2") + (f", zone {row.zone}" if mesh.zones > 1 else "")
        part = "" if row.part == 1 else f"1/{1 / row.part:.0f}"
        say(f"| {name} | {part} | {' | '.join(cells)} |")
    for has_layers, each in wins.items():
        for name, ((mean, low), (other_mean, other_low)) in zip([*METHODS][1:], each, strict=True):
            say(
                f"{'with' if has_layers else 'without'} layers: mean higher {mean} : {other_mean}, "
                f"lowest higher {low} : {other_low} (radial basis functions : {name})"
            )


def repaired(folder: Path) -> None:
    """Print the cells inverted before and after repair of each mesh and motion that folds some."""
    for row in ROWS:
        path = folder / row.file
        path = path if path.exists() else folder / row.file.replace("/", "_")
        mesh = sv.read(path, zone=row.zone)
        for kind in range(3):
            found = folding(mesh, row, kind)
            if found is None:
                say(f"| {row.file}, zone {row.zone} | motion {kind} folds no 1 to {FOLDED} cells |")
                continue
            case, before = found
            *_, last = sv.deform(case.change(repair="yes"), mesh)
            after = sv.quality(last.mesh, mesh)
            why = "; ".join(last.warnings)
            motion = type(case.motions[0]).__name__.lower()
            say(
                f"| {row.file}, zone {row.zone} | {motion} | {len(mesh.cells)} | {before} | "
                f"{after.inverted} | {after.min:.3f} | {why} |"
            )


def folding(mesh: sv.Mesh, row: Row, kind: int) -> tuple[sv.Case, int] | None:
    """Return a case that folds at most `FOLDED` cells, and how many; None if none is found."""
    low, high, part = 0.0, np.inf, row.part
    roles: dict[str, Role] = dict.fromkeys(row.body, "moving")
    for _ in range(9):
        case = sv.Case(roles=roles, motions=(motions(mesh, row._replace(part=part))[kind],))
        try:
            *_, last = sv.deform(case, mesh)
            inverted = sv.quality(last.mesh, mesh).inverted
        except SlidevizError:
            inverted = len(mesh.cells) + FOLDED
        if 0 < inverted <= FOLDED:
            return case, inverted
        low, high = (low, part) if inverted else (part, high)
        part = 2.0 * part if np.isinf(high) else (low + high) / 2.0
    return None


def motions(mesh: sv.Mesh, row: Row) -> tuple[Motion, ...]:
    """Return the motions: turned by 20 degrees, moved by half a size, stretched by 1.2."""
    points = mesh.points[np.unique(np.concatenate([mesh.marker(m).nodes for m in row.body]))]
    size = float(np.ptp(points, axis=0).max())
    return (
        sv.Rotate("", 20.0 * row.part),
        sv.Translate("", (0.0, 0.5 * size * row.part)),
        sv.Scale("", (1.0 + 0.2 * row.part,)),
    )


def rated(mesh: sv.Mesh, row: Row, motion: Motion, method: str) -> tuple[float, float]:
    """Return mean and lowest quality; inverted cells count as minus one, a refusal as minus all."""
    roles: dict[str, Role] = dict.fromkeys(row.body, "moving")
    case = sv.Case(roles=roles, motions=(motion,))
    try:
        deformed = METHODS[method](mesh, case)
    except SlidevizError as problem:
        sys.stderr.write(f"{row.file}, {method}, {motion}: {problem}\n")
        return -np.inf, -np.inf
    found = sv.quality(deformed, mesh)
    return found.mean, -found.inverted if found.inverted else found.min


def shown(mean: float, low: float) -> str:
    """Return lowest and mean quality as text; inverted cells stand in place of the lowest."""
    if np.isneginf(low):
        return "refused"
    return f"{low:.3f} / {mean:.3f}" if low > 0 else f"{-low:.0f} inverted / {mean:.3f}"


def say(text: str) -> None:
    """Write a line to the terminal."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    (repaired if "--repair" in sys.argv else main)(Path(sys.argv[1]))
