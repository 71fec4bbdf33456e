"""A mesh in memory and the same in a file are one mesh to those who ask for its cells."""

from contextlib import ExitStack

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import MeshError
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.streaming.block_quality import CellCounts, measure_mesh, quality_blocks
from slideviz.streaming.source import FileSource, MemorySource, cut_cells, join_blocks
from tests.builders import grid
from tests.formats.test_su2b import WHOLE


@pytest.fixture
def sources(tmp_path, monkeypatch):
    """Return a deformed mesh with its reference: in memory, and in files of few cells a block."""
    monkeypatch.setattr("slideviz.streaming.source.CELLS", 17)
    mesh = grid((5, 4, 4), kind="mixed")
    moved = mesh.with_points(mesh.points + 0.05 * np.sin(7.0 * mesh.points[:, ::-1]))
    zones = (tmp_path / "moved.su2b", None), (tmp_path / "mesh.su2b", None)
    for zone, one in zip(zones, (moved, mesh), strict=True):
        sv.write(zone[0], one)
    with ExitStack() as stack:
        yield stack, MemorySource(moved, mesh), FileSource.open(stack, *zones)


def test_blocks_join_to_the_mesh(sources):
    _, memory, file = sources
    assert len(list(memory.blocks())) == 1
    assert len(list(file.blocks())) > 3
    for source in (memory, file):
        whole = join_blocks(source.blocks())
        np.testing.assert_array_equal(whole.ids, np.arange(source.n_cells))
        assert whole.mesh.cells.same_as(memory.mesh.cells)
        np.testing.assert_array_equal(whole.mesh.points, memory.mesh.points)
        np.testing.assert_array_equal(whole.base.points, memory.base.points)
        ids = np.array([3, 70, 11])
        np.testing.assert_array_equal(source.types(ids), memory.mesh.cells.types[ids])
    assert not len(join_blocks([]).ids)


def test_quality_and_counts_are_the_same(sources, tmp_path):
    stack, memory, file = sources
    found = []
    for source in (memory, file):
        counts = CellCounts(source)
        quality = measure_mesh(stack, tmp_path, source, counts=counts)
        found.append((quality.summary(), quality.worst(9).tolist(), counts.types, counts.unused))
    assert found[0] == found[1]


@pytest.mark.parametrize("height", [0.0, 0.41, 0.5, 9.0])
def test_cut_cells_are_those_that_the_cutter_cuts(sources, height):
    _, memory, file = sources
    section = Section("plane", (0.0, 0.0, height), (0, 0, 1))
    mesh = memory.mesh
    wanted = Cutter(mesh).cut(mesh.points, section)
    one, other = (cut_cells(quality_blocks(s, "knupp"), section) for s in (memory, file))
    for name in ("ids", "nodes"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("values", "size", "skew", "status", "signs"):
        np.testing.assert_array_equal(getattr(one.quality, name), getattr(other.quality, name))
    assert set(wanted.cell_ids.tolist()) <= set(one.ids.tolist())
    if len(one.ids):
        again = Cutter(one.mesh).cut(one.mesh.points, section)
        np.testing.assert_array_equal(one.ids[again.cells], wanted.cells)


def test_a_mesh_without_cells_has_no_blocks(tmp_path):
    with ExitStack() as stack:
        (tmp_path / "mesh.su2b").write_bytes(WHOLE)
        source = FileSource.open(stack, (tmp_path / "mesh.su2b", None))
        empty = type(source.zones[0].place.cells)(0, 0, 0, 0, numbered=True)
        object.__setattr__(source.zones[0].place, "cells", empty)
        with pytest.raises(MeshError, match="has no cells; a quality needs at least one"):
            next(source.blocks())
