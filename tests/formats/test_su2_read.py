"""What the SU2 reader understands."""

import tracemalloc

import numpy as np
import pytest

import slideviz.formats.su2.text as su2_text
from slideviz.errors import MeshError
from slideviz.formats.files import read
from slideviz.formats.su2.write import su2_blocks
from slideviz.streaming.stream_input import open_read_only
from tests.formats.su2_samples import MESSY, SAMPLES, SOLID, SQUARE, ZONES, assert_same, bits, save


def test_square(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    assert mesh.dim == 2
    assert mesh.points.tolist() == [[x, y] for y in (0.3, 1.7) for x in (0.1, 1.1, 2.1)]
    assert mesh.cells.types.tolist() == [9, 5, 5]
    assert mesh.cells.connectivity.tolist() == [0, 1, 4, 3, 1, 2, 5, 1, 5, 4]
    assert mesh.marker_names == ("lower", "upper")
    assert mesh.marker("lower").cells.connectivity.tolist() == [0, 1, 1, 2]
    assert (mesh.name, mesh.zone, mesh.zones) == ("grid.su2", 1, 1)
    assert mesh.source == (tmp_path / "grid.su2").resolve()


def test_all_kinds_of_cells_in_file_order(tmp_path):
    mesh = read(save(tmp_path, SOLID))
    assert mesh.dim == 3
    assert mesh.cells.types.tolist() == [12, 14, 13, 10]
    assert mesh.cells.offsets.tolist() == [0, 8, 13, 19, 23]
    assert mesh.cells.connectivity[8:13].tolist() == [4, 5, 6, 7, 8]
    assert mesh.marker("floor").cells.types.tolist() == [9, 5]


def test_arrays_are_read_only(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    for array in (mesh.points, mesh.cells.connectivity, mesh.markers[0].cells.connectivity):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_untidy_file_gives_the_same_mesh(tmp_path):
    tidy, messy = read(save(tmp_path, SQUARE)), read(save(tmp_path, MESSY, "messy.su2"))
    assert messy.marker_names == ("lower", "upper wall")
    assert bits(messy.points) == bits(tidy.points)
    assert messy.cells.same_as(tidy.cells)
    for a, b in zip(messy.markers, tidy.markers, strict=True):
        assert a.cells.same_as(b.cells)


def test_byte_order_mark_is_skipped(tmp_path):
    assert_same(read(save(tmp_path, "\ufeff" + SQUARE)), read(save(tmp_path, SQUARE, "plain.su2")))


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("block", [1, 7, 40])
def test_size_of_the_blocks_does_not_matter(tmp_path, monkeypatch, name, block):
    path = save(tmp_path, SAMPLES[name])
    whole = read(path, 1)
    monkeypatch.setattr("slideviz.formats.su2.text.BLOCK_BYTES", block)
    small = read(path, 1)
    assert_same(small, whole)
    assert len(small.origin.rows) > len(whole.origin.rows)
    moved = whole.points.copy()
    moved[::2] /= 3
    texts = [b"".join(su2_blocks(mesh.with_points(moved))) for mesh in (small, whole)]
    assert texts[0] == texts[1] != path.read_bytes()


@pytest.mark.parametrize("text", ["0.1", "-0.0", "5e-324", "9.9999999999999976e49", "1E+5", "7."])
def test_coordinates_are_correctly_rounded(tmp_path, text):
    mesh = read(save(tmp_path, SQUARE.replace("0.1 0.3 0\n", f"{text} 0.3 0\n")))
    assert bits(mesh.points[0, :1]) == bits(np.array([float(text)]))


def test_digits_beyond_a_double_decide_the_last_bit(tmp_path):
    # Just above and just below the middle between 1 and the next number.
    low, high = "1.00000000000000011102230246251565", "1.0000000000000001110223024625156541"
    text = SQUARE.replace("0.1 0.3 0\n", f"{low} {high} 0\n")
    assert read(save(tmp_path, text)).points[0].tolist() == [1.0, float(high)]
    assert float(high) > 1.0


def test_zones(tmp_path):
    path = save(tmp_path, ZONES)
    first, second = read(path, zone=1), read(path, zone=2)
    assert (first.dim, first.zone, first.zones) == (2, 1, 2)
    assert (second.dim, second.zone, second.zones) == (3, 2, 2)
    assert_same(first, read(save(tmp_path, SQUARE, "one.su2"), zone=1))
    assert_same(second, read(save(tmp_path, SOLID, "two.su2")))


def test_zones_of_different_dimensions_are_no_mesh_together(tmp_path):
    with pytest.raises(MeshError, match="its zones are 2D, 3D, which cannot be one mesh; choose"):
        read(save(tmp_path, ZONES))


def test_zones_in_any_order(tmp_path):
    text = f"NZONE= 2\nIZONE= 2\n{SOLID}IZONE= 1\n{SQUARE}"
    assert read(save(tmp_path, text), 1).dim == 2


@pytest.mark.parametrize("head", ["NZONE= 1\n", "NZONE= 1\nIZONE= 1\n", "IZONE= 1\n"])
def test_one_zone(tmp_path, head):
    mesh = read(save(tmp_path, head + SQUARE))
    assert (mesh.zones, len(mesh.cells)) == (1, 3)


def test_no_markers_and_empty_markers(tmp_path):
    bare = SQUARE[: SQUARE.index("NMARK")]
    assert read(save(tmp_path, bare + "NMARK= 0\n")).markers == ()
    mesh = read(save(tmp_path, bare + "NMARK= 1\nMARKER_TAG= none\nMARKER_ELEMS= 0\n"))
    assert mesh.marker_names == ("none",)
    assert len(mesh.markers[0].cells) == 0


def test_another_spelling_that_su2_reads_is_read_with_a_remark(tmp_path):
    text = SQUARE.replace("MARKER_TAG= upper", "MARKERTAG= upper")
    path = save(tmp_path, text)
    mesh = read(path)
    assert_same(mesh, read(save(tmp_path, SQUARE, "usual.su2")))
    (remark,) = mesh.remarks
    assert remark == "line 18 has MARKERTAG=, which is read as MARKER_TAG="
    with open_read_only(path, None, lambda _: None, tmp_path) as given:
        assert given.skin(lambda _: None).remarks == mesh.remarks
    assert b"".join(su2_blocks(mesh)) == text.encode()


def test_ending_does_not_matter_for_a_file_with_keywords(tmp_path):
    for name in ("grid.SU2", "grid", "grid.txt", "grid.mesh"):
        assert len(read(save(tmp_path, SQUARE, name)).cells) == 3


def test_unused_nodes_are_allowed_and_listed(tmp_path):
    text = SQUARE.replace("NPOIN= 6\n", "NPOIN= 8\n").replace("NMARK", "9 9 6\n8 8 7\nNMARK")
    mesh = read(save(tmp_path, text))
    assert np.setdiff1d(np.arange(8), mesh.cells.connectivity).tolist() == [6, 7]
    solid = read(save(tmp_path, SOLID))
    assert np.unique(solid.cells.connectivity).tolist() == list(range(len(solid.points)))


def test_progress_rises_to_one(tmp_path, monkeypatch):
    monkeypatch.setattr(su2_text, "BLOCK_BYTES", 16)
    seen = []
    read(save(tmp_path, SOLID), progress=seen.append)
    assert len(seen) > 20
    assert seen == sorted(seen)
    assert seen[0] > 0
    assert seen[-1] == 1.0


@pytest.mark.parametrize("limit", [0.05, 0.3, 0.7, 1.0])
def test_progress_may_stop_the_reading(tmp_path, limit):
    class StoppedError(OSError):
        pass

    def progress(done):
        if done >= limit:
            raise StoppedError

    with pytest.raises(StoppedError):
        read(save(tmp_path, SOLID), progress=progress)


def test_a_huge_count_takes_no_memory(tmp_path):
    path = save(tmp_path, SQUARE.replace("NELEM= 3", "NELEM= 1000000000000"))
    read(save(tmp_path, SQUARE, "warm.su2"))
    tracemalloc.start()
    with pytest.raises(Exception, match="says 1000000000000"):
        read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10_000_000
