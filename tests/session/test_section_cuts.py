"""Sections of a mesh in its file are those of the same mesh in memory, cell by cell."""

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import Cancelled
from slideviz.mesh.quality import quality
from slideviz.samples.table import sample
from slideviz.sections.cut import Cutter
from slideviz.sections.model import Section
from slideviz.session import section_cuts
from slideviz.session.section_cuts import Groups, keep_slab, read_slab, slab_of
from slideviz.session.state import StepFrame
from slideviz.streaming.skin import read_skin
from tests.slow import one_of_each_fast


@pytest.fixture(scope="module", params=["stator", "hexahedron", "mixed"])
def files(request, tmp_path_factory):
    """Return a mesh, the same deformed, and the files of both."""
    if request.param == "mixed":
        mesh = mixed()
    else:
        mesh = sample(request.param, size=6000 if request.param == "stator" else 9).mesh
    folder = tmp_path_factory.mktemp(request.param)
    sv.write(folder / "mesh.su2b", mesh)
    bent = mesh.points + 0.02 * mesh.extent * np.sin(3.0 * mesh.points[:, ::-1] / mesh.extent)
    moved = mesh.with_points(bent)
    sv.write(folder / "moved.su2b", moved)
    return mesh, moved, folder / "mesh.su2b", folder / "moved.su2b"


def mixed():
    """Return hexahedra of which some are pairs of wedges, in shuffled order."""
    mesh = sample("hexahedron", size=7).mesh
    rng = np.random.default_rng(1)
    types, nodes = [], []
    for cell in rng.permutation(len(mesh.cells)):
        a, b, c, d, e, f, g, h = mesh.cells.connectivity[8 * cell : 8 * cell + 8]
        if cell % 3:
            types.append(12)
            nodes += [a, b, c, d, e, f, g, h]
        else:
            types += [13, 13]
            nodes += [a, b, c, e, f, g, a, c, d, e, g, h]
    return sv.Mesh(mesh.points, sv.Cells.from_types(types, nodes), mesh.markers)


def sections(mesh):
    middle = tuple(mesh.points.mean(axis=0))
    return [
        Section("plane", middle, (0, 0, 1)),
        Section("plane", middle, (0.3, -0.2, 1)),
        Section("plane", tuple(mesh.points[len(mesh.points) // 2]), (1, 0, 0)),
        Section("cylinder", (0.0, 0.0, 0.0), (0, 0, 1), 0.9 * float(np.hypot(*middle[:2])) + 1e-3),
        Section("cone", (middle[0], middle[1], middle[2] - 2 * mesh.extent), half_angle_deg=3.0),
        Section("plane", tuple(mesh.points.min(axis=0)), (0, 0, 1)),
        Section("plane", tuple(mesh.points.max(axis=0)), (0, 0, 1)),
        Section("plane", (99.0, 0.0, 0.0), (1, 0, 0)),
    ]


def framed(path, moved):
    skin = read_skin(path, None)
    return StepFrame(skin, quality(skin), file=moved)


@pytest.mark.parametrize(("kind", "group"), one_of_each_fast(range(8), [1, 7, 4096]))
def test_the_same_cells_and_polygons_as_in_memory(files, kind, group, monkeypatch):
    mesh, moved, path, file = files
    monkeypatch.setattr(section_cuts, "GROUP", group)
    section = sections(mesh)[kind]
    slab = read_slab(framed(path, file), section, lambda _: None, lambda: None)
    there = Cutter(moved).cut(moved.points, section)
    if not len(slab.mesh.cells):
        assert not len(there)
        return
    # Cells that a section only touches give no polygon, in memory as here.
    found = Cutter(slab.mesh).cut(slab.mesh.points, section)
    numbers = slab.mesh.numbering.cells
    np.testing.assert_array_equal(numbers[found.cells], there.cells)
    at, wanted = found.points[found.connectivity], there.points[there.connectivity]
    np.testing.assert_allclose(at, wanted, rtol=0, atol=1e-12 * mesh.extent)


@pytest.mark.parametrize("what", ["size-skew", "size", "skew", "displacement"])
def test_the_same_values_as_in_memory(files, what):
    mesh, moved, path, file = files
    slab = read_slab(framed(path, file), sections(mesh)[1], lambda _: None, lambda: None)
    whole = StepFrame(moved, quality(moved, mesh))
    np.testing.assert_allclose(
        slab.shown_values(what),
        whole.shown_values(what, mesh)[slab.mesh.numbering.cells],
        rtol=1e-12,
    )


def test_a_ball_holds_the_cells_of_its_group(files, monkeypatch):
    from contextlib import ExitStack

    from slideviz.streaming.source import FileSource

    mesh, moved, path, file = files
    monkeypatch.setattr(section_cuts, "GROUP", 13)
    with ExitStack() as stack:
        found = Groups.of(FileSource.open(stack, (path, None), moved=file), lambda _: None)
    assert len(found.radii) == -(-len(mesh.cells) // 13)
    for cell in range(len(mesh.cells)):
        begin, end = mesh.cells.offsets[cell : cell + 2]
        at = moved.points[mesh.cells.connectivity[begin:end]]
        away = np.linalg.norm(at[:, None] - found.centres[None], axis=2).max(axis=0)
        assert (away <= found.radii * (1 + 1e-9)).any()


def test_reading_can_be_stopped(files):
    mesh, _, path, file = files

    def stop():
        raise Cancelled("stopped")

    with pytest.raises(Cancelled):
        read_slab(framed(path, file), sections(mesh)[0], lambda _: None, stop)


def test_what_was_read_is_kept_for_that_frame_only(files):
    mesh, _, path, file = files
    frame, other = framed(path, file), framed(path, file)
    section = sections(mesh)[0]
    assert slab_of(frame.mesh, section) is None
    slab = read_slab(frame, section, lambda _: None, lambda: None)
    keep_slab(frame.mesh, section, slab)
    assert slab_of(frame.mesh, section) is slab
    assert slab_of(other.mesh, section) is None
