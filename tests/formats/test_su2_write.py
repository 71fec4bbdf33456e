"""What is written: the same file, or the same file with other coordinates, or a new one."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slideviz.errors import MeshError
from slideviz.formats.files import read, write
from slideviz.mesh.check import LARGEST
from slideviz.mesh.model import Cells, Marker, Mesh, Origin
from tests.formats.su2_samples import (
    MESSY,
    SAMPLES,
    SOLID,
    SQUARE,
    ZONES,
    assert_same,
    bits,
    meshes,
    save,
    shared_meshes,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("su2")


@pytest.mark.parametrize(
    ("name", "zone"), [("square", 1), ("solid", 1), ("messy", 1), ("zones", 1), ("zones", 2)]
)
def test_nothing_moved_gives_the_same_bytes(tmp_path, name, zone):
    path = save(tmp_path, SAMPLES[name])
    write(tmp_path / "out.su2", read(path, zone))
    assert (tmp_path / "out.su2").read_bytes() == path.read_bytes()


numbers = st.floats(-LARGEST, LARGEST)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), name=st.sampled_from(sorted(SAMPLES)))
def test_moved_points_change_only_their_coordinates(folder, data, name):
    path = save(folder, SAMPLES[name], f"{name}.su2")
    mesh = read(path, zone=2 if name == "zones" else 1)
    moved = data.draw(arrays(float, mesh.points.shape, elements=numbers))
    keep = data.draw(arrays(bool, mesh.points.shape))
    moved[keep] = mesh.points[keep]
    write(folder / "out.su2", mesh.with_points(moved))
    again = read(folder / "out.su2", zone=mesh.zone)
    assert_same(again, replace(mesh, points=moved))
    # With the coordinates taken out both files must be the same, byte for byte, and a coordinate
    # that did not change keeps the text it had.
    before, after = _coordinates(mesh), _coordinates(again)
    assert before[0] == after[0]
    same = moved.view(np.int64).ravel() == mesh.points.view(np.int64).ravel()
    assert [a for a, s in zip(before[1], same, strict=True) if s] == [
        a for a, s in zip(after[1], same, strict=True) if s
    ]


def _coordinates(mesh: Mesh) -> tuple[list[bytes], list[bytes]]:
    """Return the text between the coordinates of the file read, and the coordinates."""
    raw, between, words = mesh.origin.raw[:], [b""], []
    at, left = raw.lower().index(b"npoin", mesh.origin.zone[0]), len(mesh.points)
    between[0] = raw[:at]
    for line in raw[at:].splitlines(keepends=True):
        ink = line.partition(b"%")[0]
        if not left or not re.match(rb"\s*[-+.0-9]", ink):
            between[-1] += line
            continue
        found = list(re.finditer(rb"\S+", ink))[: mesh.dim]
        bounds = [0, *(k for word in found for k in word.span()), len(line)]
        words += [word.group() for word in found]
        parts = [line[a:b] for a, b in zip(bounds[::2], bounds[1::2], strict=True)]
        between[-1] += parts[0]
        between += parts[1:]
        left -= 1
    return between, words


def test_the_text_of_a_moved_messy_file(tmp_path):
    mesh = read(save(tmp_path, MESSY))
    points = mesh.points.copy()
    points[1] = [1 / 3, -2.5e-8]
    write(tmp_path / "out.su2", mesh.with_points(points))
    expected = MESSY.replace("+1.10E+00 3.0e-1 1 7\r\n", "0.3333333333333333 -2.5e-8 1 7\r\n")
    assert (tmp_path / "out.su2").read_bytes() == expected.encode()


def test_a_sign_of_zero_is_a_change(tmp_path):
    mesh = read(save(tmp_path, SQUARE.replace("0.1 0.3 0\n", "0.0 0.3 0\n")))
    points = mesh.points.copy()
    points[0, 0] = -0.0
    write(tmp_path / "out.su2", mesh.with_points(points))
    assert b"-0.0 0.3 0\n" in (tmp_path / "out.su2").read_bytes()


@pytest.mark.parametrize("block", [1, 2, 5])
def test_size_of_the_blocks_does_not_matter(tmp_path, monkeypatch, block):
    mesh = read(save(tmp_path, ZONES), zone=2)
    for name, value in (("moved", mesh.with_points(mesh.points / 3)), ("anew", _anew(mesh))):
        write(tmp_path / f"{name}.su2", value)
        monkeypatch.setattr("slideviz.formats.su2.write._BLOCK_ROWS", block)
        write(tmp_path / "out.su2", value)
        monkeypatch.undo()
        assert (tmp_path / "out.su2").read_bytes() == (tmp_path / f"{name}.su2").read_bytes()


def _anew(mesh: Mesh) -> Mesh:
    return replace(mesh, origin=Origin())


@settings(max_examples=80, deadline=None)
@given(mesh=meshes())
def test_reading_what_was_written_gives_the_same_mesh(folder, mesh):
    write(folder / "law.su2", mesh)
    again = read(folder / "law.su2")
    assert_same(again, mesh)
    write(folder / "twice.su2", again)
    assert (folder / "twice.su2").read_bytes() == (folder / "law.su2").read_bytes()


@pytest.mark.parametrize("text", [SQUARE, SOLID])
def test_a_file_in_our_own_form_is_written_alike_from_memory(tmp_path, text):
    write(tmp_path / "out.su2", _anew(read(save(tmp_path, text))))
    assert (tmp_path / "out.su2").read_text() == text


def _parts(text: str) -> list[str]:
    return re.findall(r"^\w+ *= *.*$", text, re.M)


def test_other_markers_are_written_anew_and_unknown_sections_follow(tmp_path):
    mesh = read(save(tmp_path, MESSY))
    upper = replace(mesh.marker("upper wall"), name="lid")
    changed = replace(mesh, markers=(upper,))
    write(tmp_path / "out.su2", changed)
    assert_same(read(tmp_path / "out.su2"), changed)
    text = (tmp_path / "out.su2").read_bytes().decode()
    assert _parts(text.replace("\r", "")) == [
        *("NDIME= 2", "NELEM= 3", "NPOIN= 6", "NMARK= 3", "MARKER_TAG= lid", "MARKER_ELEMS= 1"),
        *("MARKER_TAG= SEND_RECEIVE", "MARKER_ELEMS= 2", "SEND_TO= 1"),
        *("MARKER_TAG= SEND_RECEIVE", "MARKER_ELEMS= 1", "SEND_TO= -1"),
        *("AOA_OFFSET= 0.25", "AOS_OFFSET=0", "NPERIODIC= 1", "PERIODIC_INDEX= 0"),
        *("FFD_NBOX= 1", "FFD_TAG= box", "FFD_CORNER_POINTS= 1", "FFD_SURFACE_POINTS= 1"),
    ]
    assert text.endswith(MESSY[MESSY.index("NPERIODIC") :] + "\n")


def test_other_cells_and_points_are_written_anew(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    changed = replace(
        mesh,
        points=np.vstack([mesh.points, [[9.0, 9.0]]]),
        cells=Cells.from_blocks([(5, [[0, 1, 6], [1, 2, 6]])]),
    )
    write(tmp_path / "out.su2", changed)
    assert_same(read(tmp_path / "out.su2"), changed)


def test_other_cells_on_the_same_points_are_written_anew(tmp_path):
    mesh = read(save(tmp_path, SQUARE))
    changed = replace(mesh, cells=Cells.from_blocks([(9, [[0, 1, 4, 3], [1, 2, 5, 4]])]))
    write(tmp_path / "out.su2", changed)
    assert_same(read(tmp_path / "out.su2"), changed)


def test_equal_cells_and_markers_are_no_change(tmp_path):
    path = save(tmp_path, MESSY)
    mesh = read(path)
    cells = Cells.from_types(mesh.cells.types, mesh.cells.connectivity)
    markers = tuple(Marker(m.name, m.cells) for m in mesh.markers)
    write(tmp_path / "out.su2", replace(mesh, cells=cells, markers=markers))
    assert (tmp_path / "out.su2").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("zone", [1, 2])
def test_changing_one_zone_leaves_the_other(tmp_path, zone):
    mesh = read(save(tmp_path, ZONES), zone)
    changed = replace(mesh, markers=mesh.markers[:1], points=mesh.points / 7)
    write(tmp_path / "out.su2", changed)
    assert_same(read(tmp_path / "out.su2", zone), changed)
    other = 3 - zone
    assert_same(read(tmp_path / "out.su2", other), read(tmp_path / "grid.su2", other))
    untouched = (SQUARE, SOLID)[other - 1]
    assert f"IZONE= {other}\n{untouched}" in (tmp_path / "out.su2").read_text()


@pytest.mark.parametrize("name", ["", " wall", "wall ", "50%", "two\nlines", "\x07"])
def test_names_that_a_file_cannot_hold_are_refused(tmp_path, name):
    mesh = _anew(read(save(tmp_path, SQUARE)))
    changed = replace(mesh, markers=(Marker(name, mesh.markers[0].cells),))
    with pytest.raises(
        MeshError, match=r"the marker name .* cannot be written to an SU2 file; rename"
    ):
        write(tmp_path / "out.su2", changed)
    assert not (tmp_path / "out.su2").exists()


def test_the_name_of_halos_is_refused(tmp_path):
    mesh = _anew(read(save(tmp_path, SQUARE)))
    changed = replace(mesh, markers=(Marker("send_receive", mesh.markers[0].cells),))
    with pytest.raises(MeshError, match="cannot be named send_receive, which SU2 uses for halos"):
        write(tmp_path / "out.su2", changed)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("anew", [False, True])
def test_points_that_are_not_finite_are_not_written(tmp_path, bad, anew):
    mesh = read(save(tmp_path, SQUARE))
    points = mesh.points.copy()
    points[4, 1] = bad
    moved = mesh.with_points(points)
    with pytest.raises(MeshError, match=r"grid.su2: point 4 is at \(1.1, .*, which is not finite"):
        write(tmp_path / "out.su2", _anew(moved) if anew else moved)
    assert not (tmp_path / "out.su2").exists()


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.slow] * (path.stat().st_size > 1.4e6))
        for path in shared_meshes()
    ],
)
def test_real_meshes(tmp_path, path):
    raw = path.read_bytes()
    if "nPoly3" in path.name:
        with pytest.raises(MeshError, match=r"su2:9: element type 209 .* high-order"):
            read(path)
        return
    zones = read(path).zones
    for zone in range(1, zones + 1):
        mesh = read(path, zone)
        write(tmp_path / "out.su2", mesh)
        assert (tmp_path / "out.su2").read_bytes() == raw
        moved = mesh.points + np.sin(mesh.points + np.arange(1, mesh.dim + 1)) / 3
        write(tmp_path / "moved.su2", mesh.with_points(moved))
        again = read(tmp_path / "moved.su2", zone)
        assert bits(again.points) == bits(moved)
        assert_same(again, replace(mesh, points=moved))
        assert _coordinates(again)[0] == _coordinates(mesh)[0]
        write(tmp_path / "anew.su2", _anew(mesh))
        assert_same(read(tmp_path / "anew.su2"), mesh)
