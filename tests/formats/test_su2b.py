"""SU2 binary meshes: against bytes written one after the other, against text, and damaged."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slideviz.errors import MeshError
from slideviz.formats.files import convert, read, write
from slideviz.formats.su2b import read as su2b
from slideviz.formats.su2b import write as su2b_write
from slideviz.formats.su2b.read import element_blocks
from slideviz.formats.su2b.write import su2b_blocks
from slideviz.mesh.elements import ELEMENTS
from slideviz.mesh.halo import Halo
from slideviz.mesh.model import Cells, Marker, Mesh
from tests.builders import grid

TWO_D = (
    2,
    [(5, (0, 1, 4)), (9, (1, 2, 3, 4))],
    [(0.0, 0.0), (1.0, 0.1), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)],
    [("low", [(3, (0, 1)), (3, (1, 2))]), ("rest", [(3, (2, 3))])],
)
"""Dimension, elements, points, markers of a small mesh."""
THREE_D = (
    3,
    [(12, tuple(range(8))), (14, (4, 5, 6, 7, 8))],
    [
        *((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
        (0.5, 0.5, 1 / 3 + 1),
    ],
    [("floor", [(9, (0, 1, 2, 3))]), ("roof", [(5, (4, 5, 8))]), ("none", [])],
)


def packed(zones, width=8, order="<", ids=None):
    """The bytes of a file, number by number as the format is described."""
    conn = {4: "I", 8: "Q"}[width]
    out = []

    def put(form, *values):
        out.extend(struct.pack(order + form, value) for value in values)

    put("i", width, len(zones))
    for number, (dim, elements, points, markers) in enumerate(zones, 1):
        put("i", number, dim)
        put(conn, len(elements))
        at = 0
        put(conn, 0)
        for _, nodes in elements:
            at += len(nodes) + 2
            put(conn, at)
        for k, (kind, nodes) in enumerate(elements):
            put(conn, kind, *nodes, k if ids is None else ids[k])
        put(conn, len(points))
        for k, point in enumerate(points):
            put("d", *point)
            put(conn, k)
        put("i", len(markers))
        for name, sides in markers:
            out.append(name.encode().ljust(33, b"\0"))
            put(conn, len(sides), 0)
            at = 0
            for _, nodes in sides:
                at += len(nodes) + 1
                put(conn, at)
            for kind, nodes in sides:
                put(conn, kind, *nodes)
    return b"".join(out)


def made(zone):
    """The mesh of such a table."""
    _, elements, points, markers = zone

    def cells(rows):
        return Cells.from_types([t for t, _ in rows], [n for _, nodes in rows for n in nodes])

    sides = tuple(Marker(name, cells(rows)) for name, rows in markers)
    return Mesh(np.array(points, float), cells(elements), sides)


def same(one, other):
    """Both have the same bits."""
    assert one.marker_names == other.marker_names
    assert one.cells.same_as(other.cells)
    assert all(a.cells.same_as(b.cells) for a, b in zip(one.markers, other.markers, strict=True))
    assert np.array_equal(one.points.view(np.int64), other.points.view(np.int64))
    return True


def stored(tmp_path, data, name="mesh.su2b"):
    path = tmp_path / name
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("chunk", [1, 2, 1 << 18])
def test_both_widths_and_byte_orders_are_read(tmp_path, monkeypatch, width, order, chunk):
    monkeypatch.setattr(su2b_write, "BLOCK", chunk)
    monkeypatch.setattr(su2b.point_blocks, "__defaults__", (chunk,))
    monkeypatch.setattr(element_blocks, "__defaults__", (chunk,))
    data = packed([TWO_D, THREE_D], width, order)
    path = stored(tmp_path, data)
    for number, zone in enumerate((TWO_D, THREE_D), 1):
        found = read(path, zone=number)
        assert same(found, made(zone))
        assert (found.zone, found.zones) == (number, 2)
        write(tmp_path / "again.su2b", found)
        assert (tmp_path / "again.su2b").read_bytes() == data
        moved = found.with_points(found.points + 0.25)
        write(tmp_path / "moved.su2b", moved)
        there = [
            (dim, cells, [tuple(np.add(p, 0.25)) for p in points] if k == number else points, sides)
            for k, (dim, cells, points, sides) in enumerate((TWO_D, THREE_D), 1)
        ]
        assert (tmp_path / "moved.su2b").read_bytes() == packed(there, width, order)


def test_a_file_is_written_as_su2_does(tmp_path):
    for zone in (TWO_D, THREE_D):
        write(tmp_path / "out.su2b", made(zone))
        assert (tmp_path / "out.su2b").read_bytes() == packed([zone])


def test_elements_are_sorted_by_type_and_keep_their_numbers(tmp_path):
    dim, (triangle, quad), points, markers = TWO_D
    mesh = made((dim, [quad, triangle], points, markers))
    write(tmp_path / "out.su2b", mesh)
    assert (tmp_path / "out.su2b").read_bytes() == packed([TWO_D], ids=[1, 0])
    assert same(read(tmp_path / "out.su2b"), mesh)
    write(tmp_path / "again.su2b", read(tmp_path / "out.su2b"))
    assert (tmp_path / "again.su2b").read_bytes() == packed([TWO_D], ids=[1, 0])


def test_an_order_that_is_not_su2s_is_kept(tmp_path):
    dim, (triangle, quad), points, markers = TWO_D
    data = packed([(dim, [quad, triangle, triangle], points, markers)], ids=[2, 0, 1])
    mesh = read(stored(tmp_path, data))
    assert mesh.cells.types.tolist() == [5, 5, 9]
    write(tmp_path / "again.su2b", mesh)
    assert (tmp_path / "again.su2b").read_bytes() == data


def test_other_cells_are_written_anew_and_other_zones_stay(tmp_path):
    mesh = read(stored(tmp_path, packed([TWO_D, THREE_D], 4, ">")), zone=2)
    cells = Cells.from_blocks([(14, [[4, 5, 6, 7, 8]])])
    markers = (Marker("roof", Cells.from_blocks([(5, [[4, 5, 8]])])),)
    write(tmp_path / "out.su2b", replace(mesh, cells=cells, markers=markers))
    dim, elements, points, sides = THREE_D
    wanted = packed([TWO_D, (dim, elements[1:], points, sides[1:2])], 4, ">")
    assert (tmp_path / "out.su2b").read_bytes() == wanted


def test_the_content_tells_where_the_ending_does_not(tmp_path):
    for name in ("mesh.su2", "mesh.dat", "mesh"):
        assert same(read(stored(tmp_path, packed([TWO_D]), name)), made(TWO_D))
    write(tmp_path / "out.txt", made(TWO_D), file_format="su2b")
    assert (tmp_path / "out.txt").read_bytes() == packed([TWO_D])
    with pytest.raises(MeshError, match="this is not an SU2 binary mesh"):
        read(stored(tmp_path, b"NDIME= 2\n", "mesh.su2"), file_format="su2b")


numbers = st.floats(-1e30, 1e30, allow_subnormal=True)


@st.composite
def meshes(draw):
    dim = draw(st.sampled_from([2, 3]))
    count = draw(st.integers(8, 20))
    points = draw(
        st.lists(st.lists(numbers, min_size=dim, max_size=dim), min_size=count, max_size=count)
    )

    def rows(of, least):
        kinds = [vtk for vtk, row in ELEMENTS.items() if row.dim == of]
        found = draw(st.lists(st.sampled_from(kinds), min_size=least, max_size=9))
        order = st.permutations(range(count))
        return Cells.from_types(
            found, [n for vtk in found for n in draw(order)[: ELEMENTS[vtk].n_nodes]]
        )

    letters = st.text("abcXYZ_.-1é", min_size=1, max_size=16)
    names = draw(st.lists(letters, max_size=3, unique=True))
    return Mesh(
        np.array(points), rows(dim, 1), tuple(Marker(name, rows(dim - 1, 0)) for name in names)
    )


@settings(max_examples=60, deadline=None)
@given(meshes(), st.sampled_from([4, 8]), st.sampled_from(["<", ">"]))
def test_text_and_binary_hold_the_same_bits(tmp_path_factory, mesh, width, order):
    folder = tmp_path_factory.mktemp("su2b")
    write(folder / "a.su2", mesh)
    convert(folder / "a.su2", folder / "a.su2b")
    convert(folder / "a.su2b", folder / "b.su2")
    assert (folder / "a.su2").read_bytes() == (folder / "b.su2").read_bytes()
    found = read(folder / "a.su2b")
    assert same(found, mesh)
    form = replace(found.origin, width=width, byte_order=order)
    form = replace(form, before=struct.pack(order + "ii", width, 1))
    other = b"".join(su2b_blocks(replace(found, origin=form)))
    assert same(read(stored(folder, other, "c.su2b")), mesh)


def test_all_zones_are_converted_or_the_one_that_is_asked_for(tmp_path):
    path = stored(tmp_path, packed([THREE_D, THREE_D]))
    convert(path, tmp_path / "text.su2")
    assert same(read(tmp_path / "text.su2", zone=2), made(THREE_D))
    convert(tmp_path / "text.su2", tmp_path / "back.su2b")
    assert (tmp_path / "back.su2b").read_bytes() == packed([THREE_D, THREE_D])
    convert(tmp_path / "text.su2", tmp_path / "one.su2b", zone=2)
    assert (tmp_path / "one.su2b").read_bytes() == packed([THREE_D])
    convert(path, tmp_path / "same.su2b")
    assert (tmp_path / "same.su2b").read_bytes() == path.read_bytes()
    told = []
    convert(path, tmp_path / "out.vtu", warn=told.append)
    assert len(read(tmp_path / "out.vtu").cells) == 2 * len(made(THREE_D).cells)
    assert "lacks the division into zones" in told[0]


# Mistakes ------------------------------------------------------------------------------------


def change(data, at, form, *values):
    """The bytes with other numbers at a place."""
    new = struct.pack(form, *values)
    return data[:at] + new + data[at + len(new) :]


WHOLE = packed([TWO_D])
CELLS = 16
OFFSETS, LIST = CELLS + 8, CELLS + 8 + 3 * 8
POINTS = LIST + 11 * 8
MARKERS = POINTS + 8 + 5 * 24
NAME = MARKERS + 4
MISTAKES = [
    (WHOLE[:3], "byte 0: this is not an SU2 binary mesh.*not with 08 00 00"),
    (b"", "byte 0: .*not with nothing"),
    (change(WHOLE, 0, "<i", 7), "byte 0: this is not an SU2 binary mesh"),
    (change(WHOLE, 4, "<i", 0), "byte 4: the number of zones is 0, but at least 1"),
    (change(WHOLE, 4, "<i", 2), "the number of zone 2 .* the file ends at byte"),
    (change(WHOLE, 8, "<i", 2), "byte 8: zone 1 has the number 2"),
    (change(WHOLE, 12, "<i", 4), "byte 12: the dimension is 4, but must be 2 or 3"),
    (change(WHOLE, CELLS, "<Q", 2**60), "byte 24: the offsets of the elements .* the count is wro"),
    (change(WHOLE, OFFSETS + 16, "<Q", 10**9), "the list of the elements .* cut off or the count"),
    (change(WHOLE, OFFSETS + 16, "<Q", 8), "2 elements have a list of 8 numbers, but each needs"),
    (change(WHOLE, OFFSETS, "<Q", 1), "byte 24: the offset of element 0 is 1, which must be 0"),
    (
        change(WHOLE, OFFSETS + 8, "<Q", 2**63),
        "byte 32: the offset of element 1 is 9223372036854775",
    ),
    (change(WHOLE, OFFSETS + 8, "<Q", 6), "byte 48: element 0 has 6 numbers, but a triangle has 3"),
    (change(WHOLE, LIST, "<Q", 22), "byte 48: element 0 has the type 22, which is not supported"),
    (change(WHOLE, LIST, "<Q", 2**64 - 1), "the type 18446744073709551615"),
    (change(WHOLE, LIST + 5 * 8, "<Q", 10), "element 1 is a tetrahedron .type 10, dimension 3."),
    (change(WHOLE, LIST + 8, "<Q", 5), "byte 56: element 0 has the node 5, .* from 0 to 4"),
    (change(WHOLE, LIST + 7 * 8, "<Q", 2**64 - 2), "byte 104: element 1 has the node 184467440737"),
    (change(WHOLE, LIST + 8, "<Q", 1), "byte 48: element 0: node 1 occurs twice in one triangle"),
    (change(WHOLE, LIST + 4 * 8, "<Q", 1), "element 1 has the index 1, .* occurs twice"),
    (
        change(WHOLE, LIST + 4 * 8, "<Q", 2),
        "byte 80: element 0 has the index 2, which is not below",
    ),
    (change(WHOLE, POINTS, "<Q", 2**58), "the points .* should be here, but the file ends"),
    (
        change(WHOLE, POINTS + 8 + 16, "<Q", 3),
        "point 0 has the index 3; points are numbered from 0",
    ),
    (
        change(WHOLE, POINTS + 40, "<d", np.inf),
        "point 1 has the coordinate inf, which is not finit",
    ),
    (change(WHOLE, MARKERS, "<i", -1), "the number of markers is -1, but must not be negative"),
    (change(WHOLE, MARKERS, "<i", 10**6), "the markers .1000000 times 49 bytes. should be here"),
    (change(WHOLE, NAME, "33s", b"\0"), "the marker name '' is empty or not printable"),
    (change(WHOLE, NAME, "33s", b"\xff"), "is empty or not printable UTF-8"),
    (change(WHOLE, NAME, "33s", b"a" * 33), "is not ended by a zero"),
    (change(WHOLE, NAME, "33s", b"rest"), "marker rest occurs a second time"),
    (change(WHOLE, NAME, "33s", b"send_receive"), "cannot have send_receive markers .halos."),
    (WHOLE + b"12", "2 bytes follow the last of the 1 zones"),
]


@pytest.mark.parametrize(("data", "message"), MISTAKES)
def test_a_mistake_is_told_with_its_byte(tmp_path, data, message):
    with pytest.raises(MeshError, match=message) as caught:
        read(stored(tmp_path, data))
    assert str(caught.value).startswith(f"{tmp_path / 'mesh.su2b'}: byte ")


def test_every_cut_is_told(tmp_path):
    data = packed([TWO_D, THREE_D], 4)
    for end in range(len(data)):
        with pytest.raises(MeshError, match=r"byte \d+"):
            read(stored(tmp_path, data[:end]))


def test_damaged_files_are_read_or_refused(tmp_path):
    random = np.random.default_rng(7)
    whole = [packed([TWO_D, THREE_D], w, o) for w in (4, 8) for o in "<>"]
    refused = []
    for _ in range(1000):
        data = bytearray(whole[random.integers(4)])
        for _ in range(random.integers(1, 4)):
            data[random.integers(len(data))] = random.integers(256)
        path = stored(tmp_path, bytes(data))
        try:
            mesh = read(path, zone=int(random.integers(1, 3)))
        except MeshError as problem:
            refused.append(str(problem))
        else:
            assert mesh.cells.connectivity.max() < len(mesh.points)
    assert 300 < len(refused) < 1000
    assert all(text.startswith(str(path)) for text in refused)


def test_zones_that_are_not_there_are_told(tmp_path):
    path = stored(tmp_path, packed([TWO_D, THREE_D]))
    with pytest.raises(MeshError, match="there is no zone 3; the file has the zones 1 to 2"):
        read(path, zone=3)
    with pytest.raises(MeshError, match="there is no such file"):
        read(tmp_path / "none.su2b")
    with pytest.raises(MeshError, match="this is a folder"):
        read(tmp_path, file_format="su2b")


def test_what_cannot_be_held_is_refused(tmp_path):
    square = grid((2, 2))
    nothing = np.empty(0, np.int64)
    halo = Halo(nothing, nothing, np.empty((0, 2, 2)), nothing, np.zeros(4, bool), (), np.zeros(0))
    with pytest.raises(MeshError, match=r"has a halo .SEND_RECEIVE markers.* write a .su2 file"):
        write(tmp_path / "a.su2b", replace(square, halo=halo))
    for name in ("a" * 33, "", "a\nb", "Send_Receive"):
        bad = replace(square, markers=(Marker(name, square.markers[0].cells),))
        with pytest.raises(MeshError, match="cannot be written to an SU2 binary file"):
            write(tmp_path / "a.su2b", bad)
    assert not (tmp_path / "a.su2b").exists()


def test_reading_can_be_stopped_and_tells_how_far_it_is(tmp_path):
    path = stored(tmp_path, packed([TWO_D]))
    told = []
    read(path, progress=told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0

    class Stop(Exception):
        pass

    def stop(_):
        raise Stop

    with pytest.raises(Stop):
        read(path, progress=stop)


def test_a_file_that_changes_or_fails_while_it_is_read_is_told(tmp_path, monkeypatch):
    path = stored(tmp_path, packed([TWO_D]))
    whole = np.fromfile
    monkeypatch.setattr(np, "fromfile", lambda file, kind, count: whole(file, kind, 0))
    with pytest.raises(MeshError, match=r"byte 4: .* the file became shorter while it was read"):
        read(path)

    def broken(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(np, "fromfile", broken)
    with pytest.raises(MeshError, match=r"cannot be read: .*Input/output error; check the disk"):
        read(path)


def test_four_bytes_hold_only_so_many(monkeypatch):
    found = replace(made(TWO_D))
    form = su2b.BinaryForm(4, "<", b"", b"", None, (), found.cells)
    monkeypatch.setattr(su2b_write, "LARGEST_4", 10)
    with pytest.raises(MeshError, match="more cells than a file with counts of 4 bytes can hold"):
        b"".join(su2b_blocks(replace(found, origin=form)))
