"""A mesh as OpenFOAM has it, and its solver of mesh motion, ``displacementLaplacian``."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np

import slideviz as sv
from slideviz.mesh.elements import ELEMENTS

PROGRAM = "moveDynamicMesh"
HERE = shutil.which(PROGRAM) is not None
ENVIRONMENT = {"WM_PROJECT_DIR": "/usr/share/openfoam"} | os.environ
"""Debian's package leaves it to the user to say where it is."""

HEAD = "FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"

SETTINGS = {
    "system/controlDict": f"application {PROGRAM}; startFrom startTime; startTime 0;"
    " stopAt endTime; endTime 1; deltaT 1; writeControl timeStep; writeInterval 1;"
    " writeFormat ascii; writePrecision 17; timeFormat general; timePrecision 6;",
    "system/fvSchemes": "ddtSchemes { default Euler; } gradSchemes { default Gauss linear; }"
    " divSchemes { default none; } interpolationSchemes { default linear; }"
    " laplacianSchemes { default Gauss linear corrected; } snGradSchemes { default corrected; }",
    "system/fvSolution": 'solvers { "cellDisplacement.*"'
    " { solver PCG; preconditioner DIC; tolerance 1e-30; relTol 0; maxIter 5000; } }",
    "constant/dynamicMeshDict": "dynamicFvMesh dynamicMotionSolverFvMesh;"
    " motionSolverLibs (fvMotionSolvers); motionSolver displacementLaplacian;"
    " displacementLaplacianCoeffs { diffusivity quadratic inverseDistance (moving); }",
}
"""One time step; the diffusivity is that of OpenFOAM's tutorials with moving bodies. Its terms are
so large at the walls that the residual, which is measured in them, says nothing above 1e-25."""


def write_case(folder: Path, mesh: sv.Mesh, displacement: np.ndarray, moving: np.ndarray) -> None:
    """Write a case whose boundary is displaced.

    Parameters
    ----------
    displacement : (n, 3)
        Of all nodes; that of the boundary is prescribed.
    moving : (m,) int64
        Nodes of the boundary that the diffusivity falls off from.
    """
    faces, owner, neighbour, inner = _faces(mesh)
    parts = folder / "constant" / "polyMesh"
    for path in (parts, folder / "system", folder / "0"):
        path.mkdir(parents=True, exist_ok=True)
    for name, text in SETTINGS.items():
        head = HEAD.format(kind="dictionary", name=Path(name).name)
        (folder / name).write_text(head + text + "\n")
    # A patch is a range of faces: those that move come first.
    last = np.array([not np.isin(face, moving).all() for face in faces[inner:]])
    order = [*range(inner), *(inner + np.argsort(last, kind="stable")).tolist()]
    faces, owner = [faces[k] for k in order], [owner[k] for k in order]
    turn = inner + int(np.sum(~last))
    patches = {"moving": (inner, turn), "rest": (turn, len(faces))}
    _write(parts / "points", "vectorField", _vectors(mesh.points))
    _write(
        parts / "faces", "faceList", [f"{len(f)}({' '.join(map(str, f.tolist()))})" for f in faces]
    )
    _write(parts / "owner", "labelList", owner)
    _write(parts / "neighbour", "labelList", neighbour)
    rows = [
        f"{n} {{ type patch; nFaces {b - a}; startFace {a}; }}" for n, (a, b) in patches.items()
    ]
    _write(parts / "boundary", "polyBoundaryMesh", rows)
    values = [_patch(name, faces[a:b], displacement) for name, (a, b) in patches.items()]
    (folder / "0" / "pointDisplacement").write_text(
        HEAD.format(kind="pointVectorField", name="pointDisplacement")
        + "dimensions [0 1 0 0 0 0 0]; internalField uniform (0 0 0);\n"
        + f"boundaryField\n{{\n{''.join(values)}}}\n"
    )


def _patch(name: str, faces: list[np.ndarray], displacement: np.ndarray) -> str:
    """Return the entry of a patch; its points come in the order in which its faces name them."""
    named = np.concatenate(faces)
    nodes = named[np.sort(np.unique(named, return_index=True)[1])]
    rows = "\n".join(_vectors(displacement[nodes]))
    head = f"{name} {{ type fixedValue; value nonuniform List<vector>\n{len(nodes)}"
    return f"{head}\n(\n{rows}\n); }}\n"


def read_points(folder: Path) -> np.ndarray:
    """Return the points (n, 3) after the time step."""
    text = (folder / "1" / "polyMesh" / "points").read_text()
    body = text[text.index("\n(\n") + 3 : text.rindex("\n)")]
    return np.array(body.translate(str.maketrans("()", "  ")).split(), float).reshape(-1, 3)


def _faces(mesh: sv.Mesh) -> tuple[list[np.ndarray], list[int], list[int], int]:
    """Return faces, their owners and neighbours, and the number of inner faces, which come first.

    Normals point out of the owner, the cell of smaller number; inner faces are sorted by owner,
    then neighbour.
    """
    rows, cells = [], []
    for kind in np.unique(mesh.cells.types):
        element = ELEMENTS[int(kind)]
        at = np.flatnonzero(mesh.cells.types == kind)
        nodes = mesh.cells.connectivity[
            mesh.cells.offsets[at][:, None] + np.arange(element.n_nodes)
        ]
        for facet in element.facets:
            padded = np.full((len(at), 4), -1)
            padded[:, : len(facet)] = nodes[:, facet]
            rows.append(padded)
            cells.append(at)
    face, cell = np.concatenate(rows), np.concatenate(cells)
    order = np.argsort(cell, kind="stable")
    face, cell = face[order], cell[order]
    _, first, group, count = np.unique(
        np.sort(face, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    owner, neighbour = cell[first], np.zeros(len(first), np.int64)
    second = np.ones(len(face), bool)
    second[first] = False
    neighbour[group.ravel()[second]] = cell[second]
    inner = np.flatnonzero(count == 2)
    inner = inner[np.lexsort((neighbour[inner], owner[inner]))]
    outer = np.flatnonzero(count == 1)
    order = np.concatenate([inner, outer])
    faces = [row[row >= 0] for row in face[first[order]]]
    return faces, owner[order].tolist(), neighbour[inner].tolist(), len(inner)


def _vectors(values: np.ndarray) -> list[str]:
    return [f"({x!r} {y!r} {z!r})" for x, y, z in values.tolist()]


def _write(path: Path, kind: str, rows: list) -> None:
    text = "\n".join(map(str, rows))
    path.write_text(f"{HEAD.format(kind=kind, name=path.name)}{len(rows)}\n(\n{text}\n)\n")
