"""Meshes with boxes: of SU2's test cases where they are, and small ones."""

import lzma
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv

DESIGN = Path(__file__).parents[2] / ".." / "shared" / "meshes" / "design"
REAL = DESIGN.parent / "su2"


def unpacked(name, folder):
    """A file of the design cases, unpacked into a folder; skips where they are not here."""
    path = DESIGN / name
    if path.is_file():
        data = path.read_bytes()
    elif path.with_name(f"{name}.xz").is_file():
        data = lzma.decompress(path.with_name(f"{name}.xz").read_bytes())
    else:
        pytest.skip("the design cases are not here")
    (folder / name).write_bytes(data)
    return folder / name


def square(n=8, dim=2):
    """A square (or cube) of n cells a side with a hole's worth of markers: low, high, sides."""
    axes = [np.linspace(0.0, 1.0, n + 1)] * dim
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    number = np.arange(len(points)).reshape((n + 1,) * dim)

    def cells(grid, width):
        if width == 1:
            return np.stack([grid[:-1], grid[1:]], axis=-1).reshape(-1, 2)
        if width == 2:
            corners = (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
            return np.stack(corners, axis=-1).reshape(-1, 4)
        low, high = grid[:, :, :-1], grid[:, :, 1:]
        corners = [
            g[s, t]
            for g in (low, high)
            for s, t in (
                (slice(-1), slice(-1)),
                (slice(1, None), slice(-1)),
                (slice(1, None), slice(1, None)),
                (slice(-1), slice(1, None)),
            )
        ]
        return np.stack(corners, axis=-1).reshape(-1, 8)

    vtk = {1: 3, 2: 9, 3: 12}
    sides = {}
    for axis, name in enumerate("xyz"[:dim]):
        for at, end in ((0, "low"), (-1, "high")):
            sides[f"{name}_{end}"] = cells(np.take(number, at, axis=axis), dim - 1)
    markers = tuple(
        sv.Marker(name, sv.Cells.from_blocks([(vtk[dim - 1], side)]))
        for name, side in sides.items()
    )
    return sv.Mesh(points, sv.Cells.from_blocks([(vtk[dim], cells(number, dim))]), markers)
