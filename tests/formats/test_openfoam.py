"""OpenFOAM's polyMesh: reading in each form, cells from faces, and points written back."""

import gzip
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import slideviz as sv
from slideviz.case.zone_cases import with_marker_names
from slideviz.cli import run
from slideviz.errors import MeshError
from slideviz.formats.openfoam_paths import mesh_path, shown_name, stem_of
from slideviz.mesh.polyhedra import parts_words
from slideviz.session.opening import guess_roles
from slideviz.session.state import Guess
from tests.builders import grid
from tests.polymesh_files import (
    HEADER,
    Form,
    extruded,
    honeycomb,
    merged,
    patches_of,
    sides_of,
    write_mesh,
    write_polymesh,
)

FORMS = {
    "ascii": Form(),
    "packed": Form(packed=True),
    "binary": Form(binary=True),
    "binary 64 packed": Form(binary=True, packed=True, label=64),
}
KINDS = ("plain", "simplex", "prism", "mixed")


def contents(folder):
    """Return the bytes of all files below a folder, by their paths in it."""
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_points_are_written_back_and_nothing_else(tmp_path, form):
    mesh = grid((3, 2, 2), kind="mixed")
    case = write_mesh(tmp_path / "case", mesh, form=form)
    (case / "0").mkdir()
    (case / "0" / "U").write_text("internalField uniform (1 0 0);\n")
    before = contents(case)
    read = sv.read(case)
    assert np.array_equal(read.points, mesh.points)
    assert read.name == "case"
    assert read.marker_names == mesh.marker_names
    sv.write(case, read, overwrite=True)
    if not form.packed:
        assert contents(case) == before
    moved = read.points.copy()
    moved[5] += [1 / 300, -1e-7, 1e-300]
    sv.write(case, read.with_points(moved), overwrite=True)
    after = contents(case)
    changed = {path.name for path in before if before[path] != after[path]}
    assert {*before} == {*after}
    assert changed == {"points.gz" if form.packed else "points"}
    assert np.array_equal(sv.read(case).points[: len(moved)], moved)


def test_points_that_stay_keep_their_bytes(tmp_path):
    case = write_mesh(tmp_path / "case", grid((2, 2, 2)))
    path = case / "constant/polyMesh/points"
    path.write_text(path.read_text().replace("(0.0 0.0 0.0)", "( 0 0.00e0   -0 ) // corner"))
    mesh = sv.read(case)
    points = mesh.points.copy()
    points[-1] += 0.25
    sv.write(case, mesh.with_points(points), overwrite=True)
    old, new = path.read_text(), path.with_name("points").read_text()
    assert "( 0 0.00e0   -0 ) // corner" in new
    assert new == old
    assert np.array_equal(sv.read(case).points, points)


def test_single_precision_is_kept(tmp_path):
    case = write_mesh(tmp_path / "case", grid((2, 2, 2)), form=Form(binary=True, scalar=32))
    mesh = sv.read(case)
    points = mesh.points * 1.1
    sv.write(case, mesh.with_points(points), overwrite=True)
    assert np.array_equal(sv.read(case).points, points.astype("f4").astype(float))
    with pytest.raises(MeshError, match="a coordinate is larger than float32 holds; scale it"):
        sv.write(case, mesh.with_points(points * 1e40), overwrite=True)


@pytest.mark.parametrize("kind", KINDS)
def test_elements_are_built_from_their_faces(tmp_path, kind):
    mesh = grid((3, 3, 2), kind=kind)
    read = sv.read(write_mesh(tmp_path, mesh))
    assert read.whole_cells.tolist() == list(range(len(mesh.cells)))
    assert np.array_equal(read.cells.types, mesh.cells.types)
    for i in range(len(mesh.cells)):
        ours, theirs = (
            {*one.cells.connectivity[one.cells.offsets[i] : one.cells.offsets[i + 1]].tolist()}
            for one in (read, mesh)
        )
        assert ours == theirs
    assert patches_of(read) == patches_of(mesh)
    quality = sv.quality(read)
    assert quality.valid == len(mesh.cells)
    assert quality.values == pytest.approx(sv.quality(mesh).values, abs=1e-14)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(KINDS))
def test_metrics_of_faces_are_those_of_elements(tmp_path_factory, seed, kind):
    mesh = grid((3, 3, 2), kind=kind)
    shift = np.random.default_rng(seed).uniform(-0.04, 0.04, mesh.points.shape)
    mesh = mesh.with_points(mesh.points + shift)
    read = sv.read(write_mesh(tmp_path_factory.mktemp("case"), mesh))
    names = ["non-orthogonality", "skewness", "expansion"]
    ours, theirs = sv.metrics(read, names), sv.metrics(mesh, names)
    for name in names:
        cells = read.whole_cells
        assert ours[name].values == pytest.approx(theirs[name].values[cells], abs=1e-9)


def test_a_polyhedron_is_rated_by_its_parts(tmp_path):
    points, cells = extruded(*honeycomb(), [0.0, 1.0, 2.0])
    low = lambda at: np.ptp(at[:, 2]) == 0  # noqa: E731
    write_polymesh(tmp_path / "polyMesh", points, cells, {"ends": low, "sides": lambda _: True})
    mesh = sv.read(tmp_path / "polyMesh")
    assert np.array_equal(mesh.points[: len(points)], points)
    assert len(mesh.points) == len(points) + len(cells)
    # A hexagonal prism has four tetrahedra on each end, and a pyramid on each side.
    assert np.bincount(mesh.whole_cells).tolist() == [14] * len(cells)
    quality = sv.quality(mesh)
    assert (quality.cells, quality.valid) == (len(cells), len(cells))
    assert [len(quality.worst(99)), len(quality.histogram()[0])] == [len(cells), 20]
    assert len({*quality.values[mesh.whole_cells == 3].tolist()}) == 1
    found = sv.metrics(mesh, ["non-orthogonality", "skewness", "aspect-ratio"])
    assert found["non-orthogonality"].max == pytest.approx(0, abs=1e-5)
    assert len(found["skewness"].values[found["skewness"].counted]) == len(cells)
    # One that is folded makes its cell inverted, and only that.
    top = len(points) + 4
    moved = mesh.points.copy()
    moved[top] += [5.0, 0, 0]
    folded = sv.quality(mesh.with_points(moved), reference=mesh)
    assert folded.inverted == 1
    assert {*mesh.whole_cells[folded.values == 0].tolist()} == {4}
    sv.write(tmp_path / "polyMesh", mesh.with_points(moved), overwrite=True)
    assert np.array_equal(sv.read(tmp_path / "polyMesh").points, mesh.points)


def volumes(mesh):
    """Return the volume of each cell of a mesh with plane faces."""
    out = []
    for sides in sides_of(mesh):
        corners = [mesh.points[list(side)] for side in sides]
        fans = [(c[0], c[k], c[k + 1]) for c in corners for k in range(1, len(c) - 1)]
        out.append(sum(np.dot(a, np.cross(b, c)) for a, b, c in fans) / 6)
    return np.array(out)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(KINDS))
def test_parts_fill_the_cells(tmp_path_factory, seed, kind):
    """Boxes of any elements merged, with nodes on straight edges and in flat faces."""
    rng = np.random.default_rng(seed)
    steps = [np.cumsum(rng.uniform(0.5, 2, 5)) for _ in range(3)]
    even = grid((4, 2, 2), kind=kind, place=lambda p: p)
    middles = np.array([even.points[sorted({*sum(one, ())})].mean(0) for one in sides_of(even)])
    boxes = middles.astype(int) // rng.integers(1, 3, 3)
    _, groups = np.unique(boxes, axis=0, return_inverse=True)
    columns = [np.interp(even.points[:, k], range(5), steps[k]) for k in range(3)]
    mesh = even.with_points(np.column_stack(columns))
    folder = tmp_path_factory.mktemp("case") / "polyMesh"
    write_polymesh(folder, mesh.points, merged(sides_of(mesh), groups), patches_of(mesh))
    read = sv.read(folder)
    parts = np.bincount(read.whole_cells, volumes(read))
    assert parts == pytest.approx(np.bincount(groups, volumes(mesh)), rel=1e-12)
    assert (volumes(read) > 0).all()
    assert not read.remarks
    assert sv.quality(read).valid == groups.max() + 1
    assert read.marker_names == mesh.marker_names


def test_a_hanging_node_divides_the_face(tmp_path):
    """Two small cells beside a large one, whose nodes are on edges and in the face of that."""
    mesh = grid((2, 2, 2))
    cells = merged(sides_of(mesh), [0, 0, 0, 0, 1, 2, 3, 4])
    write_polymesh(tmp_path / "polyMesh", mesh.points, cells, {"all": lambda _: True})
    read = sv.read(tmp_path / "polyMesh")
    assert np.bincount(read.cells.types)[12] == 4  # the small ones
    assert sv.quality(read).valid == 5
    assert volumes(read)[read.whole_cells == 0].sum() == pytest.approx(0.5)


def channel_case(tmp_path):
    """Return a case of a box, and a case file that moves a side of it a little."""
    case = write_mesh(tmp_path / "box", grid((3, 2, 2)))
    (case / "system").mkdir()
    (case / "system" / "controlDict").write_text("application icoFoam;\n")
    cfg = tmp_path / "case.cfg"
    cfg.write_text("MESH_FILENAME= box\nMARKER_MOVING= x_p\nMOTION= (x_p, translate, 0.05, 0, 0)\n")
    return case, cfg


def test_a_run_writes_into_a_new_case(tmp_path, monkeypatch, capsys):
    case, cfg = channel_case(tmp_path)
    monkeypatch.chdir(tmp_path)
    before = contents(case)
    assert run(["run", str(cfg)]) == 0
    after = contents(tmp_path / "box_def")
    assert {*after} - {*before} == {Path("box_def_qual.txt")}
    assert [path for path in before if after[path] != before[path]] == [POINTS]
    assert contents(case) == before
    assert sv.read("box_def").points[:, 0].max() == 1.05
    # A second time over it; a mesh with other cells is not written over.
    assert run(["run", str(cfg)]) == 0
    write_mesh(tmp_path / "other", grid((2, 2, 2)))
    with pytest.raises(MeshError, match=r"other/constant/polyMesh/faces: is of another mesh than"):
        sv.write("other", sv.read("box"))
    capsys.readouterr()


def test_a_file_that_cannot_be_copied_is_told(tmp_path, monkeypatch):
    case, _ = channel_case(tmp_path)
    mesh = sv.read(case)
    real = Path.read_bytes

    def refuses(path):
        if path.name == "controlDict":
            raise PermissionError(13, "Permission denied")
        return real(path)

    monkeypatch.setattr(Path, "read_bytes", refuses)
    with pytest.raises(MeshError, match="controlDict: cannot be read: no permission; change its"):
        sv.write(tmp_path / "new.foam", mesh)


def test_a_run_writes_into_a_time_or_the_case_itself(tmp_path, capsys):
    case, cfg = channel_case(tmp_path)
    before = contents(case)
    assert run(["run", str(cfg), "--quiet", "-o", str(case / "0.5")]) == 0
    new = contents(case)
    assert {*new} - {*before} == {Path("0.5/polyMesh/points"), Path("box_qual.txt")}
    assert all(new[path] == before[path] for path in before)
    assert sv.read(case / "0.5").points[:, 0].max() == 1.05
    assert sv.read(case).points[:, 0].max() == 1
    assert run(["run", str(cfg), "--quiet", "-o", str(case)]) == 1
    assert "is the input mesh" in capsys.readouterr().err
    assert run(["run", str(cfg), "--quiet", "--force", "-o", str(case / "box.foam")]) == 0
    assert sv.read(case / "constant").points[:, 0].max() == 1.05
    assert run(["info", str(case)]) == 0
    assert "12  hexahedron" in capsys.readouterr().out


def test_other_meshes_are_not_written_as_cases(tmp_path):
    with pytest.raises(MeshError, match="only the points are written, but plain 3D is not read"):
        sv.write(tmp_path / "new.foam", grid((2, 2, 2)))


def test_a_case_converts_with_its_parts(tmp_path, capsys):
    points, cells = extruded(*honeycomb(), [0.0, 1.0])
    write_polymesh(tmp_path / "polyMesh", points, cells, {"all": lambda _: True})
    assert run(["convert", str(tmp_path / "polyMesh"), str(tmp_path / "a.su2")]) == 0
    assert "its polyhedra as such" in capsys.readouterr().err
    assert len(sv.read(tmp_path / "a.su2").cells) == 14 * len(cells)


def test_the_file_that_stands_for_a_mesh(tmp_path):
    case = write_mesh(tmp_path / "case", grid((2, 2, 2)), form=Form(packed=True))
    points = case / "constant/polyMesh/points.gz"
    for path in (case, case / "constant", points.parent, case / "any.foam", points):
        assert mesh_path(path) == points
        assert stem_of(mesh_path(path)) == "case"
        assert shown_name(mesh_path(path)) == "case"
    assert shown_name(mesh_path(case / "0.1")) == "case, time 0.1"
    assert shown_name(tmp_path / "a.su2") == "a.su2"
    assert mesh_path(case / "0.1") == case / "0.1/polyMesh/points"
    assert mesh_path(tmp_path / "new.foam") == tmp_path / "new/constant/polyMesh/points"
    for other in (tmp_path, tmp_path / "a.su2", tmp_path / "0.1", case / "system"):
        assert mesh_path(other) == other


POINTS = Path("constant/polyMesh/points")
POLY = "constant/polyMesh"
WRONG = {
    "no header": ("points", "FoamFile", "Foam", "points: has no header FoamFile"),
    "no list": ("points", "36\n(", "what", r"points: expected a list, N\(...\), found 'what"),
    "fewer points": ("points", "36\n(", "37\n(", "its list says 37, but has 36; write the mesh"),
    "no number": ("points", "(0.0 0.0 0.0)", "(x 0 0)", "points: its list has something else"),
    "not a number": ("points", "(0.0 0.0 0.0)", "(nan 0 0)", "point 0 is at .*, which is not fin"),
    "faces": ("faces", "52\n(", "53\n(", "its list says 53 faces, but has 52"),
    "face": ("faces", "4(", "5(", "face 0 has another number of nodes than it says"),
    "two nodes": ("faces", r"4\((\d+) (\d+) \d+ \d+\)", r"2(\1 \2)", "face 0 has fewer than 3"),
    "node": ("faces", r"4\(\d+ ", "4(36 ", "has the node 36, but there are 36 points"),
    "negative": ("faces", r"4\(\d+ ", "4(-2 ", "has the node -2, but there are 36 points"),
    "mark": ("faces", r"4\(\d+ ", "4(-1 ", "its list says 52 faces, but has 53"),
    "huge": ("faces", r"4\(\d+ ", "4(99999999999999999999 ", "has the node 9223372036854775807"),
    "twice": ("faces", r"4\((\d+) \d+ ", r"4(\1 \1 ", "occurs twice in one"),
    "owner": ("owner", "52\n(", "51\n(", "its list says 51, but has 52"),
    "owners": ("owner", r"52\n\(\n0", "51\n(", "owner: has 51 cells, one for each face, but 52"),
    "cell": ("owner", r"\(\n0\n", "(\n52\n", "has the cell 52, which 52 faces cannot bound"),
    "neg cell": ("neighbour", r"\(\n\d+\n", "(\n-1\n", "neighbour: has the cell -1, which 52"),
    "open": ("owner", r"\(\n0\n0\n0\n", "(\n1\n1\n1\n", "cell 0 has fewer than 4 faces"),
    "patches": ("boundary", "6\n(", "7\n(", "its list says '7', but has 6 patches"),
    "start": ("boundary", "startFace 20", "startFace 21", "starts at face 21, expected 20"),
    "count": ("boundary", r"nFaces \d+;(?=\D+\d+;\s+}\s+\)\n)", "nFaces 1;", "its patches end at"),
    "entry": ("boundary", "nFaces", "faces", "patch 'x_m' has no type, nFaces, or startFace"),
    "nan": (
        "points",
        r"\(0\.0 0\.0 0\.0\)",
        "(0.0 nan 0.0)",
        r"point 0 is at \(0.0, nan, 0.0\), which",
    ),
    "far": (
        "points",
        r"\(0\.0 0\.0 0\.0\)",
        "(-1e60 0 0)",
        "which is not finite, or larger than 1e",
    ),
    "processor": ("boundary", "type patch", "type processor", "run reconstructParMesh -constant"),
}


@pytest.mark.parametrize(("name", "old", "new", "message"), WRONG.values(), ids=WRONG)
def test_wrong_files_are_told_in_a_sentence(tmp_path, name, old, new, message):
    case = write_mesh(tmp_path, grid((3, 2, 2)))
    path = case / POLY / name
    text = path.read_text()
    changed = re.sub(old if "\\" in old else re.escape(old), new, text, count=1)
    assert changed != text
    path.write_text(changed)
    with pytest.raises(MeshError, match=message):
        sv.read(case)


@pytest.mark.parametrize("name", ["faces", "owner", "neighbour", "boundary", "points"])
def test_a_missing_file_is_named(tmp_path, name):
    case = write_mesh(tmp_path, grid((2, 2, 2)))
    (case / POLY / name).unlink()
    with pytest.raises(MeshError, match=rf"{name}: there is no such file; check the name"):
        sv.read(case / "constant" / "polyMesh")


def test_a_case_without_a_mesh_is_told_what_it_lacks(tmp_path):
    (tmp_path / "constant").mkdir()
    with pytest.raises(MeshError, match="polyMesh: this case of OpenFOAM has no mesh; make one"):
        sv.read(tmp_path)


def test_binary_lists_that_lie(tmp_path):
    case = write_mesh(tmp_path, grid((2, 2, 2)), form=Form(binary=True))
    points = case / POLY / "points"
    good = points.read_bytes()
    for old, new in ((b"27\n(", b"28\n("), (b"27\n(", b"999999999999999999\n("), (b"=64", b"=32")):
        points.write_bytes(good.replace(old, new))
        with pytest.raises(MeshError, match=r"its list of \d+ does not end after \d+ numbers of"):
            sv.read(case)
    points.write_bytes(good)
    faces = case / POLY / "faces"
    compact = faces.read_bytes()
    faces.write_bytes(compact.replace(b"37\n(\0", b"37\n(\1"))
    with pytest.raises(MeshError, match="its offsets do not lead from 0 to the 144 nodes"):
        sv.read(case)
    faces.write_bytes(compact.replace(b"faceCompactList", b"faceList       "))
    with pytest.raises(MeshError, match="is a binary faceList; expected a faceCompactList"):
        sv.read(case)
    faces.write_bytes(compact)
    owner = case / POLY / "owner"
    head = owner.read_bytes().partition(b"36\n(")[0]
    owner.write_bytes(head.replace(b"binary", b"ascii ") + b"999999999999{0}\n")
    with pytest.raises(MeshError, match="its list says 999999999999, but has 1"):
        sv.read(case)


@pytest.mark.parametrize("name", ["..", ".", "../../other/constant/solid", "/", "/else", "solid/"])
def test_regions_of_other_folders_are_not_read(tmp_path, name):
    regions_case(tmp_path / "other")
    case = regions_case(tmp_path / "case")
    file = case / "constant" / "regionProperties"
    file.write_text(file.read_text().replace("(solid)", f"({name})"))
    with pytest.raises(MeshError, match="regionProperties: names a region of another folder, "):
        sv.read(case)


HEAD = HEADER.format(form="ascii", arch="", kind="labelList", name="x").encode()
ENDLESS = {
    "comments": ("points", b"/**/" * 99, "has no header FoamFile"),
    "slashes": ("points", b"/" * 999 + b"\n x", "has no header FoamFile"),
    "blanks": ("points", b"FoamFile{a" + b" " * 99_999 + b"}", "expected a list"),
    "words": ("points", b"FoamFile{" + b"a " * 99_999 + b"}", "expected a list"),
    "gaps": ("owner", HEAD + b"/**/" * 99, "expected a list, N"),
    "open": ("boundary", HEAD + b"/* " * 99_999, "its list says '', but has 0 patches"),
    "bomb": ("owner", HEAD + b"99999999{0}" + b" " * 999_999, "says 99999999, but has 1"),
}


@pytest.mark.parametrize(("name", "content", "message"), ENDLESS.values(), ids=ENDLESS)
def test_files_that_would_take_forever_are_refused(tmp_path, name, content, message):
    case = write_mesh(tmp_path, grid((2, 2, 2)))
    (case / POLY / name).write_bytes(content)
    with pytest.raises(MeshError, match=message):
        sv.read(case)


def test_a_face_of_too_many_nodes_is_refused(tmp_path):
    angles = 2 * np.pi * np.arange(101) / 101
    circle = np.stack([np.cos(angles), np.sin(angles)], 1)
    points, cells = extruded(circle, [list(range(101))], [0.0, 1.0])
    write_polymesh(tmp_path / POLY, points, cells, {"all": lambda _: True})
    with pytest.raises(MeshError, match="has 101 nodes, more than 100; write the mesh again"):
        sv.read(tmp_path)


def test_a_region_is_named_once(tmp_path):
    case = regions_case(tmp_path / "case")
    file = case / "constant" / "regionProperties"
    file.write_text(file.read_text().replace("(solid)", "(solid solid)"))
    with pytest.raises(MeshError, match="regionProperties: names the region 'solid' twice; name"):
        sv.read(case)


def test_a_compressed_file_that_bursts(tmp_path):
    case = write_mesh(tmp_path, grid((2, 2, 2)), form=Form(packed=True))
    path = case / POLY / "faces.gz"
    path.write_bytes(gzip.compress(b" " * 20_000_000))
    with pytest.raises(MeshError, match="is cut off, or unpacks to more than 200 times its size"):
        sv.read(case)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(MeshError, match=r"faces.gz: is cut off, or unpacks"):
        sv.read(case)
    path.write_bytes(b"\x1f\x8b\x00" + bytes(40))
    with pytest.raises(MeshError, match=r"faces.gz: cannot be unpacked \("):
        sv.read(case)


def test_patches_have_roles_by_themselves(tmp_path):
    kinds = {"x_m": "cyclic", "x_p": "cyclic", "y_m": "symmetryPlane", "z_p": "wall"}
    mesh = sv.read(write_mesh(tmp_path / "case", grid((3, 3, 3)), kinds))
    assert mesh.roles == {"x_m": "periodic", "x_p": "periodic", "y_m": "sliding"}
    motion = sv.Translate("y_p", (0.0, -0.05, 0.0))
    given = sv.Case(roles={"y_p": "moving"}, motions=[motion])
    case = with_marker_names(given, mesh)
    assert dict(case.roles) == {"y_p": "moving", **mesh.roles}
    assert (case.sliding, case.periodic) == ("ps", "moving")
    *_, last = sv.deform(given, mesh)
    moved = last.mesh.points
    assert np.array_equal(moved[mesh.marker("y_m").nodes, 1], np.zeros(16))
    # What the case says comes first.
    given = sv.Case(roles={"y_p": "moving", **dict.fromkeys(mesh.roles, "fixed")}, motions=[motion])
    assert with_marker_names(given, mesh) == given
    guessed = guess_roles(mesh)
    assert guessed["y_m"] == Guess("sliding", "its file says so")


def plate_case(folder, kind="empty", polygons=None):
    """Return the case of a plate with a hexagon, of one layer in z, between patches of a kind."""
    square = [[0, 0], [2, 0], [4, 0], [4, 3], [2, 3], [0, 3], [1, 1], [3, 1.5]]
    cells = polygons or [[0, 1, 6], [1, 2, 7], [2, 3, 7], [3, 4, 7], [4, 5, 6, 1, 7], [5, 0, 6]]
    points, cells = extruded(np.array(square, float), cells, [-0.5, 0.5])
    patches = {
        "frontAndBack": lambda at: np.ptp(at[:, 2]) == 0,
        "bottom": lambda at: (at[:, 1] == 0).all(),
        "rest": lambda _: True,
    }
    write_polymesh(folder / POLY, points, cells, patches, {"frontAndBack": kind})
    return folder


@pytest.mark.parametrize("turn", [(0, 1, 2), (2, 0, 1), (1, 0, 2)], ids=str)
def test_one_layer_between_empty_patches_is_plane(tmp_path, turn):
    case = plate_case(tmp_path)
    path = case / POLY / "points"
    points = np.array(
        [
            [float(x) for x in row.split()]
            for row in re.findall(r"\(([-\d. e]+)\)", path.read_text())
        ]
    )
    turned = points[:, turn]
    rows = iter(turned.tolist())
    path.write_text(
        re.sub(r"\([-\d. e]+\)", lambda _: "({} {} {})".format(*next(rows)), path.read_text())
    )
    mesh = sv.read(case)
    axis = int(np.argmin(np.ptp(turned, axis=0)))
    assert mesh.dim == 2
    assert np.array_equal(mesh.points[:8], np.delete(turned, axis, 1)[:8])
    assert mesh.marker_names == ("bottom", "rest")
    assert sv.quality(mesh).valid == 6
    assert np.bincount(mesh.whole_cells).tolist() == [1, 1, 1, 1, 5, 1]
    assert sv.metrics(mesh, "skewness")["skewness"].max < 2
    moved = mesh.points.copy()
    moved[6] += [0.01, 0.02]
    sv.write(case, mesh.with_points(moved), overwrite=True)
    again = sv.read(case)
    assert np.array_equal(again.points[:8], moved[:8])
    assert np.array_equal(again.origin.points[:, axis], turned[:, axis])
    assert np.array_equal(again.origin.points[:8].sum(1) + 1, again.origin.points[8:].sum(1))


def test_several_layers_are_not_plane(tmp_path):
    mesh = sv.read(write_mesh(tmp_path, grid((2, 2, 2)), {"z_m": "empty", "z_p": "empty"}))
    assert mesh.dim == 3
    assert mesh.roles == {"z_m": "sliding", "z_p": "sliding"}


@pytest.mark.parametrize("along", [0, 1, 2])
def test_wedges_keep_their_planes(tmp_path, along):
    half = np.radians(2.5)
    flat = np.array([[x, r] for r in (0.0, 0.5, 1.0) for x in (0.0, 1.0, 2.0)])
    points = []
    for angle in (half, -half):
        bent = np.column_stack([flat[:, 0], flat[:, 1] * np.cos(angle), flat[:, 1] * np.sin(angle)])
        points.append(np.roll(bent, along, axis=1))
    points = np.concatenate(points)
    cells = []
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        a = 3 * row + column
        low = [a, a + 1, a + 4, a + 3]
        high = [node if node < 3 else node + 9 for node in low]
        sides = [tuple(reversed(low)), tuple(high)]
        for k in range(4):
            n = (k + 1) % 4
            side = (low[k], low[n], high[n], high[k])
            if len({*side}) > 2:
                sides.append(tuple(dict.fromkeys(side)))
        cells.append([tuple(reversed(side)) for side in sides])
    points = np.delete(points, [9, 10, 11], axis=0)
    cells = [[tuple(v - 3 * (v > 11) for v in side) for side in sides] for sides in cells]
    planes = [np.roll([0, -np.sin(a), np.cos(a)], along) for a in (half, -half)]
    patches = {
        "front": lambda at: np.abs(at @ planes[0]).max() < 1e-12,
        "back": lambda at: np.abs(at @ planes[1]).max() < 1e-12,
        "axis": lambda at: False,
        "wall": lambda _: True,
    }
    write_polymesh(tmp_path / POLY, points, cells, patches, {"front": "wedge", "back": "wedge"})
    mesh = sv.read(tmp_path)
    assert mesh.dim == 2
    assert mesh.points == pytest.approx(flat, abs=1e-15)
    assert {*mesh.marker_names} == {"wall", "axis"}
    assert mesh.roles == {"axis": "sliding"}
    assert np.array_equal(mesh.marker("axis").nodes, [0, 1, 2])
    assert sv.quality(mesh).valid == 4
    moved = mesh.points + np.array([0.1, 0.2]) * (mesh.points[:, 1:] > 0)
    sv.write(tmp_path, mesh.with_points(moved), overwrite=True)
    after = sv.read(tmp_path)
    assert after.points == pytest.approx(moved, abs=1e-15)
    written = after.origin.points
    assert np.abs(written[:9] @ planes[0]).max() < 1e-15
    assert np.abs(written[[0, 1, 2, *range(9, 15)]] @ planes[1]).max() < 1e-15
    assert np.array_equal(written[:3], points[:3])


def regions_case(folder):
    """Return a case of two regions that share a side, named in ``regionProperties``."""
    low = grid((2, 2, 2))
    high = grid((3, 2, 2), place=lambda p: p / [3, 2, 2] + [1, 0, 0])
    for name, mesh in (("fluid", low), ("solid", high)):
        region = folder / "constant" / name / "polyMesh"
        write_polymesh(region, mesh.points, sides_of(mesh), patches_of(mesh))
    Form().write(
        folder / "constant",
        "regionProperties",
        "dictionary",
        "regions ( fluid (fluid) solid (solid) );",
    )
    return folder


def test_regions_are_zones(tmp_path):
    case = regions_case(tmp_path / "case")
    before = contents(case)
    mesh = sv.read(case)
    assert mesh.zones == 2
    assert [part.mesh.name for part in mesh.parts] == ["case/fluid", "case/solid"]
    assert mesh.whole_cells.tolist() == list(range(20))
    assert [one.marker for one in mesh.interfaces] == ["1:x_p", "2:x_m"]
    assert sv.metrics(mesh, "non-orthogonality")["non-orthogonality"].max == pytest.approx(
        0, abs=1e-5
    )
    moved = mesh.points.copy()
    moved[[13, 30]] += 0.01
    sv.write(case / "2", mesh.with_points(moved))
    after = contents(case)
    names = {Path(f"2/{name}/polyMesh/points") for name in ("fluid", "solid")}
    assert {*after} - {*before} == names
    sv.write(tmp_path / "new.foam", mesh.with_points(moved))
    new = contents(tmp_path / "new")
    assert {*new} == {*before}
    assert {path.name for path in before if new[path] != before[path]} == {"points"}
    assert np.array_equal(sv.read(tmp_path / "new").points, moved)
    alone = sv.read(case, zone=2)
    assert np.array_equal(alone.points, mesh.points[mesh.parts[1].points])
    sv.write(case, alone.with_points(alone.points + np.eye(3)[0]), overwrite=True)
    assert sv.read(case).points[:, 0].max() == 3
    assert sv.read(case / "constant" / "fluid").points[:, 0].max() == 1
    regions = case / "constant" / "regionProperties"
    text = regions.read_text()
    regions.write_text("FoamFile { format ascii; }\nregions ( );\n")
    with pytest.raises(MeshError, match=r"names no region; write e.g. regions \( fluid"):
        sv.read(case)
    regions.write_text(text)
    with pytest.raises(MeshError, match="there is no zone 3: its regions are fluid, solid"):
        sv.read(case, zone=3)
    with pytest.raises(MeshError, match="there is no zone 2: it has one region; leave it out"):
        sv.read(case / "constant" / "fluid", zone=2)


def test_polyhedra_are_told(tmp_path, capsys):
    points, cells = extruded(*honeycomb(2, 2), [0.0, 1.0])
    write_polymesh(tmp_path / "polyMesh", points, cells, {"all": lambda _: True})
    assert run(["info", str(tmp_path / "polyMesh")]) == 0
    told = "4 cells, of which 4 polyhedra are 56 parts around 4 added points"
    assert told in capsys.readouterr().out
    assert not parts_words(np.arange(5))


def test_a_deformed_case_has_its_reference(tmp_path, capsys):
    """Read again, its polyhedra may be divided otherwise than in the undeformed mesh."""
    points, cells = extruded(*honeycomb(4, 4), [0.0, 1.0, 2.0])
    low = lambda at: np.ptp(at[:, 2]) == 0  # noqa: E731
    case = tmp_path / "case"
    write_polymesh(case / POLY, points, cells, {"ends": low, "sides": lambda _: True})
    mesh = sv.read(case)
    shift = np.random.default_rng(3).uniform(-0.1, 0.1, mesh.points.shape)
    sv.write(case / "1", mesh.with_points(mesh.points + shift))
    again = sv.read(case / "1")
    assert not again.cells.same_as(mesh.cells)
    rated = again.with_reference(mesh)
    assert rated.cells.same_as(mesh.cells)
    count = len(points)
    assert np.array_equal(rated.points[:count], again.points[:count])
    assert 0 < np.abs(rated.points[count:] - mesh.points[count:]).max() < 0.2
    assert run(["quality", str(case / "1"), "--reference", str(case)]) == 0
    assert f"{sv.quality(rated, mesh).min:.6g}"[:6] in capsys.readouterr().out
    other = sv.read(write_mesh(tmp_path / "box", grid((2, 2, 2))))
    with pytest.raises(MeshError, match="it must have the same cells, but"):
        again.with_reference(other)


def test_a_case_that_cannot_be_streamed_is_told_what_to_do(tmp_path, capsys):
    case = write_mesh(tmp_path / "case", grid((2, 2, 2)))
    assert run(["info", str(case), "--stream"]) == 1
    told = capsys.readouterr().err
    points = case / "constant" / "polyMesh" / "points"
    assert f"`slideviz convert {points} case.su2b`, or leave out --stream" in told
    assert run(["convert", str(points), str(tmp_path / "case.su2b")]) == 0
    assert run(["info", str(tmp_path / "case.su2b"), "--stream"]) == 0


def test_a_polyhedron_that_is_not_star_shaped(tmp_path):
    """Seven boxes that make a C: no place in it sees all of its faces."""
    mesh = grid((3, 3, 1), hole=[(1, 2), (1, 2), (0, 1)])
    cells = merged(sides_of(mesh), [0, 0, 0, 0, 1, 0, 0, 0])
    write_polymesh(tmp_path / "polyMesh", mesh.points, cells, {"all": lambda _: True})
    read = sv.read(tmp_path / "polyMesh")
    assert any("not star-shaped and cannot be proved valid" in text for text in read.remarks)
    assert sv.quality(read).inverted == 0
    moved = sv.quality(read.with_points(read.points * [-1, 1, 1]), read)
    assert moved.inverted == moved.cells


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("checkMesh") is None, reason="OpenFOAM is not installed")
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_check_mesh_agrees(tmp_path, form, monkeypatch):
    """OpenFOAM reads what is written, and has the same non-orthogonality and skewness."""
    monkeypatch.setenv("WM_PROJECT_DIR", "/usr/share/openfoam")
    points, cells = extruded(*honeycomb(6, 6), [0.0, 1.0, 2.5])
    case = tmp_path / "case"
    write_polymesh(case / POLY, points, cells, {"all": lambda _: True}, form=form)
    entries = "startTime 0; endTime 1; deltaT 1; writeInterval 1;"
    schemes = ["ddt", "grad", "div", "laplacian", "interpolation", "snGrad"]
    entries += " ".join(f"{scheme}Schemes {{}}" for scheme in schemes)
    (case / "system").mkdir()
    for name in ("controlDict", "fvSchemes", "fvSolution"):
        Form().write(case / "system", name, "dictionary", entries)
    mesh = sv.read(case)
    rng = np.random.default_rng(1)
    moved = mesh.points + rng.uniform(-0.05, 0.05, mesh.points.shape)
    sv.write(case, mesh.with_points(moved), overwrite=True)
    said = subprocess.run(
        ["checkMesh", "-case", case, "-constant"], capture_output=True, text=True
    ).stdout
    found = sv.metrics(sv.read(case), ["non-orthogonality", "skewness"])
    for words, name in (
        ("non-orthogonality Max: ", "non-orthogonality"),
        ("Max skewness = ", "skewness"),
    ):
        number = float(said.partition(words)[2].split()[0])
        assert found[name].max == pytest.approx(number, rel=1e-4)
    assert "Upper triangular ordering OK." in said
