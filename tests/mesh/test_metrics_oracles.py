"""Metrics against slow literal oracles, Verdict (through VTK), and OpenFOAM's checkMesh."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.metrics import metrics
from slideviz.mesh.model import Cells, Mesh
from tests.builders import grid

KINDS = [(2, "plain"), (2, "mixed"), (2, "simplex")]
KINDS += [(3, kind) for kind in ("plain", "prism", "simplex", "mixed")]


def shaken(dim, kind, size=0.12, seed=3):
    """A grid whose inner and outer nodes were moved at random, sheared and stretched."""
    base = grid((4, 3) if dim == 2 else (3, 3, 3), kind=kind)
    rng = np.random.default_rng(seed)
    points = base.points + rng.uniform(-size, size, base.points.shape) / 3.0
    points = points @ (np.eye(dim) + 0.3 * np.eye(dim, k=1)) * np.arange(1, dim + 1)
    return replace(base, points=points)


def cells_of(mesh):
    """Each cell: its element type and nodes."""
    offsets = mesh.cells.offsets
    for cell, vtk in enumerate(mesh.cells.types):
        yield ELEMENTS[int(vtk)], mesh.cells.connectivity[offsets[cell] : offsets[cell + 1]]


# SU2's control volumes ----------------------------------------------------------------------


def triangle_area(a, b, c):
    return 0.5 * np.cross(b - a, c - a)


def su2_numbers(mesh):
    """SU2's ComputeMeshQualityStatistics, in loops over elements, faces and edges."""
    n, x = len(mesh.points), np.zeros((len(mesh.points), 3))
    x[:, : mesh.dim] = mesh.points
    faces = defaultdict(lambda: np.zeros(3))
    parts = [[] for _ in range(n)]
    for element, nodes in cells_of(mesh):
        middle = x[nodes].mean(axis=0)
        for local in element.facets:
            loop = nodes[list(local)]
            if mesh.dim == 2:
                (i, j), edge = loop, x[loop].mean(axis=0)
                across = middle - edge
                normal = np.array([across[1], -across[0], 0.0])
                for one in loop:
                    parts[one].append(np.linalg.norm(triangle_area(x[one], edge, middle)))
                faces[i, j] += normal
                faces[j, i] -= normal
                continue
            face = x[loop].mean(axis=0)
            for i, j in zip(loop, np.roll(loop, -1), strict=True):
                edge = 0.5 * (x[i] + x[j])
                normal = triangle_area(edge, middle, face)
                faces[i, j] += normal
                faces[j, i] -= normal
                for one in (i, j):
                    legs = np.array([edge, face, middle]) - x[one]
                    parts[one].append(abs(np.linalg.det(legs)) / 6.0)
    areas = [[] for _ in range(n)]
    weights = np.zeros((n, 2))
    for (i, j), normal in faces.items():
        size, along = np.linalg.norm(normal), x[j] - x[i]
        angle = np.degrees(np.arccos(normal @ along / size / np.linalg.norm(along)))
        weights[i] += size * (90.0 - angle), size
        areas[i].append(size)
    for marker in mesh.markers:
        total = defaultdict(lambda: np.zeros(3))
        for _, nodes in cells_of(replace(mesh, cells=marker.cells, markers=())):
            if mesh.dim == 2:
                for one in nodes:
                    total[one] += (
                        0.5 * np.array([*(x[nodes[1]] - x[nodes[0]])[1::-1], 0]) * (1, -1, 0)
                    )
                continue
            face = x[nodes].mean(axis=0)
            for i, j in zip(nodes, np.roll(nodes, -1), strict=True):
                edge = 0.5 * (x[i] + x[j])
                total[i] += triangle_area(x[i], edge, face)
                total[j] += triangle_area(edge, x[j], face)
        for one, normal in total.items():
            areas[one].append(np.linalg.norm(normal))
    return {
        "orthogonality": weights[:, 0] / weights[:, 1],
        "area-ratio": np.array([max(a) / min(a) for a in areas]),
        "volume-ratio": np.array([max(p) / min(p) for p in parts]),
    }


@pytest.mark.parametrize(("dim", "kind"), KINDS)
def test_su2s_numbers_are_those_of_loops_over_elements(dim, kind):
    mesh = shaken(dim, kind)
    found = metrics(mesh, ["orthogonality", "area-ratio", "volume-ratio"])
    for name, wanted in su2_numbers(mesh).items():
        assert found[name].values == pytest.approx(wanted, rel=1e-11), name
        worst = np.min if name == "orthogonality" else np.max
        of_cells = [worst(wanted[nodes]) for _, nodes in cells_of(mesh)]
        assert found[name].of_cells == pytest.approx(of_cells, rel=1e-11)


def test_su2s_numbers_of_one_stretched_triangle():
    # Nodes (0, 0), (3, 0), (0, 4), centre (1, 4/3): faces from edge middles (1.5, 0), (1.5, 2),
    # (0, 2) to it have the normals (4/3, 1/2), (2/3, -1/2)…, boundaries half an edge a marker.
    mesh = Mesh([[0, 0], [3, 0], [0, 4]], Cells.from_types([5], [0, 1, 2]))
    found = metrics(mesh, ["orthogonality", "area-ratio", "volume-ratio"])
    a, b = np.hypot(0.5, 4 / 3), np.hypot(1.0, 2 / 3)
    angles = 90 - np.degrees([np.arccos(4 / 3 / a), np.arccos(1.0 / b)])
    assert found["orthogonality"].values[0] == pytest.approx(angles @ [a, b] / (a + b))
    assert found["area-ratio"].values[0] == pytest.approx(a / b)
    assert found["volume-ratio"].values[0] == pytest.approx(1.0)


# OpenFOAM -----------------------------------------------------------------------------------


def layer(mesh):
    """A 2D mesh as one layer of prisms and hexahedra, of height 1."""
    if mesh.dim == 3:
        return mesh
    low = np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    n = len(low)
    cells = [(13 if len(c) == 3 else 12, [*c, *(c + n)]) for _, c in cells_of(mesh)]
    types, nodes = zip(*cells, strict=True)
    points = np.vstack([low, low + np.array([0, 0, 1])])
    return Mesh(points, Cells.from_types(types, np.concatenate(nodes)))


def poly_faces(mesh):
    """Faces of a mesh: nodes, owner and neighbour (-1), inner ones first, by owner."""
    seen = {}
    for cell, (element, nodes) in enumerate(cells_of(mesh)):
        for local in element.facets:
            loop = nodes[list(local)].tolist()
            key = tuple(sorted(loop))
            seen[key] = (seen[key][0], seen[key][1], cell) if key in seen else (loop, cell, -1)
    return sorted(seen.values(), key=lambda face: (face[2] < 0, face[1], face[2]))


def foam_geometry(mesh, faces):
    """Face areas and centres, cell centres and volumes, as primitiveMesh computes them."""
    areas, centres = [], []
    for loop, _, _ in faces:
        x = mesh.points[loop]
        if len(x) == 3:
            areas.append(triangle_area(*x))
            centres.append(x.mean(axis=0))
            continue
        top, pairs = x.mean(axis=0), list(zip(x, np.roll(x, -1, axis=0), strict=True))
        normals = np.array([triangle_area(p, q, top) for p, q in pairs])
        thirds = np.array([(p + q + top) / 3.0 for p, q in pairs])
        areas.append(normals.sum(axis=0))
        centres.append(np.average(thirds, axis=0, weights=np.linalg.norm(normals, axis=1)))
    areas, centres = np.array(areas), np.array(centres)
    middles, volumes = np.zeros((len(mesh.cells), 3)), np.zeros(len(mesh.cells))
    for cell in range(len(mesh.cells)):
        mine = [k for k, face in enumerate(faces) if cell in face[1:]]
        top = centres[mine].mean(axis=0)
        turn = np.array([1.0 if faces[k][1] == cell else -1.0 for k in mine])
        parts = turn * np.einsum("ij,ij->i", areas[mine], centres[mine] - top) / 3.0
        middles[cell] = np.average(0.75 * centres[mine] + 0.25 * top, axis=0, weights=parts)
        volumes[cell] = parts.sum()
    return areas, centres, middles, volumes


def foam_numbers(mesh):
    """Cosines of inner faces, skewness of all, and ratios of volumes, as primitiveMeshTools."""
    faces = poly_faces(mesh)
    areas, centres, middles, volumes = foam_geometry(mesh, faces)
    cosines, skewness, ratios = [], [], []
    for (loop, own, other), s, c in zip(faces, areas, centres, strict=True):
        p = c - middles[own]
        if other >= 0:
            d, share = middles[other] - middles[own], 0.2
            cosines.append(d @ s / np.linalg.norm(d) / np.linalg.norm(s))
            ratio = volumes[own] / volumes[other]
            ratios.append(max(ratio, 1.0 / ratio))
        else:
            normal = s / np.linalg.norm(s)
            d, share = normal * (normal @ p), 0.4
        v = p - (s @ p) / (s @ d) * d
        length = np.linalg.norm(v)
        reach = np.abs((mesh.points[loop] - c) @ (v / max(length, 1e-300))).max()
        skewness.append(length / max(share * np.linalg.norm(d), reach))
    return faces, np.array(cosines), np.array(skewness), np.array(ratios)


@pytest.mark.parametrize(("dim", "kind"), KINDS)
def test_openfoams_numbers_are_those_of_loops_over_faces(dim, kind):
    mesh = shaken(dim, kind)
    faces, cosines, skewness, ratios = foam_numbers(layer(mesh))
    found = metrics(mesh, ["non-orthogonality", "skewness", "expansion"])
    for cell in range(len(mesh.cells)):
        mine = [k for k, face in enumerate(faces) if cell in face[1:]]
        inner = [k for k in mine if faces[k][2] >= 0]
        angle = np.degrees(np.arccos(cosines[inner].min()))
        assert found["non-orthogonality"].values[cell] == pytest.approx(angle, rel=1e-9)
        assert found["skewness"].values[cell] == pytest.approx(skewness[mine].max(), rel=1e-9)
        assert found["expansion"].values[cell] == pytest.approx(ratios[inner].max(), rel=1e-9)


def foam_file(kind, name, rows, note=""):
    head = f'version 2.0; format ascii; class {kind}; {note} location "constant/polyMesh";'
    return f"FoamFile {{ {head} object {name}; }}\n{len(rows)}\n(\n" + "\n".join(rows) + "\n)\n"


def write_case(folder, mesh):
    """Write a mesh as a case of OpenFOAM."""
    faces = poly_faces(mesh)
    inner = sum(face[2] >= 0 for face in faces)
    (folder / "system").mkdir()
    (folder / "constant" / "polyMesh").mkdir(parents=True)
    control = "application none; startFrom startTime; startTime 0; stopAt endTime; endTime 1;"
    control += " deltaT 1; writeControl timeStep; writeInterval 1; writePrecision 12;"
    head = "FoamFile { version 2.0; format ascii; class dictionary; object %s; }\n"
    (folder / "system" / "controlDict").write_text(head % "controlDict" + control)
    schemes = " ".join(f"{name}Schemes {{ }}" for name in ("div", "grad", "laplacian"))
    (folder / "system" / "fvSchemes").write_text(head % "fvSchemes" + schemes)
    (folder / "system" / "fvSolution").write_text(head % "fvSolution")
    texts = {
        "points": ("vectorField", [f"({x!r} {y!r} {z!r})" for x, y, z in mesh.points.tolist()]),
        "faces": ("faceList", [f"{len(f)}({' '.join(map(str, f))})" for f, _, _ in faces]),
        "owner": ("labelList", [str(own) for _, own, _ in faces]),
        "neighbour": ("labelList", [str(other) for _, _, other in faces[:inner]]),
        "boundary": (
            "polyBoundaryMesh",
            [f"walls {{ type patch; nFaces {len(faces) - inner}; startFace {inner}; }}"],
        ),
    }
    for name, (kind, rows) in texts.items():
        (folder / "constant" / "polyMesh" / name).write_text(foam_file(kind, name, rows))


def printed(number, text):
    """Whether OpenFOAM would print the number so, to the 12 digits asked for."""
    return float(text) == pytest.approx(number, rel=1e-11)


@pytest.mark.skipif(shutil.which("checkMesh") is None, reason="OpenFOAM is not installed")
@pytest.mark.parametrize("size", [0.12, 0.5])
@pytest.mark.parametrize(("dim", "kind"), KINDS)
def test_checkmesh_prints_the_same_numbers(dim, kind, size, tmp_path):
    flat = shaken(dim, kind, size)
    mesh = layer(flat)
    write_case(tmp_path, mesh)
    call = ["checkMesh", "-case", str(tmp_path), "-constant"]
    settings = {"WM_PROJECT_DIR": "/usr/share/openfoam", **os.environ}  # Debian's place
    text = subprocess.run(call, capture_output=True, text=True, check=False, env=settings).stdout
    angle, average = re.search(r"non-orthogonality Max: (\S+) average: (\S+)", text).groups()
    skewness = re.search(r"Max skewness = ([-+.e\d]+)", text).group(1).rstrip(",")
    found = metrics(flat, ["non-orthogonality", "skewness"])
    assert printed(found["non-orthogonality"].max, angle)
    assert printed(found["skewness"].max, skewness)
    assert printed(np.degrees(np.arccos(foam_numbers(mesh)[1].mean())), average)


# Verdict ------------------------------------------------------------------------------------

IDEAL = {
    5: [[0, 0], [1, 0], [0.5, 0.9]],
    9: [[0, 0], [1, 0], [1, 1], [0, 1]],
    10: [[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0.5, 0.3, 0.8]],
    12: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    13: [[0, 0, 0], [1, 0, 0], [0.5, 0.9, 0], [0, 0, 1], [1, 0, 1], [0.5, 0.9, 1]],
    14: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.7]],
}


def single_cells(vtk, count=60, size=0.3):
    """Cells of a type without neighbours: undeformed, and moved at random, some inverted in 3D."""
    ideal = np.array(IDEAL[vtk], float)
    size = size if ideal.shape[1] == 3 else 0.18
    shift = np.arange(count)[:, None, None] * 3.0
    noise = np.random.default_rng(vtk).uniform(-size, size, (count, *ideal.shape))
    cells = Cells.from_types([vtk] * count, np.arange(count * len(ideal)))
    base = Mesh((ideal + shift).reshape(-1, ideal.shape[1]), cells)
    return base, Mesh((ideal + shift + noise).reshape(-1, ideal.shape[1]), cells)


def verdict(mesh, measure):
    """A measure of vtkMeshQuality, which calls Verdict."""
    import pyvista as pv
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersVerdict import vtkMeshQuality

    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.dim] = mesh.points
    nodes = mesh.cells.connectivity.reshape(len(mesh.cells), -1)
    table = np.column_stack([np.full(len(nodes), nodes.shape[1]), nodes])
    rated = vtkMeshQuality()
    rated.SetInputData(pv.UnstructuredGrid(table.ravel(), mesh.cells.types, points))
    kinds = {5: "Triangle", 9: "Quad", 10: "Tet", 12: "Hex", 13: "Wedge", 14: "Pyramid"}
    getattr(rated, f"Set{kinds[int(mesh.cells.types[0])]}QualityMeasureTo{measure}")()
    rated.Update()
    return vtk_to_numpy(rated.GetOutput().GetCellData().GetArray("Quality"))


@pytest.mark.parametrize("vtk", IDEAL)
def test_scaled_jacobian_and_equiangle_skew_are_verdicts(vtk):
    base, mesh = single_cells(vtk)
    found = metrics(mesh, ["scaled-jacobian", "equiangle-skew"], base)
    assert found["scaled-jacobian"].values == pytest.approx(
        verdict(mesh, "ScaledJacobian"), abs=1e-12
    )
    skew = found["equiangle-skew"].values
    if vtk == 10:  # Verdict counts the angles between the faces of a tetrahedron, too
        skew = np.maximum(skew, [dihedral_skew(mesh.points[n]) for _, n in cells_of(mesh)])
    assert skew == pytest.approx(verdict(mesh, "EquiangleSkew"), abs=1e-9)


def dihedral_skew(x):
    """How far the angles between the faces of a tetrahedron are from the regular one's."""
    angles, ideal = [], np.degrees(np.arccos(1.0 / 3.0))
    for a, b, c, d in (map(int, four) for four in ("0123", "0213", "0312", "1203", "1302", "2301")):
        p, q = np.cross(x[b] - x[a], x[[c, d]] - x[a])
        angles.append(np.degrees(np.arccos(p @ q / np.linalg.norm(p) / np.linalg.norm(q))))
    return max((max(angles) - ideal) / (180.0 - ideal), (ideal - min(angles)) / ideal)


@pytest.mark.parametrize("vtk", IDEAL)
def test_angles_and_edges_are_those_of_the_faces(vtk):
    base, mesh = single_cells(vtk, 20, 0.15)
    found = metrics(mesh, ["smallest-angle", "largest-angle", "aspect-ratio"], base)
    for cell, (element, nodes) in enumerate(cells_of(mesh)):
        x = mesh.points[nodes]
        polygons = [range(len(x))] if mesh.dim == 2 else element.facets
        angles = []
        for loop in polygons:
            for a, b, c in zip(np.roll(loop, 1), loop, np.roll(loop, -1), strict=True):
                p, q = x[a] - x[b], x[c] - x[b]
                angles.append(np.degrees(np.arccos(p @ q / np.sqrt(p @ p * (q @ q)))))
        lengths = [np.linalg.norm(x[a] - x[b]) for a, b in element.edges]
        assert found["smallest-angle"].values[cell] == pytest.approx(min(angles))
        assert found["largest-angle"].values[cell] == pytest.approx(max(angles))
        assert found["aspect-ratio"].values[cell] == pytest.approx(max(lengths) / min(lengths))


def test_a_hexahedron_without_volume_is_rated_0_not_1e30():
    flat = np.array(IDEAL[12], float) * (1, 1, 0)
    cells = Cells.from_types([12], np.arange(8))
    found = metrics(Mesh(flat, cells), ["scaled-jacobian", "aspect-ratio"])
    assert found["scaled-jacobian"].values[0] == 0.0
    assert found["aspect-ratio"].values[0] == np.inf
