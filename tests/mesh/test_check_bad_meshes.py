"""Every fault of an SU2 file: one sentence with file, line and remedy, and nothing else happens."""

import errno
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from slideviz.errors import MeshError
from slideviz.formats.files import read, write
from slideviz.formats.source import Source
from slideviz.formats.su2.read import read_su2
from slideviz.formats.su2.write import su2_blocks
from slideviz.mesh.check import check_mesh, first_fault
from slideviz.mesh.model import Cells, Marker, Mesh, Origin
from slideviz.mesh.periodic import find_pairs
from slideviz.mesh.quality import quality
from tests.formats.su2_samples import MESSY, SAMPLES, SOLID, SQUARE, ZONES, meshes, save


def line_of(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def edited(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, f"{old!r} must stand once"
    return text.replace(old, new)


# What is changed in SQUARE, the line of the fault, and the message.
FAULTS = {
    "no NDIME": ("NDIME= 2\n", "", 19, "the mesh ends here, but has no line NDIME="),
    "no NELEM": ("NELEM= 3\n", "", 19, "has no line NELEM=; perhaps the file is cut off"),
    "no NPOIN": ("NPOIN= 6\n", "", 19, "has no line NPOIN="),
    "no NMARK": ("NMARK= 2\n", "", 19, "has no line NMARK=.* write NMARK= 0 if it has no bound"),
    "misspelt": ("NELEM= 3\n", "NELEMS= 3\n", 20, "has no line NELEM="),
    "misspelt tag": (
        "MARKER_TAG= lower",
        "MARKER_TAGS= lower",
        15,
        r"MARKER_ELEMS= has no MARKER_TAG= before it; line 14 has MARKER_TAGS=, did you mean MARKE",
    ),
    "misspelt second tag": (
        "MARKER_TAG= upper",
        "MAKER_TAG= upper",
        19,
        "no MARKER_TAG= before it; line 18 has MAKER_TAG=, did you mean MARKER_TAG=",
    ),
    "misspelt elements": (
        "MARKER_ELEMS= 2",
        "MARKER_ELEM= 2",
        14,
        "not followed by MARKER_ELEMS=; line 15 has MARKER_ELEM=, did you mean MARKER_ELEMS=",
    ),
    "misspelt count": ("NPOIN= 6\n", "NPOINT= 6\n", 20, "line 6 has NPOINT=, did you mean NPOIN="),
    "no equals": ("NPOIN= 6\n", "NPOIN 6\n", 20, "has no line NPOIN="),
    "NDIME 1": ("NDIME= 2", "NDIME= 1", 1, "NDIME= 1 is not possible; write 2 or 3"),
    "NDIME 4": ("NDIME= 2", "NDIME= 4", 1, "NDIME= 4 is not possible"),
    "NDIME empty": ("NDIME= 2", "NDIME=", 1, "NDIME=  is not a count; write a whole number"),
    "NDIME two": ("NDIME= 2", "NDIME= two", 1, "NDIME= two is not a count; write a whole number"),
    "NDIME twice": ("NELEM= 3", "NDIME= 2\nNELEM= 3", 2, r"occurs twice \(first on line 1\)"),
    "NELEM negative": (
        "NELEM= 3",
        "NELEM= -3",
        2,
        "NELEM= -3 is not a count; write a whole number",
    ),
    "NELEM fraction": ("NELEM= 3", "NELEM= 3.5", 2, "NELEM= 3.5 is not a count"),
    "NELEM endless": ("NELEM= 3", f"NELEM= {'9' * 5000}", 2, r"NELEM= 9+\.\.\. is not a count"),
    "NELEM huge": ("NELEM= 3", "NELEM= 1000000000000", 6, "only 3 elements precede this line"),
    "NPOIN huge": ("NPOIN= 6", "NPOIN= 1000000000000", 13, "only 6 points precede this line"),
    "NELEM 0": ("NELEM= 3\n9 0 1 4 3 0\n5 1 2 5 1\n5 1 5 4 2", "NELEM= 0", 2, "NELEM= 0 leaves"),
    "NELEM too many": ("NELEM= 3", "NELEM= 4", 6, r"NELEM= 4 \(line 2\) says 4; restore"),
    "NELEM too few": (
        "NELEM= 3",
        "NELEM= 2",
        5,
        r"3 elements are here, but NELEM= 2 \(line 2\) says 2",
    ),
    "NPOIN too many": ("NPOIN= 6", "NPOIN= 7", 13, "only 6 points precede this line, but NPOIN= 7"),
    "NPOIN too few": ("NPOIN= 6", "NPOIN= 5", 12, r"6 points are here, but NPOIN= 5"),
    "NMARK too many": ("NMARK= 2", "NMARK= 3", 13, "NMARK= 3 says 3 markers, but 2 follow"),
    "NMARK too few": ("NMARK= 2", "NMARK= 0", 13, "NMARK= 0 says 0 markers, but 2 follow"),
    "elements too many": ("MARKER_ELEMS= 2", "MARKER_ELEMS= 3", 18, "only 2 elements of marker lo"),
    "elements too few": (
        "MARKER_ELEMS= 2",
        "MARKER_ELEMS= 1",
        17,
        "2 elements of marker lower are here",
    ),
    "no name": ("MARKER_TAG= lower", "MARKER_TAG=", 14, "the marker name '' is empty or not UTF-8"),
    "unprintable": (
        "TAG= lower",
        "TAG= a\x01b",
        14,
        r"the marker name 'a\\x01b' has control characters",
    ),
    "same name": ("TAG= lower", "TAG= upper", 18, r"marker upper occurs twice .*line 14"),
    "no TAG": ("MARKER_TAG= lower\n", "", 14, "MARKER_ELEMS= has no MARKER_TAG= before it"),
    "no ELEMS": ("MARKER_ELEMS= 1\n3 3 4\n", "", 18, "marker upper is not followed by MARKER_ELEM"),
    "ELEMS lost": (
        "MARKER_ELEMS= 2\n",
        "",
        15,
        "numbers follow MARKER_TAG= lower, where",
    ),
    "NMARK numbers": ("NMARK= 2\n", "NMARK= 2\n1 2\n", 14, "numbers follow NMARK= 2"),
    "NDIME numbers": ("NDIME= 2\n", "NDIME= 2\n1 2\n", 2, "numbers follow NDIME= 2, whe"),
    "node too large": (
        "5 1 2 5 1",
        "5 1 2 6 1",
        4,
        "node 6 does not exist: the 6 points .* 0 to 5",
    ),
    "node negative": ("5 1 2 5 1", "5 1 2 -1 1", 4, "node -1 does not exist"),
    "node endless": ("5 1 2 5 1", f"5 1 2 {'9' * 30} 1", 4, f"node {'9' * 30} does not exist"),
    "node far below": ("5 1 2 5 1", f"5 1 2 -{'9' * 30} 1", 4, f"node -{'9' * 30} does not exist"),
    "type endless": ("5 1 2 5 1", f"{'9' * 30} 1 2 5 1", 4, f"element type {'9' * 30} is not"),
    "marker node": ("3 3 4\n", "3 3 6\n", 20, "node 6 does not exist"),
    "node twice": ("5 1 2 5 1", "5 1 2 1 1", 4, "node 1 occurs twice in one triangle; replace"),
    "marker twice": ("3 3 4\n", "3 4 4\n", 20, "node 4 occurs twice in one line"),
    "type 7": (
        "5 1 2 5 1",
        "7 1 2 5 1",
        4,
        r"type 7 is not supported \(supported: 3, 5, 9, 10, 12",
    ),
    "type -5": ("5 1 2 5 1", "-5 1 2 5 1", 4, "element type -5 is not supported"),
    "type 22": (
        "5 1 2 5 1",
        "22 1 2 5 1",
        4,
        "element type 22 .* is a high-order element and slid",
    ),
    "type 105": (
        "5 1 2 5 1",
        "105 1 2 5 1",
        4,
        "element type 105 .* slideviz needs linear elements",
    ),
    "type 261": ("5 1 2 5 1", "261 1 2 5 1", 4, "element type 261 .* high-order"),
    "line as cell": (
        "5 1 2 5 1",
        "3 1 2 1",
        4,
        r"type 3 \(line\) has dimension 1, but dimension 2",
    ),
    "solid as cell": (
        "5 1 2 5 1",
        "10 1 2 5 4",
        4,
        r"type 10 \(tetrahedron\) has dimension 3, but",
    ),
    "cell as side": (
        "3 3 4\n",
        "5 3 4 1\n",
        20,
        r"needed here: 3 \(line\); correct the element or",
    ),
    "vertex as side": ("3 3 4\n", "1 3\n", 20, r"element type 1 \(vertex\) has dimension 0"),
    "too few nodes": (
        "5 1 2 5 1",
        "5 1 2",
        4,
        r"a triangle \(type 5\) has 3 nodes .* but 2 numbers",
    ),
    "too many nodes": ("5 1 2 5 1", "5 1 2 5 4 1", 4, "but 5 numbers follow the type; correct the"),
    "only a type": ("3 3 4\n", "3\n", 20, r"a line \(type 3\) has 2 nodes .* but 0 numbers follow"),
    "fraction as node": ("5 1 2 5 1", "5 1 2.5 5 1", 4, "expected a whole number, found '2.5'"),
    "text as node": ("5 1 2 5 1", "5 1 x 5 1", 4, "expected a whole number, found 'x'"),
    "two in one word": ("5 1 2 5 1", "5 1-2 5 1", 4, "expected a whole number, found '1-2'"),
    "lone sign": ("5 1 2 5 1", "5 1 - 5 1", 4, "expected a whole number, found '-'"),
    "sign at the end": ("3 3 4\n", "3 3 +\n", 20, r"expected a whole number, found '\+'"),
    "text as type": ("5 1 2 5 1", "tri 1 2 5 1", 4, r"expected one of the 3 elements, found 'tri'"),
    "text as point": ("1.1 0.3 1", "x 0.3 1", 8, r"expected one of the 6 points, found 'x'"),
    "nan first": ("1.1 0.3 1", "nan 0.3 1", 8, "expected one of the 6 points, found 'nan'"),
    "nan": ("1.1 0.3 1", "1.1 nan 1", 8, "the coordinate nan is not finite; correct it"),
    "inf": ("1.1 0.3 1", "1.1 -inf 1", 8, "the coordinate -inf is not finite"),
    "overflow": ("1.1 0.3 1", "1.1 1e999 1", 8, "the coordinate 1e999 is not finite"),
    "text in point": ("1.1 0.3 1", "1.1 0,3 1", 8, "expected a number, found '0,3'"),
    "Fortran": ("1.1 0.3 1", "1.1 3.0d-1 1", 8, "expected a number, found '3.0d-1'"),
    "hexadecimal": ("1.1 0.3 1", "1.1 0x1p3 1", 8, "expected a number, found '0x1p3'"),
    "underscore": ("1.1 0.3 1", "1.1 1_0 1", 8, "expected a number, found '1_0'"),
    "odd blank": ("1.1 0.3 1", "1.1\u00a00.3 1", 8, r"expected a number, found '1.1\\xa00.3'"),
    "control": ("1.1 0.3 1", "1.1 \x1f0.3 1", 8, r"expected a number, found"),
    "control first": ("1.1 0.3 1", "\x1f1.1 0.3 1", 8, "expected a number, found"),
    "control before a type": (
        "5 1 2 5 1",
        "\x015 1 2 5 1",
        4,
        r"expected a whole number, found '\\x015'",
    ),
    "lost, and nearly 0": ("0.1 0.3 0\n", "0.1 1e-999\n", 7, "a point has 2 coordinates"),
    "lost coordinate": ("1.1 0.3 1", "1.1 1", 8, r"a point has 2 coordinates \(NDIME= 2\) and"),
    "one coordinate": ("1.1 0.3 1", "1.1", 8, "but this line has 1 numbers; correct the line"),
    "long point": ("1.1 0.3 1", "1.1 0.3 0 0 1", 8, "but this line has 5 numbers"),
    "wrong NDIME": ("NDIME= 2", "NDIME= 3", 3, r"type 9 \(quadrilateral\) has dimension 2, but di"),
    "zones missing": (
        "NDIME= 2",
        "NZONE= 2\nNDIME= 2",
        1,
        "NZONE= 2 needs .* but the file has none",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault(tmp_path, fault):
    old, new, line, message = FAULTS[fault]
    path = save(tmp_path, edited(SQUARE, old, new))
    with pytest.raises(MeshError, match=f"^{re.escape(str(path))}:{line}: .*{message}") as caught:
        read(path)
    assert "\n" not in str(caught.value)


ZONE_FAULTS = {
    "lost": (f"NZONE= 3\nIZONE= 1\n{SQUARE}IZONE= 3\n{SQUARE}", 1, r"has 1, 3; correct NZONE or"),
    "fewer": (
        f"NZONE= 3\nIZONE= 1\n{SQUARE}IZONE= 2\n{SQUARE}",
        1,
        "NZONE= 3 needs the lines IZON",
    ),
    "more": (f"NZONE= 1\nIZONE= 1\n{SQUARE}IZONE= 2\n{SQUARE}", 1, "but the file has 1, 2"),
    "twice": (f"NZONE= 2\nIZONE= 1\n{SQUARE}IZONE= 1\n{SQUARE}", 23, r"occurs twice .*on line 2\)"),
    "no NZONE": (f"IZONE= 1\n{SQUARE}IZONE= 2\n{SQUARE}", 22, "put NZONE= 2 on the first line"),
    "no number": (f"NZONE= 2\nIZONE= a\n{SQUARE}IZONE= 2\n{SQUARE}", 2, "IZONE= a is not a count"),
    "two meshes": (SQUARE + SQUARE, 21, r"NDIME= occurs twice \(first on line 1\)"),
}


@pytest.mark.parametrize("fault", ZONE_FAULTS)
def test_faulty_zones(tmp_path, fault):
    text, line, message = ZONE_FAULTS[fault]
    path = save(tmp_path, text)
    with pytest.raises(MeshError, match=f"^{re.escape(str(path))}:{line}: .*{message}"):
        read(path)


@pytest.mark.parametrize(("zone", "has"), [(0, "the zones 1 to 2"), (3, "the zones 1 to 2")])
def test_zone_that_is_not_there(tmp_path, zone, has):
    with pytest.raises(MeshError, match=f"there is no zone {zone}; the file has {has}; choose"):
        read(save(tmp_path, ZONES), zone)
    with pytest.raises(MeshError, match="there is no zone 2; the file has one zone"):
        read(save(tmp_path, SQUARE), 2)


def test_a_fault_in_another_zone_does_not_matter(tmp_path):
    path = save(tmp_path, edited(ZONES, "5 1 2 5 1", "5 1 2 99 1"))
    assert read(path, 2).dim == 3
    with pytest.raises(MeshError, match=r"grid.su2:6: node 99 does not exist"):
        read(path, 1)


def test_halo_marker_is_counted(tmp_path):
    path = save(tmp_path, edited(MESSY, "1 5 2\r\n", ""))
    line = line_of(MESSY, "upper wall") - 1
    with pytest.raises(MeshError, match=f":{line}: only 1 elements of marker SEND_RECEIVE"):
        read(path)


def test_line_number_counts_comments_and_blank_lines(tmp_path):
    path = save(tmp_path, edited(MESSY, "\t1.1 1.7\t4", "\t1.1 1.7x\t4"))
    line = line_of(MESSY, "\t1.1 1.7\t4")
    assert line == 14
    with pytest.raises(MeshError, match=f":{line}: expected a number, found '1.7x'"):
        read(path)


def test_lost_coordinate_in_space(tmp_path):
    path = save(tmp_path, edited(SOLID, "0.6 0.6 1.7 8\n", "0.6 0.6 8\n"))
    with pytest.raises(MeshError, match=f":{line_of(SOLID, '0.6 0.6 1.7')}: a point has 3 coord"):
        read(path)


@pytest.mark.parametrize("block", [1, 30, 1 << 20])
def test_first_of_several_faults_is_named(tmp_path, monkeypatch, block):
    monkeypatch.setattr("slideviz.formats.su2.text.BLOCK_BYTES", block)
    text = edited(edited(SQUARE, "1.1 0.3 1", "1.1 a 1"), "1.1 1.7 4", "b1 1.7 4")
    text = text.replace("b1 1.7 4", "1.1 b 4")
    with pytest.raises(MeshError, match=r":8: expected .* found 'a'"):
        read(save(tmp_path, text))


# Files that are no SU2 mesh at all.


@pytest.mark.parametrize("text", ["", "\n\n", "  \t\r\n"])
def test_empty(tmp_path, text):
    with pytest.raises(MeshError, match=r"grid.su2: the file is empty; write the mesh again"):
        read(save(tmp_path, text))


def test_binary(tmp_path):
    with pytest.raises(MeshError, match=r"this is not a text file; .*write the mesh as ASCII"):
        read(save(tmp_path, b"NDIME= 2\n" + bytes(range(256))))


@pytest.mark.parametrize("text", ["hello\n", "% a comment\n", "A= 1\n", "1 2 3\n", "\xff" * 99])
def test_other_text(tmp_path, text):
    with pytest.raises(MeshError, match="this is not an SU2 mesh: NDIME=, NELEM= and NPOIN= are"):
        read(save(tmp_path, text.encode("latin-1")))


def test_name_in_another_encoding(tmp_path):
    raw = edited(SQUARE, "TAG= lower", "TAG= Flügel").encode("latin-1")
    message = r"grid.su2:14: the marker name 'Fl\\xfcgel' is empty or not UTF-8 text; rename the"
    with pytest.raises(MeshError, match=message):
        read(save(tmp_path, raw))
    assert read(save(tmp_path, raw.decode("latin-1"))).marker_names == ("Flügel", "upper")


def test_missing_file(tmp_path):
    with pytest.raises(MeshError, match=r"no.su2: there is no such file; check the name and the"):
        read(tmp_path / "no.su2")
    with pytest.raises(MeshError, match="there is no such file"):
        read(save(tmp_path, SQUARE) / "part.su2")
    with pytest.raises(MeshError, match="there is no such file"):
        read("a\0b.su2")


def test_folder_and_pipe(tmp_path):
    with pytest.raises(MeshError, match=r"this is a folder; choose a mesh file in it"):
        read(tmp_path)
    os.mkfifo(tmp_path / "pipe.su2")
    with pytest.raises(MeshError, match=r"this is a device or pipe; choose an ordinary file"):
        read(tmp_path / "pipe.su2")


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.EACCES, "cannot be read: no permission; change its permissions or copy it"),
        (errno.EIO, "cannot be read: .*; check the disk, or copy the file elsewhere"),
    ],
)
@pytest.mark.parametrize("method", ["open", "stat"])
def test_system_refuses(tmp_path, monkeypatch, method, number, words):
    path = save(tmp_path, SQUARE)

    def refuse(*_, **__):
        raise OSError(number, os.strerror(number), str(path))

    # The tests may run as a user who may read everything.
    monkeypatch.setattr(Path, method, refuse)
    with pytest.raises(MeshError, match=words):
        read(path)


@pytest.mark.parametrize("works", range(4))
def test_disk_fails_in_the_middle(tmp_path, monkeypatch, works):
    monkeypatch.setattr("slideviz.formats.source.KEPT_BYTES", 0)
    path = save(tmp_path, SQUARE)
    pread, calls = os.pread, []

    def broken(*wanted):
        calls.append(wanted)
        if len(calls) > works:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return pread(*wanted)

    monkeypatch.setattr(os, "pread", broken)
    with pytest.raises(MeshError, match=r"cannot be read: .*check the disk"):
        read(path)


def test_no_memory(tmp_path, monkeypatch):
    def refuse(*_):
        raise MemoryError

    monkeypatch.setattr("slideviz.formats.su2.read.read_su2", refuse)
    with pytest.raises(MeshError, match="there is not enough memory to read it; use a machine"):
        read(save(tmp_path, SQUARE))


def test_path_that_is_no_text(tmp_path):
    name = os.fsdecode(b"\xff.su2")
    with pytest.raises(MeshError, match=r"\\udcff.su2: there is no such file") as caught:
        read(tmp_path / name)
    str(caught.value).encode()
    (tmp_path / name).write_text(SQUARE)
    mesh = read(tmp_path / name)
    mesh.name.encode()
    write(tmp_path / name, mesh, overwrite=True)


# Cut off anywhere: refused, or (after the last number that counts) the whole mesh.


def attempt(raw: bytes, zone: int | None = None) -> Mesh | MeshError:
    """Return what reading gives; any other exception fails the test."""
    try:
        return read_su2(Source(Path("a.su2"), raw), zone, lambda _: None)
    except MeshError as problem:
        return problem


@pytest.mark.parametrize("name", SAMPLES)
def test_cut_off_anywhere(name):
    raw = SAMPLES[name].encode()
    whole = attempt(raw)
    refused = 0
    for length in range(len(raw)):
        mesh = attempt(raw[:length])
        if isinstance(mesh, MeshError):
            refused += 1
            assert re.match(r"a\.su2:(\d+:)? [^\n]+$", str(mesh))
            continue
        assert mesh.marker_names == whole.marker_names
        assert [len(m.cells) for m in mesh.markers] == [len(m.cells) for m in whole.markers]
        assert mesh.points.tolist() == whole.points.tolist()
        assert mesh.cells.same_as(whole.cells)
    assert refused > 200


edits = st.lists(
    st.tuples(
        st.floats(0, 1, exclude_max=True),
        st.integers(0, 3),
        st.one_of(
            st.binary(max_size=3),
            st.sampled_from(
                [
                    *(b" ", b"\n", b"%", b"=", b"-", b".", b"1", b"99", b"e", b"\r", b"nan", b"\t"),
                    *(b"NELEM= 1\n", b"NPOIN=", b"MARKER_TAG= a\n", b"IZONE= 1\n", b"NZONE= 2\n"),
                    *(b"3 0 1\n", b"1e400", b"\xff", b"_", b"SEND_RECEIVE", b"NDIME= 3\n"),
                ]
            ),
        ),
    ),
    min_size=1,
    max_size=5,
)


@settings(max_examples=200, deadline=2000)
@given(name=st.sampled_from(sorted(SAMPLES)), changes=edits, zone=st.sampled_from([None, 1, 2]))
@example(name="square", changes=[(0.0, 3, b"\xef\xbb\xbf")], zone=None)
def test_changed_bytes_load_or_are_refused(name, changes, zone):
    raw = SAMPLES[name].encode()
    for where, remove, insert in changes:
        at = int(where * len(raw))
        raw = raw[:at] + insert + raw[at + remove :]
    mesh = attempt(raw, zone)
    if isinstance(mesh, MeshError):
        assert re.match(r"a\.su2:(\d+:)? [^\n]+$", str(mesh))
        assert str(mesh).isprintable()
        return
    check_mesh(mesh)
    assert b"".join(su2_blocks(mesh)) == raw
    again = attempt(b"".join(su2_blocks(replace(mesh, origin=Origin()))))
    assert isinstance(again, Mesh)
    assert again.cells.same_as(mesh.cells)
    assert again.marker_names == mesh.marker_names


@settings(max_examples=200, deadline=2000)
@given(raw=st.binary(max_size=200))
def test_any_bytes_load_or_are_refused(raw):
    with pytest.raises(MeshError, match=r"^a\.su2:"):
        read_su2(Source(Path("a.su2"), raw), None, lambda _: None)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    "filler",
    [
        *(b" " * 3_000_000, b"%" * 3_000_000, b"= " * 1_000_000, b"\n" * 3_000_000),
        *(b"a=1\n" * 100_000, b"%\n" * 1_000_000, b"1 " * 1_000_000),
    ],
    ids=["blanks", "comment", "equals", "lines", "sections", "comments", "numbers"],
)
def test_long_nonsense_ends(filler):
    with pytest.raises(MeshError, match=r"^a\.su2:") as caught:
        read_su2(Source(Path("a.su2"), b"NDIME= 2\n" + filler), None, lambda _: None)
    assert len(str(caught.value)) < 300


# Meshes in memory.


def test_check_mesh_finds_each_fault(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    check_mesh(mesh)
    line = mesh.markers[0].cells
    triangle = Cells.from_blocks([(5, [[0, 1, 2]])])
    faults = {
        r"there are no cells; mesh the volume": {"cells": Cells.from_blocks([])},
        r"cell 0 is a line, but dimension 2 is needed; remove it": {"cells": line},
        r"marker 'a': element 0 is a triangle, but dimension 1": {
            "markers": (Marker("a", triangle),)
        },
        r"two markers are named 'a'; rename one": {"markers": (Marker("a", line),) * 2},
        r"cell 0: node 6 does not exist": {"cells": Cells.from_blocks([(5, [[0, 1, 6]])])},
        r"marker 'a': element 1: node 2 occurs twice in one line": {
            "markers": (Marker("a", Cells.from_blocks([(3, [[0, 1], [2, 2]])])),)
        },
        r"point 5 is at \(2.1, nan\), which is not finite": {
            "points": np.where(np.arange(12).reshape(6, 2) == 11, np.nan, mesh.points)
        },
    }
    for message, change in faults.items():
        with pytest.raises(MeshError, match=f"^grid.su2: {message}"):
            check_mesh(replace(mesh, **change))


@settings(max_examples=100, deadline=None)
@given(mesh=meshes(), data=st.data())
def test_first_fault_finds_the_first(mesh, data):
    assert first_fault(mesh.cells, len(mesh.points)) is None
    wrong = mesh.cells.connectivity.copy()
    element = data.draw(st.integers(0, len(mesh.cells) - 1))
    begin, end = mesh.cells.offsets[element : element + 2]
    at = data.draw(st.integers(begin, end - 1))
    wrong[at] = data.draw(st.sampled_from([-1, len(mesh.points), 2**62]))
    found = first_fault(Cells.from_types(mesh.cells.types, wrong), len(mesh.points))
    assert found is not None
    assert found[0] == element
    assert f"node {wrong[at]} does not exist" in found[1]
    twice = mesh.cells.connectivity.copy()
    twice[begin] = twice[end - 1]
    found = first_fault(Cells.from_types(mesh.cells.types, twice), len(mesh.points))
    assert found is not None
    assert found[0] == element
    assert f"node {twice[begin]} occurs twice" in found[1]


# Writing.


def test_source_is_not_overwritten_unasked(tmp_path, monkeypatch):
    path = save(tmp_path, SQUARE)
    mesh = read(path)
    moved = mesh.with_points(mesh.points + 1)
    (tmp_path / "link.su2").symlink_to(path)
    (tmp_path / "hard.su2").hardlink_to(path)
    monkeypatch.chdir(tmp_path)
    for name in (path, "grid.su2", "link.su2", "hard.su2", tmp_path / ".." / tmp_path.name / path):
        with pytest.raises(MeshError, match="is the file that the mesh was read from; choose anot"):
            write(name, moved)
    assert path.read_text() == SQUARE
    write(path, moved, overwrite=True)
    assert read(path).points.tolist() == moved.points.tolist()


def test_other_files_are_replaced(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    other = save(tmp_path, "old", "old.su2")
    write(other, mesh)
    assert other.read_text() == SQUARE
    (tmp_path / "grid.su2").unlink()
    write(tmp_path / "grid.su2", mesh)
    assert (tmp_path / "grid.su2").read_text() == SQUARE


def test_full_disk_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    mesh = read(save(tmp_path, SQUARE))
    old = save(tmp_path, "old", "old.su2")

    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MeshError, match=r"old.su2: cannot be written: the disk is full; free some"):
        write(old, mesh)
    assert old.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grid.su2", "old.su2"]


def test_a_mesh_that_cannot_be_written_leaves_the_old_file(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    old = save(tmp_path, "old", "old.su2")
    with pytest.raises(MeshError, match="is not finite"):
        write(old, mesh.with_points(mesh.points * np.nan))
    assert old.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grid.su2", "old.su2"]


def test_writing_to_a_missing_folder(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    with pytest.raises(MeshError, match="the folder does not exist; create it first"):
        write(tmp_path / "no" / "out.su2", mesh)


def test_su2_has_no_place_for_cell_data(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    with pytest.raises(MeshError, match=r"has no place for cell data \(quality\); write a .vtu fi"):
        write(tmp_path / "out.su2", mesh, cell_data={"quality": [1.0, 1.0, 1.0]})


def test_cell_data_of_another_length(tmp_path):
    mesh = Mesh(np.eye(3)[:, :2], Cells.from_blocks([(5, [[0, 1, 2]])]))
    for values in ([1.0, 2.0], 3.0, [[[1.0]]]):
        with pytest.raises(
            MeshError, match=r"cell data 'q' has shape .*, but the mesh has 1 cells"
        ):
            write(tmp_path / "out.vtu", mesh, cell_data={"q": values})


@pytest.mark.parametrize("work", [quality, find_pairs])
def test_coordinates_too_large_to_compute_with_are_named(tmp_path, work):
    mesh = read(save(tmp_path, SQUARE))
    points = mesh.points.copy()
    points[1, 1] = 2e150
    match = r"grid.su2: point 1 is at \(1.1, 2e\+150\); nothing can be computed with .* 1e\+50"
    with pytest.raises(MeshError, match=match):
        work(mesh.with_points(points))
    with pytest.raises(MeshError, match=match):
        read(save(tmp_path, edited(SQUARE, "1.1 0.3 1", "1.1 2e150 1")))
