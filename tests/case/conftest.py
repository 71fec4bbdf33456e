"""Two small meshes: a square of 3 x 3 cells, and a single cube."""

from pathlib import Path

import numpy as np
import pytest

from slideviz.case.model import Case
from slideviz.mesh.model import Cells, Marker, Mesh


@pytest.fixture
def square() -> Mesh:
    """Return 16 points; node ``4 j + i`` at (i, j). UPPER and RIGHT share node 15."""
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0))
    corner = (4 * np.arange(3)[:, None] + np.arange(3)).ravel()
    quads = corner[:, None] + [0, 1, 5, 4]
    sides = {
        "LOWER": [[0, 1], [1, 2], [2, 3]],
        "RIGHT": [[3, 7], [7, 11], [11, 15]],
        "UPPER": [[15, 14], [14, 13], [13, 12]],
        "LEFT": [[12, 8], [8, 4], [4, 0]],
    }
    return Mesh(
        np.stack([x.ravel(), y.ravel()], axis=1),
        Cells.from_blocks([(9, quads)]),
        tuple(Marker(name, Cells.from_blocks([(3, nodes)])) for name, nodes in sides.items()),
        name="square.su2",
    )


@pytest.fixture
def cube() -> Mesh:
    """Return one hexahedron of side 1; BOTTOM has the nodes 0 to 3, TOP 4 to 7."""
    flat = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    points = np.concatenate([np.c_[flat, [0] * 4], np.c_[flat, [1] * 4]])
    sides = {"BOTTOM": [[0, 3, 2, 1]], "TOP": [[4, 5, 6, 7]], "FRONT": [[0, 1, 5, 4]]}
    return Mesh(
        points,
        Cells.from_blocks([(12, [list(range(8))])]),
        tuple(Marker(name, Cells.from_blocks([(9, nodes)])) for name, nodes in sides.items()),
        name="cube.su2",
    )


@pytest.fixture
def read(tmp_path):
    """Return a function that reads a case from its text."""

    def read(text: str | bytes) -> Case:
        path: Path = tmp_path / "a.cfg"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return Case.read(path)

    return read
