"""``python -m tools.study.contest``: relaxation and layers beside linear elasticity, row by row.

Each row is a mesh and a motion, and each method gives its mean and lowest quality, its inverted
cells, first heights at the moving walls (after over before, least and largest), the largest change
of the angle between first edges and the wall's normal, and its time. Rows of real meshes are left
out without ``--meshes DIR``: the folder TestCases of SU2's repository, or one with the same files
whose names have ``_`` for ``/``. ``--list`` prints the names of the rows.
"""

from __future__ import annotations

import argparse
import csv
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection

import slideviz as sv
from slideviz.case.motions.motion import Motion
from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray
from slideviz.plots.figure_io import empty_figure
from slideviz.rbf.reduction import Reduction
from slideviz.samples.table import sample, sample_case
from slideviz.samples.turbine_row import extruded
from slideviz.session.reach import scaled
from tools.shots import shrink
from tools.study.flows import (
    SHAPES,
    c_mesh,
    cusped,
    joukowski,
    layered_o_mesh,
    o_mesh,
    triangle_mesh,
)
from tools.study.rivals import inverse_distance, thin_plate
from tools.study.vane_mesh import row_mesh

Method = Callable[[sv.Mesh, sv.Case], sv.Mesh]
"""Returns the deformed mesh of a case."""

_NOTHING = {"relax": "no", "layers": "no", "repair": "no"}


def _with(**changes: Any) -> Method:
    """Return the method of slideviz with these settings."""

    def deformed(mesh: sv.Mesh, case: sv.Case) -> sv.Mesh:
        *_, last = sv.deform(case.change(**{**_NOTHING, **changes}), mesh)
        return last.mesh

    return deformed


def _elastic(stiffness: str, coefficient: float, steps: int = 1) -> Method:
    return _with(
        method="elastic",
        steps=steps,
        deform_stiffness_type=stiffness,
        deform_coeff=coefficient,
    )


METHODS: Mapping[str, Method] = {
    "rbf": _with(),
    "layers": _with(layers="auto"),
    "relax": _with(relax="yes"),
    "auto": _with(relax="auto", layers="auto", repair="auto"),
    "elastic": _elastic("INVERSE_VOLUME", 0.3),
    "elastic-10": _elastic("INVERSE_VOLUME", 0.3, steps=10),
    "wall-distance": _elastic("SOLID_WALL_DISTANCE", 0.3),
    "su2": _elastic("SOLID_WALL_DISTANCE", 1e6),
    "idwarp": inverse_distance,
    "thin-plate": thin_plate,
}
"""``auto`` is what new cases of the window have; ``rbf``, ``layers`` and ``relax`` are parts of it,
with the number of steps of the row. ``elastic`` is linear elasticity whose small cells are stiff,
``su2`` that with SU2's defaults. ``idwarp`` and ``thin-plate`` hold all boundaries."""

RIVALS = {
    "rbf": "radial basis functions alone",
    "su2": "SU2's default (elasticity, wall distance)",
    "elastic": "elasticity, inverse volume",
    "wall-distance": "elasticity, wall distance, ν = 0.3",
    "idwarp": "IDWarp's weights",
    "thin-plate": "SciPy's thin plate",
}
"""Methods that the picture has beside ``auto``, with their titles."""

USUAL = ("auto", *RIVALS)
"""Methods that run where none are named."""


class Contest(NamedTuple):
    """A row: a name, a mesh with its case, and whether the mesh has boundary layers."""

    name: str
    make: Callable[[], tuple[sv.Mesh, sv.Case]]
    layered: bool = True


@dataclass(frozen=True)
class Outcome:
    """What a method makes of a row; nan where it is refused, or where there are no layers."""

    row: str
    method: str
    mean: float
    lowest: float
    inverted: int
    unproven: int
    height_min: float
    height_max: float
    angle_deg: float
    seconds: float
    factor: float = float("nan")  # of the motion, the largest without an inverted cell
    problem: str = ""


def _part_motions(size: float) -> dict[str, Motion]:
    """Return the motions of bodies without layers, by name, for a body of a size."""
    return {
        "turned": sv.Rotate("", 20.0),
        "moved": sv.Translate("", (0.0, 0.5 * size)),
        "stretched": sv.Scale("", (1.2,)),
    }


def _reshaped(mesh: sv.Mesh, body: str, kind: str) -> Motion:
    """Return a change of the shape of an airfoil, along and across the axes of its section.

    ``bump``: 4 % of the chord on the upper side; ``bent``: a parabola with 8 % at the trailing
    edge; ``thicker N``: N % thicker.
    """
    nodes = np.unique(mesh.marker(body).nodes)
    points = mesh.points[nodes, :2]
    middle = points.mean(axis=0)
    along = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    along = along if along[0] > 0 else -along
    across = np.array([-along[1], along[0]])
    s, t = (points - middle) @ along, (points - middle) @ across
    chord = np.ptp(s)
    u = (s - s.min()) / chord
    if kind == "bump":
        upper = t > _camber(u, t)
        moved = 0.04 * chord * np.exp(-(((u - 0.4) / 0.12) ** 2)) * upper
    elif kind == "bent":
        moved = 0.08 * chord * u**2
    else:
        moved = (t - _camber(u, t)) * float(kind.split()[1]) / 100.0
    return sv.Prescribed(nodes, moved[:, None] * across)


def _camber(u: FloatArray, t: FloatArray) -> FloatArray:
    """Return the camber line at ``u``: a polynomial fitted to the mean of both sides."""
    bins = np.clip((u * 20).astype(int), 0, 19)
    at = np.unique(bins)
    middle = [0.5 * (t[bins == b].min() + t[bins == b].max()) for b in at]
    return np.polyval(np.polyfit((at + 0.5) / 20, middle, 5), u)


@cache
def _real(folder: Path, file: str) -> sv.Mesh:
    path = folder / file
    return sv.read(path if path.exists() else folder / file.replace("/", "_"))


def _passage(mesh: sv.Mesh, body: str, motion: str) -> sv.Case:
    """Return the case of a blade in its passage: inflow and outflow slide, periodic sides move."""
    roles = {
        name: "moving" if name == body else "periodic" if "per" in name.lower() else "sliding"
        for name in mesh.marker_names
    }
    return sv.Case(
        roles=roles,  # type: ignore[arg-type]
        motions=(_motion(mesh, body, motion),),
        sliding="ps",
        periodic="moving",
        periodic_type="translational",
    )


def _outer(mesh: sv.Mesh, body: str, motion: str) -> sv.Case:
    return sv.Case(roles={body: "moving"}, motions=(_motion(mesh, body, motion),))


def _motion(mesh: sv.Mesh, body: str, name: str) -> Motion:
    if name.startswith("turned by"):
        return sv.Rotate(body, float(name.split()[2]))
    if name == "bump at 0.9":
        return sv.HicksHenne(body, 0.01, 0.9)
    if name in ("turned", "moved", "stretched"):
        points = mesh.points[np.unique(mesh.marker(body).nodes)]
        return _part_motions(float(np.ptp(points, axis=0).max()))[name]
    return _reshaped(mesh, body, name)


Case = Callable[[sv.Mesh, str, str], sv.Case]


def _combined(mesh: Callable[[], sv.Mesh], case: Case, body: str, motion: str) -> Any:
    found = mesh()
    return found, case(found, body, motion)


@cache
def _sample(name: str, size: int | None = None, variant: str | None = None) -> Any:
    return sample(name, size, variant)


def _own(name: str, size: int | None, variant: str, **changes: Any) -> Any:
    """Return mesh and case of a sample, its motion as displacements, not as a file."""
    made = _sample(name, size, variant)
    if made.displacement is not None:
        moved = made.displacement
        changes["motions"] = (sv.Prescribed(moved.nodes, moved.vectors),)
    return made.mesh, made.case.change(**changes)


TURNED_BY = 10.0
"""Angle in degrees by which the vane of ``turbine-row`` is turned."""


def turned_row(size: int = 20_000) -> tuple[sv.Mesh, sv.Case]:
    """Return the sample ``turbine-row`` with its vane turned instead of enlarged."""
    motion = sv.Rotate("BLADE", TURNED_BY)
    mesh, case = _own("turbine-row", size, "motion", motions=(motion,))
    return mesh, case


def _linear_twist() -> dict[str, Any]:
    """Return settings of ``turbine-row-3d`` that turn the vane in proportion to the span.

    Its wall then leans at hub and shroud, where nodes slide and first edges cannot follow.
    """
    twist = sample_case("turbine-row-3d").motions[-1]
    assert isinstance(twist, sv.FfdTwist)
    half = replace(twist, plane=1, angle_deg=0.5 * twist.angle_deg)
    motions = half, replace(twist, plane=2)
    return {"ffd_degrees": ((1, 2, 1),), "motions": motions}


def extruded_vane(**changes: Any) -> tuple[sv.Mesh, sv.Case]:
    """Return a turbine row in 3D of 25,000 cells, four along the span, and its changed case."""
    return extruded(row_mesh(25_000 // 4), 4), sample_case("turbine-row-3d").change(**changes)


def contests(folder: Path | None) -> Iterator[Contest]:
    """Yield all rows; those of real meshes only with their ``folder``."""
    row = partial(_layered_rows, cases=_passage)
    yield Contest(f"turbine-row turned by {TURNED_BY:.0f}", turned_row)
    shapes = ("bump", "bent", "thicker 10", "thicker 30")
    if folder is not None:
        read = partial(_real, folder)
        ls89 = partial(read, "nicf/LS89/mesh_vki_turbine_prepbc.su2")
        stator = partial(read, "turbomachinery/transonic_stator_2D/su2mesh_per.su2")
        naca = partial(read, "optimization_rans/naca0012_FFD.su2")
        yield from row("LS89", ls89, "airfoil", ("turned by 15", *shapes))
        yield from row("stator", stator, "airfoil", ("turned by 10", "turned by 15", *shapes))
        yield from _layered_rows("NACA 0012", naca, "AIRFOIL", ("turned by 30", *shapes), _outer)
    o_layers = lambda: _sample("airfoil", 96, "layers").mesh  # noqa: E731
    yield from _layered_rows("O-mesh", o_layers, "airfoil", ("turned by 30", *shapes), _outer)
    yield from _layered_rows("C-mesh", cache(c_mesh), "airfoil", ("turned by 30", *shapes), _outer)
    sharp = ("turned by 30", "bump at 0.9", "bent", "thicker 60")
    for name, outline in (("Joukowski", joukowski), ("cusp", cusped)):
        o_shape, c_shape = partial(layered_o_mesh, outline), partial(c_mesh, outline, first=2e-6)
        yield from _layered_rows(f"{name}, O-mesh", cache(o_shape), "airfoil", sharp, _outer)
        yield from _layered_rows(f"{name}, C-mesh", cache(c_shape), "airfoil", sharp, _outer)
    yield Contest("turbine-row-3d twisted by 10", extruded_vane)
    yield Contest("turbine-row-3d twisted linearly", partial(extruded_vane, **_linear_twist()))
    yield from _bare_rows()


def _layered_rows(
    name: str, mesh: Callable[[], sv.Mesh], body: str, motions: Sequence[str], cases: Case
) -> Iterator[Contest]:
    for motion in motions:
        yield Contest(f"{name} {motion}", partial(_combined, mesh, cases, body, motion))


GREEDY = Reduction(tolerance=1e-3, selection="double")
MODES = [("none", "none"), ("none", "periodic"), ("none", "fixed")] + [
    (sliding, periodic)
    for sliding in ("ps", "ds")
    for periodic in ("none", "periodic", "fixed", "moving")
]
"""Sliding and periodic modes of RBF-SliDe's reference table."""


def _bare_rows() -> Iterator[Contest]:
    """Yield samples, RBF-SliDe's reference table with five steps, and bodies in outer flows."""
    for name, size in (("passage", None), ("stator", 20_000), ("airfoil", None)):
        make = partial(_own, name, size, "file" if name == "stator" else "motion")
        yield Contest(name, make, False)
    for sliding, periodic in MODES:
        modes = {"sliding": sliding, "periodic": periodic, "steps": 5}
        for name in ("square", "polar", "hexahedron", "cylindrical"):
            more = {"reduction": GREEDY} if name in ("hexahedron", "cylindrical") else {}
            make = partial(_own, name, 25, "file", **modes, **more)
            yield Contest(f"{name} {sliding} {periodic}", make, False)
    bodies: dict[str, tuple[Callable[[], sv.Mesh], str]] = {
        "airfoil in quadrilaterals": (lambda: _sample("airfoil", None).mesh, "airfoil"),
        "circle in quadrilaterals": (cache(o_mesh), "body"),
        **{
            f"{shape} in triangles": (cache(partial(triangle_mesh, shape)), "body")
            for shape in SHAPES
        },
    }
    for name, (mesh, body) in bodies.items():
        for motion in _part_motions(1.0):
            yield Contest(f"{name} {motion}", partial(_combined, mesh, _outer, body, motion), False)


def run_row(row: Contest, methods: Sequence[str], *, factor: bool = False) -> Iterator[Outcome]:
    """Yield the outcome of each method."""
    mesh, case = row.make()
    nan = float("nan")
    for method in methods:
        begin = time.perf_counter()
        try:
            deformed = METHODS[method](mesh, case)
        except SlidevizError as problem:
            refused = nan, nan, 0, 0, nan, nan, nan, nan, nan
            yield Outcome(row.name, method, *refused, str(problem))
            continue
        seconds = time.perf_counter() - begin
        found = sv.quality(deformed, mesh)
        heights = (nan, nan, nan)
        if row.layered:
            walls = sv.walls(deformed, mesh, case.markers_with("moving")).summary()
            ratios = [wall["first_height"]["ratio"] for wall in walls.values()]
            turned = max(wall["angle"]["change"]["max"] for wall in walls.values())
            heights = min(r["min"] for r in ratios), max(r["max"] for r in ratios), turned
        counts = found.inverted, found.unproven
        most = largest_factor(METHODS[method], mesh, case) if factor else nan
        yield Outcome(row.name, method, found.mean, found.min, *counts, *heights, seconds, most)


LARGEST = 4.0
"""The largest factor of a motion that is tried."""


def largest_factor(method: Method, mesh: sv.Mesh, case: sv.Case) -> float:
    """Return how many times a motion may go without an inverted cell, to 5 %, up to `LARGEST`."""

    def folds(part: float) -> bool:
        motions = tuple(_scaled(motion, part) for motion in case.motions)
        try:
            deformed = method(mesh, case.change(motions=motions))
        except SlidevizError:
            return True
        return sv.quality(deformed, mesh).inverted > 0

    if not folds(LARGEST):
        return LARGEST
    low, high = 0.0, LARGEST
    while high - low > 0.05 * high and high > 0.01:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if folds(middle) else (middle, high)
    return low


def _scaled(motion: Motion, part: float) -> Motion:
    if isinstance(motion, sv.Prescribed):
        return replace(motion, vectors=part * motion.vectors)
    (found,) = scaled([motion], part) or (motion,)
    return found


EQUAL = 5e-4
"""Means that differ by less are equal."""

MEAN_LESS, LOWEST_LESS = 0.003, 0.02
"""How much less mean and lowest quality may be and still count as good."""

HEAD = "| mesh and motion | method | mean | lowest | first heights | angle | seconds |"


def line(outcome: Outcome) -> str:
    """Return an outcome as a line of a table in Markdown."""
    o = outcome
    if o.problem:
        return f"| {o.row} | {o.method} | refused: {o.problem} | | | | |"
    lowest = f"{o.inverted} inverted" if o.inverted else f"{o.lowest:.3f}"
    heights = "" if np.isnan(o.height_min) else f"{o.height_min:.3f} to {o.height_max:.3f}"
    angle = "" if np.isnan(o.angle_deg) else f"{o.angle_deg:.1f}°"
    cells = o.row, o.method, f"{o.mean:.3f}", lowest, heights, angle, f"{o.seconds:.2f}"
    return f"| {' | '.join(cells)} |"


def faults(row: Contest, found: Mapping[str, Outcome]) -> Iterator[str]:
    """Yield the laws of relaxation and layers that the outcomes of a row break, in words."""
    rbf = found.get("rbf")
    ours = found.get("auto")
    if ours is None or ours.problem:
        return
    if row.layered and not 0.99 <= ours.height_min <= ours.height_max <= 1.01:
        yield f"first heights {ours.height_min:.3f} to {ours.height_max:.3f}, expected 0.99 to 1.01"
    if row.layered and ours.angle_deg > 1.0:
        yield f"first edges turn by {ours.angle_deg:.1f} degrees, expected at most 1"
    if row.layered and ours.inverted:
        yield f"{ours.inverted} cells are inverted, expected none"
    if rbf is not None and not rbf.problem:
        if ours.inverted > rbf.inverted or ours.lowest < min(0.9 * rbf.lowest, 0.3):
            yield f"lowest {ours.lowest:.3f}, {ours.inverted} inverted, from {rbf.lowest:.3f}"
        if ours.mean < rbf.mean or (rbf.lowest > 0.4 and ours.mean <= rbf.mean):
            yield f"mean {ours.mean:.4f}, of radial basis functions {rbf.mean:.4f}"
    less = MEAN_LESS if row.layered else EQUAL
    for name, most in (("elastic", less), ("su2", less), ("elastic-10", EQUAL)):
        other = found.get(name)
        if other is None or other.problem or other.inverted:
            continue
        if ours.mean < other.mean - most:
            yield f"mean {ours.mean:.4f}, of {name} {other.mean:.4f}"
        if row.layered and name != "elastic-10" and ours.lowest < 0.9 * other.lowest:
            yield f"lowest {ours.lowest:.3f}, of {name} {other.lowest:.3f}"


def main(argv: Sequence[str]) -> int:
    """Run the rows that are asked for; print their table, and the laws that they break."""
    parser = argparse.ArgumentParser(prog="python -m tools.study.contest", description=__doc__)
    parser.add_argument("--meshes", type=Path, metavar="DIR", help="SU2's folder TestCases")
    parser.add_argument("--rows", default="", metavar="REGEX", help="only rows with such a name")
    parser.add_argument("--methods", metavar="LIST", help=f"of {', '.join(METHODS)}")
    parser.add_argument("--factor", action="store_true", help="how far each motion may go, too")
    parser.add_argument("-o", "--output", type=Path, metavar="NAME", help="NAME.csv, .md, .png")
    parser.add_argument("--list", action="store_true", help="print names of rows, and run nothing")
    arguments = parser.parse_args(argv)
    rows = [row for row in contests(arguments.meshes) if re.search(arguments.rows, row.name)]
    if arguments.list:
        say("\n".join(row.name for row in rows))
        return 0
    say(HEAD + "\n" + "| --- " * HEAD.count(" | ") + "| --- |")
    outcomes, broken = [], []
    for row in rows:
        methods = arguments.methods.split(",") if arguments.methods else USUAL
        found = {}
        for outcome in run_row(row, methods, factor=arguments.factor):
            say(line(outcome))
            found[outcome.method] = outcome
        outcomes += found.values()
        broken += [f"{row.name}: {fault}" for fault in faults(row, found)]
        if arguments.output:
            save(arguments.output, outcomes)
    if arguments.output:
        write(arguments.output, outcomes)
    say("\n" + ("\n".join(broken) or "no law is broken"))
    return 1 if broken else 0


def save(name: Path, outcomes: Sequence[Outcome]) -> None:
    """Write outcomes as ``name.csv``."""
    with name.with_suffix(".csv").open("w", encoding="utf-8") as file:
        table = csv.DictWriter(file, [f.name for f in fields(Outcome)], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(outcome) for outcome in outcomes)


def write(name: Path, outcomes: Sequence[Outcome]) -> None:
    """Write the tables of outcomes as ``name.md``, and their picture as ``name.png``."""
    lines = [*standing(outcomes), "", *beside(outcomes)]
    name.with_suffix(".md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    draw(name.with_suffix(".png"), outcomes)


def beside(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of two tables, with a row for each mesh and motion: with layers, without."""
    rows: dict[str, dict[str, Outcome]] = {}
    for outcome in outcomes:
        rows.setdefault(outcome.row, {})[outcome.method] = outcome
    for layered in (True, False):
        chosen = {
            name: found
            for name, found in rows.items()
            if any(o.height_min > 0 or o.height_min <= 0 for o in found.values()) == layered
        }
        methods = [m for m in METHODS if any(m in found for found in chosen.values())]
        yield f"| mesh and motion | {' | '.join(methods)} |"
        yield "| --- " * (len(methods) + 1) + "|"
        for name, found in chosen.items():
            cells = [_short(found[m]) if m in found else "" for m in methods]
            yield f"| {name} | {' | '.join(cells)} |"
        yield ""


def standing(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield the lines of a table: how ``auto`` stands beside each of `RIVALS`."""
    yield (
        "| beside | runs | mean as good | lowest as good | worst difference of the lowest "
        "| runs with inverted cells: theirs, ours | goes as far |"
    )
    yield "| --- " * 7 + "|"
    for rival, title in RIVALS.items():
        pairs = list(_pairs(outcomes, rival))
        if not pairs:
            continue
        mean = sum(a.mean >= b.mean - MEAN_LESS or b.inverted > 0 for a, b in pairs)
        lows = [_lowest(a) - _lowest(b) for a, b in pairs]
        low = sum(one >= -LOWEST_LESS for one in lows)
        folded = sum(b.inverted > 0 for _, b in pairs), sum(a.inverted > 0 for a, _ in pairs)
        both = [(a.factor, b.factor) for a, b in pairs if a.factor >= 0 and b.factor >= 0]
        far = f"{sum(a >= 0.95 * b for a, b in both)} of {len(both)}" if both else ""
        yield (
            f"| {title} | {len(pairs)} | {mean} | {low} | {min(lows):+.3f} "
            f"| {folded[0]}, {folded[1]} | {far} |"
        )


def _pairs(outcomes: Sequence[Outcome], rival: str) -> Iterator[tuple[Outcome, Outcome]]:
    """Yield ours and a rival's outcome of each row that both have."""
    theirs = {o.row: o for o in outcomes if o.method == rival and not o.problem}
    for ours in outcomes:
        if ours.method == "auto" and not ours.problem and ours.row in theirs:
            yield ours, theirs[ours.row]


def _lowest(outcome: Outcome) -> float:
    return 0.0 if outcome.inverted else outcome.lowest


def draw(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write the picture: a dot for each run, its lowest over its mean quality; a panel a rival."""
    figure = empty_figure((10.0, 7.0), 160, "constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    for axes, (rival, title) in zip(panels, RIVALS.items(), strict=True):
        pairs = list(_pairs(outcomes, rival))
        ours = np.array([(a.mean, _lowest(a)) for a, _ in pairs]).reshape(-1, 2)
        theirs = np.array([(b.mean, _lowest(b)) for _, b in pairs]).reshape(-1, 2)
        between = LineCollection(np.stack([ours, theirs], axis=1), color="0.8", lw=0.6, zorder=1)
        axes.add_collection(between)
        axes.plot(*theirs.T, "o", color="tab:orange", ms=4, mew=0, label="the other", zorder=2)
        axes.plot(*ours.T, "o", color="tab:blue", ms=4, mew=0, label="slideviz", zorder=3)
        axes.set_title(title, fontsize=10)
        axes.grid(visible=True, color="0.92")
        axes.set_axisbelow(True)
    figure.supxlabel("mean quality", fontsize=10)
    figure.supylabel("lowest quality (0: inverted cells)", fontsize=10)
    panels[0].legend(fontsize=9)
    figure.savefig(path)
    shrink(path)


def _short(outcome: Outcome) -> str:
    """Return mean and lowest quality, least and largest first height, and angle in one cell."""
    o = outcome
    if o.problem:
        return "refused"
    text = f"{o.mean:.3f}, " + (f"{o.inverted} inverted" if o.inverted else f"{o.lowest:.3f}")
    if np.isnan(o.height_min):
        return text
    low, high = f"{o.height_min:.3f}", f"{o.height_max:.3f}"
    heights = low if low == high else f"{low} to {high}"
    return f"{text}; {heights}; {o.angle_deg:.1f}°"


def say(text: str) -> None:
    """Write a line to the terminal."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
