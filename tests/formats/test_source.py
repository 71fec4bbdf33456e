"""Files that stay open while their mesh is worked on: what happens to them meanwhile."""

import gc
import os
from dataclasses import replace
from pathlib import Path

import pytest

from slideviz.errors import MeshError
from slideviz.formats import source
from slideviz.formats.files import read, write
from slideviz.formats.source import Source, open_source
from slideviz.formats.su2.read import read_su2
from tests.formats.su2_samples import MESSY, SQUARE, assert_same, save


@pytest.fixture(params=["in memory", "open"])
def path(request, tmp_path, monkeypatch):
    if request.param == "open":
        monkeypatch.setattr("slideviz.formats.source.KEPT_BYTES", 0)
    return save(tmp_path, MESSY)


def moved_text(mesh, folder) -> bytes:
    write(folder / "moved.su2", mesh.with_points(mesh.points / 3))
    return (folder / "moved.su2").read_bytes()


def test_any_part_of_it(path):
    opened, raw = open_source(path), MESSY.encode()
    assert opened.size == len(raw)
    for part in (slice(None), slice(7), slice(3, 40), slice(90, None), slice(5, 5), slice(0, 9999)):
        assert opened[part] == raw[part]


def test_it_may_be_replaced_or_removed(path, tmp_path):
    mesh = read(path)
    if os.environ.get("SLIDEVIZ_TESTS") == "portable" and source.KEPT_BYTES == 0:
        with pytest.raises(MeshError, match="it is open, here or in another program; close it"):
            write(path, mesh.with_points(mesh.points + 1), overwrite=True)
        return
    before = moved_text(mesh, tmp_path)
    write(path, mesh.with_points(mesh.points + 1), overwrite=True)
    assert moved_text(mesh, tmp_path) == before
    path.unlink()
    assert moved_text(mesh, tmp_path) == before


@pytest.mark.parametrize("text", ["", MESSY + " ", MESSY.replace("lower", "upper")])
def test_what_is_kept_in_memory_may_be_changed(tmp_path, text):
    path = save(tmp_path, MESSY)
    mesh = read(path)
    before = moved_text(mesh, tmp_path)
    path.write_text(text)
    assert moved_text(mesh, tmp_path) == before


@pytest.mark.parametrize("text", ["", SQUARE, MESSY + " ", MESSY.replace("lower", "upper")])
@pytest.mark.parametrize("anew", [False, True])
def test_what_is_open_may_not(tmp_path, monkeypatch, text, anew):
    monkeypatch.setattr("slideviz.formats.source.KEPT_BYTES", 0)
    path = save(tmp_path, MESSY)
    mesh = read(path)
    if anew:
        mesh = replace(mesh, markers=mesh.markers[:1])
    path.write_text(text)
    os.utime(path, (1, 1))
    with pytest.raises(MeshError, match=r"grid.su2: was changed while it was in use; read it aga"):
        moved_text(mesh, tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["grid.su2"]


class Changing(Source):
    """A file that is another one when it is read once more."""

    def __init__(self, first: bytes, then: bytes, reads: int) -> None:
        super().__init__(Path("grid.su2"), first)
        self.then, self.left = then, reads

    def __getitem__(self, part: slice) -> bytes:
        self.left -= 1
        return super().__getitem__(part) if self.left >= 0 else self.then[part]


@pytest.mark.parametrize(
    "row", ["0 0 1\n" * 6, "%%%%%%\n" * 6, "0.1 0.3\n0.1\n" * 40, "5 1 4 2\n" * 90, "1" * 400]
)
@pytest.mark.parametrize("part", ["9 0 1 4 3 0\n", "0.1 0.3 0\n1.1 0.3 1\n"])
def test_no_change_while_it_is_read_gets_past_the_arrays(row, part):
    """Whatever the rows are by then: an error, or a mesh."""
    then = SQUARE.replace(part, row).encode()[: len(SQUARE)].ljust(len(SQUARE), b"\n")
    seen = set()
    for reads in range(40):
        try:
            read_su2(Changing(SQUARE.encode(), then, reads), None, lambda _: None)
            seen.add("read")
        except MeshError as problem:
            seen.add(str(problem).partition("grid.su2:")[2][:12])
    assert "read" in seen
    assert len(seen) > 1


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_open_files_are_closed(tmp_path, monkeypatch):
    monkeypatch.setattr("slideviz.formats.source.KEPT_BYTES", 0)
    path = save(tmp_path, SQUARE)
    gc.collect()
    before = open_files()
    meshes = [read(path) for _ in range(5)]
    assert open_files() == before + 5
    assert_same(meshes[0], meshes[4])
    del meshes
    gc.collect()
    assert open_files() == before
