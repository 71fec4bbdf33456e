"""``python -m tools.study.untangling``: repair beside mfem's mesh-optimizer and Gmsh, a table.

Nodes inside meshes are put at random places, boundaries are held. mfem minimises its untangling
metrics (TMOP), each as its examples call it; the best of its results counts. Gmsh has an untangler
in 2D only. Both come with ``pip install -e '.[peers]'``; what is missing is left out.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from importlib import import_module, util
from pathlib import Path
from subprocess import DEVNULL, TimeoutExpired, run

import numpy as np

from slideviz.mesh.jacobians import VALID
from slideviz.mesh.model import FloatArray, Mesh
from slideviz.mesh.quality import quality
from slideviz.mesh.repair.freedom import Freedom
from slideviz.mesh.repair.repair import repair_mesh
from tests.builders import grid

SHAPES: dict[str, tuple[tuple[int, ...], str, float]] = {
    "24² quadrilaterals": ((24, 24), "plain", 1.0),
    "24² × 2 triangles": ((24, 24), "simplex", 1.0),
    "24² quadrilaterals, jitter": ((24, 24), "plain", 0.06),
    "24² quadrilaterals and triangles, jitter": ((24, 24), "mixed", 0.1),
    "10³ hexahedra": ((10, 10, 10), "plain", 1.0),
    "10³ hexahedra, jitter": ((10, 10, 10), "plain", 0.12),
    "6³ × 6 tetrahedra": ((6, 6, 6), "simplex", 1.0),
    "8³ × 2 prisms": ((8, 8, 8), "prism", 1.0),
    "22³ hexahedra, jitter": ((22, 22, 22), "plain", 0.12),
}
"""Shape and kind of a grid in the unit box, and the part of the box by which nodes are moved."""

GEOMETRIES = {3: 1, 5: 2, 9: 3, 10: 4, 12: 5, 13: 6, 14: 7}
"""mfem's number of a type of cells or sides by VTK's."""

METRICS = {
    2: (("-mid", "22"), ("-mid", "4", "-btype", "1")),
    3: (("-mid", "313", "-fd"),),
}
"""Metrics by which mesh-optimizer untangles, by dimension; it has no shifted barrier in 3D."""

LIMIT_S = 120.0
"""Longest time of a program."""

Untangler = Callable[[Mesh, Mesh, np.ndarray], FloatArray | None]
"""Takes the tangled mesh, the grid and a mask (n,) of the nodes that stay; returns points."""


def tangled(name: str) -> tuple[Mesh, Mesh, np.ndarray]:
    """Return a mesh with nodes at random places, the grid, and a mask (n,) of nodes that stay."""
    shape, kind, amount = SHAPES[name]
    mesh, rng = grid(shape, kind=kind), np.random.default_rng(1)
    held = np.zeros(len(mesh.points), bool)
    held[np.concatenate([marker.nodes for marker in mesh.markers])] = True
    anywhere = rng.random(mesh.points.shape)
    if amount < 1.0:
        anywhere = mesh.points + amount * (2.0 * anywhere - 1.0)
    return mesh.with_points(np.where(held[:, None], mesh.points, anywhere)), mesh, held


def ours(mesh: Mesh, shapes: Mesh, held: np.ndarray) -> FloatArray:
    """Return the points after repair."""
    return repair_mesh(mesh, Freedom.within(mesh.dim, held), shapes).points


def write_mfem(path: Path, mesh: Mesh) -> None:
    """Write a mesh in mfem's format 1.0, its boundary with attribute 1."""
    lines = ["MFEM mesh v1.0", "", "dimension", str(mesh.dim), "", "elements", str(len(mesh.cells))]
    numbers = [""] * len(mesh.cells)
    for vtk, (ids, nodes) in mesh.cells.by_type.items():
        for cell, row in zip(ids, nodes, strict=True):
            numbers[cell] = " ".join(map(str, [1, GEOMETRIES[vtk], *row]))
    sides = [
        " ".join(map(str, [1, GEOMETRIES[{2: 3, 3: 5, 4: 9}[len(side)]], *side]))
        for marker in mesh.markers
        for _, table in marker.cells.by_type.values()
        for side in table
    ]
    lines += [*numbers, "", "boundary", str(len(sides)), *sides, "", "vertices"]
    lines += [str(len(mesh.points)), str(mesh.dim)]
    lines += [" ".join(map(repr, point)) for point in mesh.points.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def read_mfem(path: Path, like: Mesh) -> FloatArray:
    """Return the points (n, d) of a mesh of first order that mfem wrote."""
    text = path.read_text(encoding="ascii")
    head, _, body = text.rpartition("Ordering:")
    values = np.array(body.split(), float) if head else np.empty(0)
    points = values[1:].reshape(like.points.shape[::-1] if values[0] == 0 else like.points.shape)
    return points.T if values[0] == 0 else points


def mfem_with(program: Path, metric: Sequence[str]) -> Untangler:
    """Return the untangler of mesh-optimizer with a metric."""

    def untangle(mesh: Mesh, _shapes: Mesh, _held: np.ndarray) -> FloatArray | None:
        with tempfile.TemporaryDirectory() as folder:
            # Targets of untangling have unit size: so has the mean cell.
            size = len(mesh.cells) ** (1.0 / mesh.dim)
            write_mfem(Path(folder) / "in.mesh", mesh.with_points(size * mesh.points))
            words = [str(program), "-m", "in.mesh", *metric, "-tid", "1", "-fix-bnd", "-no-vis"]
            words += ["-ni", "200", "-li", "50", "-qo", "4", "-rtol", "1e-5"]
            try:
                run(words, cwd=folder, stdout=DEVNULL, stderr=DEVNULL, timeout=LIMIT_S, check=False)
            except TimeoutExpired:
                return None
            out = Path(folder) / "optimized.mesh"
            return read_mfem(out, mesh) / size if out.exists() else None

    return untangle


def gmsh_untangled(mesh: Mesh, _shapes: Mesh, held: np.ndarray) -> FloatArray | None:
    """Return the points after Gmsh's ``UntangleMeshGeometry`` of a mesh in the unit square."""
    gmsh = import_module("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)  # it untangles faces of a geometry only
        gmsh.model.occ.synchronize()
        x = np.pad(mesh.points, ((0, 0), (0, 1)))
        entity = np.full(len(x), -1)
        entities = gmsh.model.getEntities()
        for place, (dim, tag) in enumerate(entities):
            low, high = np.reshape(gmsh.model.getBoundingBox(dim, tag), (2, 3))
            on = ~held | (dim < 2) & ((x > low - 1e-6) & (x < high + 1e-6)).all(axis=1)
            on &= held if dim < 2 else True
            entity[on & (entity < 0)] = place
            some = np.flatnonzero(entity == place)
            at = mesh.points[some] if dim == 2 else np.zeros((len(some), dim))
            gmsh.model.mesh.addNodes(dim, tag, some + 1, x[some].ravel(), at.ravel())
        for vtk, (_, nodes) in mesh.cells.by_type.items():
            gmsh.model.mesh.addElementsByType(1, {5: 2, 9: 3}[vtk], [], nodes.ravel() + 1)
        for sides in (marker.cells.by_type[3][1] for marker in mesh.markers):
            for place in np.unique(of := entity[sides].max(axis=1)):
                tags = sides[of == place].ravel() + 1
                gmsh.model.mesh.addElementsByType(entities[place][1], 1, [], tags)
        before = np.concatenate(gmsh.model.mesh.getElements(2)[2]).astype(int) - 1
        gmsh.model.mesh.optimize("UntangleMeshGeometry", True, 10)
        after = np.concatenate(gmsh.model.mesh.getElements(2)[2]).astype(int)
        tags, found, _ = gmsh.model.mesh.getNodes()
        row = np.argsort(tags)[np.searchsorted(np.sort(tags), after)]
        x[before] = np.reshape(found, (-1, 3))[row]  # nodes have new numbers, elements do not
        return np.asarray(x[:, :2])
    finally:
        gmsh.finalize()


def untanglers(dim: int) -> dict[str, Untangler]:
    """Return the untanglers that are installed, by name."""
    found: dict[str, Untangler] = {"slideviz": ours}
    mfem = util.find_spec("mfem")
    if mfem is not None and mfem.submodule_search_locations:
        program = Path(mfem.submodule_search_locations[0], "external/ser/miniapps/mesh-optimizer")
        for metric in METRICS[dim]:
            found[f"mfem, metric {metric[1]}"] = mfem_with(program, metric)
    if dim == 2 and util.find_spec("gmsh") is not None:
        found["Gmsh"] = gmsh_untangled
    return found


def main() -> None:
    """Print a row for each mesh and program: cells not valid before and after, lowest quality."""
    _say("| mesh | program | not valid before | after | lowest quality | time |")
    _say("| --- | --- | --- | --- | --- | --- |")
    ours(*tangled("6³ × 6 tetrahedra"))  # compiles
    for name in SHAPES if len(sys.argv) < 2 else sys.argv[1:]:
        mesh, shapes, held = tangled(name)
        before = int((quality(mesh, shapes).status != VALID).sum())
        for program, untangle in untanglers(mesh.dim).items():
            start = time.perf_counter()
            points = untangle(mesh, shapes, held)
            seconds = time.perf_counter() - start
            words = "no result |"
            if points is not None and np.isfinite(points).all():
                after = quality(mesh.with_points(points), shapes)
                moved = np.abs(points[held] - mesh.points[held]).max()
                words = f"{(after.status != VALID).sum()} | {after.min:.3f}"
                words += " (boundary moved)" if moved > 1e-9 else ""
            _say(f"| {name} | {program} | {before} | {words} | {seconds:.1f} s |")


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main()
