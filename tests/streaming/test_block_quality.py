"""Commands that look at a mesh, with --stream: the words and numbers of one in memory."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.samples.table import write_sample
from slideviz.session.large import first_frame
from slideviz.streaming import block_quality, skin, source
from slideviz.system.cleanup import PREFIX
from tests.builders import grid
from tests.formats.test_su2b import WHOLE, change
from tests.slow import one_of_each_fast


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A folder as current one, where blocks have few cells."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scratch").mkdir()
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path / "scratch"))
    for module in (source, block_quality):
        monkeypatch.setattr(module, "CELLS", 29)
    monkeypatch.setattr(skin, "BLOCK", 31)
    return tmp_path


def without_walls(text):
    """Return a text; of JSON what it has but the walls, which streamed commands do not measure."""
    if '"walls"' not in text:
        return text
    report = json.loads(text)
    del report["walls"]
    return report


def both(capsys, *words):
    """Return what a command gives in memory and streamed: code, words and picture."""
    found = []
    for more in ((), ("--stream",)):
        code = run([*words, *more])
        picture = Path("a.png")
        said = capsys.readouterr()
        image = picture.read_bytes() if picture.exists() else b""
        found.append((code, without_walls(said.out), said.err, image))
        picture.unlink(missing_ok=True)
    assert not list(Path("scratch").iterdir())
    return found


def meshes(folder, kind):
    """Write two zones of a mesh, undeformed and deformed, with folds and a point without cell."""
    mesh = grid((5, 4, 4), kind=kind)
    mesh = replace(mesh, points=np.concatenate([mesh.points, [[0.3, 0.2, 0.9]]]))
    moved = mesh.points + 0.3 * np.sin(7.0 * mesh.points[:, ::-1])
    for name, points in (("base", mesh.points), ("moved", moved)):
        sv.write(folder / "a.su2", mesh.with_points(points))
        text = (folder / "a.su2").read_text()
        sv.write(folder / "b.su2", mesh.with_points(0.5 * points + [0.8, 0.1, 0.2]))
        other = (folder / "b.su2").read_text()
        (folder / "two.su2").write_text(f"NZONE= 2\nIZONE= 1\n{text}IZONE= 2\n{other}")
        sv.convert(folder / "two.su2", folder / f"{name}.su2b")
        (folder / "two.su2").replace(folder / f"{name}.su2")


SMALL = ("-o", "a.png", "--size", "640x400")
WORDS = [
    ("info", "base.su2b"),
    ("info", "base.su2b", "--json", "-", "--zone", "2"),
    ("quality", "base.su2b", "--zone", "2", "--metric", "rbf-slide"),
    ("quality", "moved.su2b", "--reference", "base.su2b"),
    ("quality", "moved.su2b", "--reference", "base.su2b", "--json", "-"),
    ("section", "moved.su2b", "--reference", "base.su2b", "--plane", "z=0.5", *SMALL),
    ("section", "base.su2b", "--plane", "1,1,1,0.5,0.5,0.5", "--whole", *SMALL),
    (
        *("section", "moved.su2b", "--reference", "base.su2b", "--color", "displacement"),
        *("--plane", "x=0.41", *SMALL, "--json", "-"),
    ),
    ("section", "base.su2b", "--plane", "z=99", *SMALL),
]
KINDS = [("su2b", "mixed"), ("su2", "mixed"), ("su2b", "tetrahedron"), ("su2", "tetrahedron")]


@pytest.mark.parametrize(("words", "kind"), one_of_each_fast(WORDS, KINDS))
def test_what_is_told_is_the_same(small, capsys, words, kind):
    ending, cells = kind
    meshes(small, cells)
    words = [word.replace(".su2b", f".{ending}") for word in words]
    one, other = both(capsys, *words)
    assert one == other
    assert one[0] in ((0, 3) if "z=99" not in words else (1,))
    assert bool(one[3]) == (words[0] == "section" and "z=99" not in words)


@pytest.mark.parametrize(
    "where",
    [("--cylinder", "0.275"), pytest.param(("--plane", "z=0.05"), marks=pytest.mark.slow)],
)
def test_passages_are_those_of_the_mesh_in_memory(small, capsys, where):
    write_sample("stator", small, 5000, file_format="su2b")
    call = ["section", "mesh.su2b", "--case", "stator.cfg", "--copies", "1", *SMALL]
    one, other = both(capsys, *call, *where, "--json", "-")
    assert one == other
    assert one[0] == 0


def test_what_cannot_be_streamed_is_told(small, capsys):
    meshes(small, "mixed")
    sv.write("flat.su2b", grid((4, 4)))
    sv.write("other.su2b", grid((5, 4, 4)))
    sv.convert("a.su2", "a.vtu")
    Path("case.cfg").write_text("MESH_FILENAME= a.vtu\n")
    for words, said in (
        (["info", "a.vtu"], "a.vtu: only SU2 meshes, text or binary, can be streamed; make one"),
        (["quality", "moved.su2b", "-o", "a.vtu"], "-o needs the mesh in memory; leave it out"),
        (["quality", "moved.su2b", "--reference", "a.vtu"], "a.vtu: only SU2 meshes, text or"),
        (["quality", "moved.su2b", "--case", "case.cfg"], "a.vtu: only SU2 meshes, text or"),
        (
            ["quality", "moved.su2b", "--reference", "other.su2b"],
            "other.su2b cannot be the reference of moved.su2b: it must have the same cells",
        ),
        (["section", "flat.su2b", "--plane", "x=0.5", "-o", "a.png"], "flat.su2b is 2D, where all"),
    ):
        assert run([*words, "--stream"]) == 1
        assert said in capsys.readouterr().err


def test_no_place_for_the_copy_of_a_text_is_told(small, capsys):
    sv.write("mesh.su2", grid((4, 4)))
    Path("scratch").rmdir()
    assert run(["info", "mesh.su2", "--stream"]) == 1
    said = capsys.readouterr().err
    assert "mesh.su2: its binary copy cannot be written in " in said
    assert "the folder does not exist; create it first (TMPDIR names another folder)" in said


def test_mistakes_of_the_file_are_told(small):
    """An index that stands twice would leave another cell without a value."""
    Path("mesh.su2b").write_bytes(change(WHOLE, 80, "<Q", 1))
    for words in (["info"], ["quality"]):
        assert run([*words, "mesh.su2b", "--stream"]) == 1


def turned_half(points=None):
    """Return a square whose cells are numbered in both directions."""
    mesh = grid((8, 8))
    turned = mesh.cells.connectivity.reshape(-1, 4).copy()
    turned[32:] = turned[32:, ::-1]
    cells = sv.Cells.from_types(mesh.cells.types, turned.ravel())
    return replace(mesh, cells=cells, points=mesh.points if points is None else points)


def test_cells_numbered_both_ways_are_those_in_memory(small, capsys):
    mesh = turned_half()
    sv.write("mesh.su2b", mesh)
    points = mesh.points.copy()
    points[40] += 0.9
    sv.write("moved.su2b", turned_half(points))
    for words in (["mesh.su2b"], ["moved.su2b", "--reference", "mesh.su2b"]):
        told = []
        for more in ([], ["--stream"]):
            assert run(["quality", *words, "--json", "-", *more]) in (0, 3)
            told.append(without_walls(capsys.readouterr().out))
        assert told[0] == told[1]
    assert sv.quality(sv.read("moved.su2b"), mesh).inverted


def test_cells_numbered_both_ways_or_folded_are_refused(small, capsys):
    points = grid((8, 8)).points.copy()
    points[40] += 0.9
    sv.write("mesh.su2b", turned_half(points))
    assert run(["quality", "mesh.su2b", "--stream"]) == 1
    said = capsys.readouterr().err
    assert "numbered the other way round" in said
    assert "compare a deformed mesh with --reference UNDEFORMED, run it without --stream" in said


def test_another_order_of_the_reference_is_told(small):
    meshes(small, "mixed")
    path = Path("base.su2b")
    mesh = sv.read(path, 1)
    assert source.has_cells_of((path, 1), (Path("moved.su2b"), 1))
    order = np.arange(len(mesh.cells))[::-1].copy()
    form = replace(mesh.origin, order=order)
    sv.write("turned.su2b", replace(mesh, origin=form))
    again = sv.read("turned.su2b", 1)
    assert again.cells.same_as(mesh.cells)
    with pytest.raises(MeshError, match="has its cells in another order than"):
        source.has_cells_of((path, 1), (Path("turned.su2b"), 1))


def test_numbers_of_cells_are_in_files_that_end(small):
    sv.write("mesh.su2b", grid((4, 4)))
    from contextlib import ExitStack

    with ExitStack() as stack:
        mesh = source.FileSource.open(stack, (Path("mesh.su2b"), None))
        counts = block_quality.CellCounts(mesh)
        block_quality.measure_mesh(stack, Path("scratch"), mesh, counts=counts)
        assert len(list(Path("scratch").glob(f"{PREFIX}*"))) == 2
        assert counts.types == {9: 16}
    assert not list(Path("scratch").iterdir())


def test_no_place_for_the_numbers_of_cells_is_told(small, capsys, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    sv.write(small / "mesh.su2b", grid((3, 3, 3)))
    monkeypatch.setattr(os, "posix_fallocate", full, raising=False)
    assert run(["info", "mesh.su2b", "--stream"]) == 1
    why = "the disk is full; free some space or choose another disk (TMPDIR names another folder)"
    message = f"{small / 'scratch'}: a temporary file of 0 MB cannot be written there: {why}"
    assert capsys.readouterr().err == f"slideviz: {message}\n"
    assert not list((small / "scratch").iterdir())
    with pytest.raises(MeshError, match="the disk is full"):
        first_frame(skin.read_skin(small / "mesh.su2b", None), "knupp", lambda _: None)
    assert not list((small / "scratch").iterdir())
