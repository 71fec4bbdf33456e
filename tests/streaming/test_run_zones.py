"""Streamed runs of meshes with several zones: the bits and numbers of a run in memory."""

from dataclasses import replace

import numpy as np
import pytest

import slideviz as sv
from slideviz.errors import MeshError
from slideviz.formats.su2.write import su2_blocks
from slideviz.mesh.model import Assembly, Skin
from slideviz.mesh.zones import join_zones
from slideviz.streaming import run as streamed_run
from slideviz.streaming import streamed_repair
from slideviz.streaming.run import stream
from slideviz.streaming.skin import read_skin
from tests.builders import grid, passage
from tests.mesh.test_interfaces import zones as core_in_a_square
from tests.slow import one_of_each_fast
from tests.solver.test_interface_motion import both, roles_of, turn
from tests.solver.test_interface_motion import stage as rows
from tests.streaming.test_run import bits, require_same


def sliding_pair(folder):
    """Write two squares that share the side x = 1, along which the first one's nodes slide."""
    cuts = [(4, 4), (4, 4)]
    meshes = [
        grid(cut, place=lambda p, k=k: p / 4.0 + np.array([k, 0.0])) for k, cut in enumerate(cuts)
    ]
    texts = [b"".join(su2_blocks(mesh)).decode() for mesh in meshes]
    path = folder / "pair.su2"
    path.write_text(f"NZONE= 2\nIZONE= 1\n{texts[0]}IZONE= 2\n{texts[1]}")
    return path


def passages(folder):
    """Write two rows of 3D passages."""
    front, behind = passage((4, 6, 8), 40.0), passage((3, 4, 6), 30.0)
    apart = behind.with_points(behind.points + np.array([0.0, 0.0, 2.0]))
    each = [replace(zone, zone=k, zones=2) for k, zone in enumerate((front, apart), 1)]
    sv.write(folder / "rows.su2", join_zones(each))
    return folder / "rows.su2"


def turned_blades():
    names = dict.fromkeys(("hub", "shroud"), "sliding")
    sides = dict.fromkeys(("per1", "per2"), "periodic")
    here = names | sides | {"blade": "moving"}
    roles = {f"{zone}:{name}": role for zone in (1, 2) for name, role in here.items()}
    motions = tuple(sv.Translate(f"{zone}:blade", (0.0, 0.0, 0.03)) for zone in (1, 2))
    return sv.Case(
        roles=roles,
        motions=motions,
        sliding="ps",
        periodic="moving",
        steps=2,
        quality_metric="knupp",
    )


SLID = sv.Case(
    roles={"1:x_m": "moving", "1:x_p": "sliding"},
    motions=(sv.Scale("1:x_m", (1.0, 0.9), (0.0, 0.0)),),
    sliding="ps",
)
FOLLOW = sv.Case(
    roles={"2:core": "moving"}, motions=(sv.Translate("2:core", (0.02, 0.01)),), steps=3
)
FOLDED = both().change(
    motions=(sv.Rotate("1:BLOCK", 90.0), sv.Rotate("2:BLOCK", 120.0)),
    steps=1,
    sliding="none",
    periodic="none",
)
CASES = {
    "rows": (rows, both()),
    "one of two": (rows, sv.Case(roles=roles_of("2:"), motions=(turn("2:"),), sliding="ps")),
    "automatic": (rows, both().change(steps=0)),
    "folded": (rows, FOLDED),
    "repaired": (rows, FOLDED.change(repair="yes", repair_below=0.5)),
    "followed": (core_in_a_square, FOLLOW),
    "slid": (sliding_pair, SLID),
    "slid and repaired": (sliding_pair, SLID.change(repair="yes", repair_below=0.99)),
    "passages": (passages, turned_blades()),
}


@pytest.mark.parametrize(("name", "ending"), one_of_each_fast(tuple(CASES), ["su2", "su2b"]))
def test_bits_are_those_of_a_run_in_memory(tmp_path, monkeypatch, name, ending):
    make, case = CASES[name]
    path = make(tmp_path)
    if ending == "su2b":
        sv.convert(path, path.with_suffix(".su2b"))
        path = path.with_suffix(".su2b")
    mesh = sv.read(path)
    steps = list(sv.deform(case, mesh, certify=True))
    found = sv.quality(steps[-1].mesh, mesh)
    sv.write(tmp_path / f"memory.{ending}", steps[-1].mesh)
    assert len(found.inverted_cells(100)) or name not in ("folded", "repaired")
    monkeypatch.setattr(streamed_run, "CHUNK", 37)
    monkeypatch.setattr(streamed_repair, "CELLS", 37)
    done = stream(case.change(mesh_file=path), tmp_path / f"out.{ending}", worst=5)
    assert (done.mesh.zone, done.mesh.zones) == (None, 2)
    moved = sv.read(tmp_path / f"out.{ending}")
    assert np.array_equal(bits(moved.points), bits(steps[-1].mesh.points))
    out, memory = ((tmp_path / f"{one}.{ending}").read_bytes() for one in ("out", "memory"))
    assert out == memory
    require_same(done, steps, mesh)
    assert np.array_equal(done.quality.totals.worst, found.worst(5))
    for one, other in zip(steps, done.steps, strict=True):
        whole, part = one.repaired, other.repaired
        assert (whole is None) == (part is None)
        if whole is not None:
            assert whole.report() == part.report()
            at = np.searchsorted(part.mesh.numbering.points, whole.nodes)
            assert np.array_equal(part.mesh.points[at], whole.mesh.points[whole.nodes])
            at = np.searchsorted(part.mesh.numbering.cells, whole.cells)
            there = part.mesh.numbering.points[part.mesh.cells.take(at).connectivity]
            assert np.array_equal(there, whole.mesh.cells.take(whole.cells).connectivity)
    assert not list(tmp_path.glob(".*"))


def test_repair_of_a_zone_is_seen_by_the_zones_that_follow_it(tmp_path):
    make, case = CASES["slid and repaired"]
    mesh = sv.read(make(tmp_path))
    *_, step = sv.deform(case, mesh)
    assert step.repaired is not None
    assert len(np.intersect1d(step.repaired.nodes, mesh.marker("1:x_p").nodes))


def test_a_text_becomes_binary_and_back(tmp_path):
    path, case = rows(tmp_path), both()
    sv.convert(path, tmp_path / "rows.su2b")
    points = list(sv.deform(case, sv.read(path)))[-1].mesh.points
    for source, target in (("stage.su2", "out.su2b"), ("rows.su2b", "out.su2")):
        told: list[str] = []
        stream(case.change(mesh_file=tmp_path / source), tmp_path / target, warn=told.append)
        assert told == [""]
        moved = sv.read(tmp_path / target)
        assert np.array_equal(bits(moved.points), bits(points))
        assert moved.marker_names == sv.read(path).marker_names


def test_zones_are_read_through_one_lock(tmp_path, monkeypatch):
    """Threads write the zones of a text; a file has one place at which it is read."""
    files = []
    patched = streamed_run.patched_text

    def spied(texts, moved, boxes):
        files.extend(zone.points.file for zone in moved)
        return patched(texts, moved, boxes)

    monkeypatch.setattr(streamed_run, "patched_text", spied)
    stream(both().change(mesh_file=rows(tmp_path)), tmp_path / "out.su2")
    assert len(files) == 2
    assert files[0] is files[1]


def test_walls_need_all_cells(tmp_path):
    sv.convert(rows(tmp_path), tmp_path / "rows.su2b")
    skin = read_skin(tmp_path / "rows.su2b", 1)
    assert isinstance(skin, Skin)
    with pytest.raises(MeshError, match="walls need all cells in memory"):
        sv.walls(skin)
    both_zones = read_skin(tmp_path / "rows.su2b", None)
    assert isinstance(both_zones, Skin)
    assert isinstance(both_zones, Assembly)
    assert len(both_zones.parts) == 2
    assert both_zones.numbering.n_points == len(sv.read(tmp_path / "rows.su2b").points)
