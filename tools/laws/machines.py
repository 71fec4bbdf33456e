"""Random passages, stages and rows of zones, with the laws of what only they have.

Motions over the span, surfaces to lie on, wheels, zones, and designs in time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np

import slideviz as sv
from slideviz.case.cfg import case_of_text
from slideviz.case.model import Case
from slideviz.errors import SlidevizError
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import quality
from slideviz.system.ranks import thread_limit
from tests import builders
from tools.laws.draw import Rng
from tools.laws.oracle import distance

PASSAGE = """MARKER_MOVING= ( blade )
MARKER_SLIDING= ( hub, shroud, inflow, outflow )
MARKER_PERIODIC= ( per1, per2 )
SPAN= ( hub, shroud )
"""
SAME = 1e-9
"""Part of the extent up to which two results are the same."""


def broken(seed: int) -> Iterator[tuple[str, str]]:
    """Yield the laws that a random machine breaks, and how."""
    rng = np.random.default_rng([seed, 21])
    names = list(LAWS)
    name = names[int(rng.integers(len(names)))]
    try:
        for text in LAWS[name](rng):
            yield name, text
    except SlidevizError as problem:
        yield name, f"it is refused: {problem}"
    except Exception as problem:
        yield name, f"it ends with {problem!r}"


def _passage(rng: Rng) -> tuple[Mesh, int]:
    """Return a passage, and how many make a wheel."""
    count = int(rng.integers(6, 25))
    shape = (int(rng.integers(3, 6)), 2 * int(rng.integers(2, 4)), 2 * int(rng.integers(2, 5)))
    kind = str(rng.choice(["plain", "simplex", "prism", "mixed"]))
    return builders.passage(shape, 360.0 / count, kind), count


def _case(rng: Rng, motion: str) -> Case:
    sliding = "ps" if rng.random() < 0.5 else "ds"
    steps = int(rng.integers(1, 4))
    method = f"SLIDING_MODE= {sliding}\nPERIODIC_MODE= moving\nSTEPS= {steps}\n"
    return case_of_text(Path("a.cfg"), f"{PASSAGE}{motion}\n{method}", Case())


def _last(case: Case, mesh: Mesh) -> Mesh:
    *_, last = sv.deform(case, mesh)
    return last.mesh


def _radius(points: FloatArray) -> FloatArray:
    return np.hypot(points[:, 0], points[:, 1])


def span_is_kept(rng: Rng) -> Iterator[str]:
    """Yield which nodes of a blade left their radius, or moved at a span where nothing does."""
    mesh, _ = _passage(rng)
    verb = str(rng.choice(["twist", "lean", "sweep"]))
    most = float(rng.uniform(-4, 4)) if verb == "twist" else float(rng.uniform(-0.02, 0.02))
    moved = _last(_case(rng, f"MOTION= (blade, {verb}, 0:0, 0.5:{most!r}, 1:{most / 2!r})"), mesh)
    nodes = mesh.marker("blade").nodes
    off = np.abs(_radius(moved.points[nodes]) - _radius(mesh.points[nodes]))
    if verb != "sweep" and off.max() > SAME:
        yield f"{verb} takes node {nodes[off.argmax()]} off its span by {off.max():.2g}"
    hub = np.intersect1d(nodes, mesh.marker("hub").nodes)
    far = np.abs(moved.points[hub] - mesh.points[hub]).max(initial=0.0)
    if far:
        yield f"{verb} of 0 at the hub moves its nodes by {far:.2g}"
    for wall in ("hub", "shroud"):
        here = mesh.marker(wall).nodes
        gap = np.abs(_radius(moved.points[here]) - _radius(mesh.points[here])).max()
        if gap > 0.02:
            yield f"nodes of {wall} leave it by {gap:.2g}"


def onto_is_on(rng: Rng) -> Iterator[str]:
    """Yield how far a boundary remains from the surface that it is put onto."""
    mesh = builders.sphere_in_box(int(rng.integers(3, 6)), 3)
    axes = rng.uniform(0.85, 1.15, 3)
    fine = builders.sphere_in_box(8, 1)
    sphere = fine.marker("sphere")
    quads = np.searchsorted(sphere.nodes, sphere.cells.by_type[9][1])
    points = fine.points[sphere.nodes] * axes
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    with TemporaryDirectory() as folder:
        path = Path(folder, "target.vtu")
        meshio.write(path, meshio.Mesh(points, [("triangle", triangles)]), binary=True)
        case = Case(roles={"sphere": "moving"}, motions=(sv.Onto(path, "sphere"),))
        moved = _last(case, mesh)
    gap = distance(moved.points[mesh.marker("sphere").nodes], points[triangles])
    if gap.max() > 1e-9 * mesh.extent:
        yield f"a node remains {gap.max() / mesh.extent:.2g} from the surface"


def wheel_is_its_passages(rng: Rng) -> Iterator[str]:
    """Yield what of a wheel is not that of so many passages."""
    mesh, count = _passage(rng)
    case = _case(rng, f"MOTION= (blade, translate, 0, 0, {float(rng.uniform(-0.02, 0.02))!r})")
    with TemporaryDirectory() as folder:
        path = Path(folder, "wheel.su2b")
        made = sv.wheel(path, case, mesh)
        wheel = sv.read(path)
    side = len(mesh.marker("per1").nodes)
    if len(wheel.cells) != count * len(mesh.cells):
        yield f"{len(wheel.cells)} cells of {count} passages with {len(mesh.cells)}"
    if len(wheel.points) != count * (len(mesh.points) - side):
        yield f"{len(wheel.points)} points, not {count * (len(mesh.points) - side)}"
    if not made.is_closed:
        yield "it is not closed"
    one, all_ = quality(_last(case, mesh)), quality(wheel)
    if abs(one.min - all_.min) > 1e-7 or all_.inverted != count * one.inverted:
        yield f"the least quality is {all_.min}, that of a passage {one.min}"


def zones_stay_together(rng: Rng) -> Iterator[str]:
    """Yield which nodes of an interface part, and which zone that nothing moves is moved."""
    count = int(rng.integers(2, 4))
    shape = (6, 6) if rng.random() < 0.6 else (4, 4, 4)
    mesh = builders.zones_in_a_row(count, shape)
    dim = len(shape)
    zeros = ", 0" * (dim - 2)
    tail = "".join(f", {k}:{side}" for k in range(1, count + 1) for side in ("y_m", "y_p"))
    text = (
        f"MARKER_MOVING= ( 1:x_m )\nMARKER_SLIDING= ( {tail[2:]} )\nSLIDING_MODE= ps\n"
        f"MOTION= (1:x_m, translate, {float(rng.uniform(-0.1, 0.1))!r}, 0{zeros})\n"
    )
    moved = _last(case_of_text(Path("a.cfg"), text, Case()), mesh)
    for k in range(1, count):
        a, b = (mesh.marker(f"{n}:{side}").nodes for n, side in ((k, "x_p"), (k + 1, "x_m")))
        before = np.linalg.norm(mesh.points[a][:, None] - mesh.points[b][None], axis=2)
        pairs = before.argmin(axis=1)
        gap = np.abs(moved.points[a] - moved.points[b[pairs]]).max()
        if gap > SAME:
            yield f"nodes of zones {k} and {k + 1} part by {gap:.2g}"


def designs_in_time_are_runs(rng: Rng) -> Iterator[str]:
    """Yield which mesh of a motion in time is not that of a run of its own."""
    mesh = builders.square(int(rng.integers(4, 9)), "mixed")
    text = "MARKER_MOVING= ( BLOCK )\nMOTION= (BLOCK, translate, 0, 0)\n"
    case = case_of_text(Path("a.cfg"), text, Case())
    far = rng.uniform(-0.05, 0.05, 3)
    table = {"time": [0.0, 0.1, 0.2], "BLOCK.translate.x": far.tolist()}
    with TemporaryDirectory() as folder, thread_limit(1) as limit:
        limit()
        source = Path(folder, "mesh.su2")
        sv.write(source, mesh)
        case = case.change(mesh_file=source)
        out = Path(folder, "out")
        with ThreadPoolExecutor(1) as pool:
            rows = list(sv.sweep(case, table, pool, folder=out, meshes=True, time_step=0.1))
        for row, x in zip(sorted(rows, key=lambda row: row.design), far.tolist(), strict=True):
            moved = case.change(motions=(sv.Translate("BLOCK", (x, 0.0)),))
            if row.mesh is None or (sv.read(row.mesh).points != _last(moved, mesh).points).any():
                yield f"design {row.design} has other bits than a run"


LAWS: dict[str, Callable[[Rng], Iterator[str]]] = {
    "span": span_is_kept,
    "onto": onto_is_on,
    "wheel": wheel_is_its_passages,
    "zones": zones_stay_together,
    "time": designs_in_time_are_runs,
}
"""Law by name."""
