"""Session files: what is written comes back, and no file does more than raise one sentence."""

import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from slideviz.case.cfg import case_text
from slideviz.design.sweeps.table import DesignRow
from slideviz.errors import Cancelled, CaseError, Doubt, Message, SlidevizError
from slideviz.formats.files import read, write
from slideviz.mesh.model import Mesh
from slideviz.samples.table import write_sample
from slideviz.sections.model import Section
from slideviz.session import changes, jobs
from slideviz.session.design_table import DesignTable
from slideviz.session.saving import view_to_case
from slideviz.session.session_file import MissingMeshError, digest, stored_session, write_session
from slideviz.session.state import StepFrame

NOBODY = jobs.Job()
CAMERA = (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5)


def run(session, name="", **settings):
    """The session with a run of its case with other settings."""
    found = []
    case = session.case.change(**settings)
    jobs.compute(case, session.mesh, jobs.Job(found.append))
    frames = [one for one in found if isinstance(one, StepFrame)]
    session = changes.add_frames(changes.start_run(session, case, name), frames)
    return changes.end_run(session, "done")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("content")
    write_sample("passage", place, size=12)
    return place


@pytest.fixture(scope="module")
def left(folder):
    """A session as somebody left it: three runs, designs, sections, a selection."""
    case = next(folder.glob("*.cfg"))
    session = jobs.open_file(case, None, NOBODY).session
    session = run(session, steps=2, limits=())
    session = run(session, "design 1", sliding="ds", steps=1)
    session = run(session, steps=3, repair="yes", repair_below=0.9)
    session = changes.rename_run(session, 1, "ps")
    session = changes.set_view(
        changes.show_run(session, 1), color_by="skew", selected=session.mesh.marker_names[:2]
    )
    session = changes.add_section(session, Section("plane", (0.3, 0.0, 0.0), (1.0, 0.0, 0.0)))
    session = changes.replace_section(session, 0, replace(session.view.section, name="middle"))
    session = changes.choose_motion(session, 1)
    session = changes.show_beside(changes.show_frame(session, 1), 3)
    return changes.mark_cell(session, 5)


@pytest.fixture(scope="module")
def designs():
    rows = [DesignRow(1, {"STEPS": "2"}, 0.5, 0.75, 1, steps=2), DesignRow(2, problem="too far")]
    return DesignTable(("STEPS",), (("2",), ("3",), ("4",))).with_results(rows)


def save(path, session, designs=None, copied=()):
    table = designs or DesignTable()
    return jobs.save_session(path, session, (table, session.case), CAMERA, copied, NOBODY)


@pytest.fixture(scope="module")
def file(folder, left, designs):
    return save(folder / "a.slideviz", left, designs)


def opened(path, **named):
    return jobs.open_file(path, None, NOBODY, **named)


def same(one, other):
    """Whether two values have the same bits, whatever objects they are."""
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, Mesh):
        return same(one.points, other.points)
    if hasattr(one, "__dataclass_fields__"):
        names = [name for name in one.__dataclass_fields__ if name != "check_limits"]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other or (one != one and other != other)


def test_a_session_opens_where_it_was_left(file, left, designs):
    found = opened(file)
    session = found.session
    assert found.camera == CAMERA
    assert repr(found.content.designs) == repr(designs)
    assert found.content.designs_case.change(source=None) == left.case.change(source=None)
    assert session.case.change(source=None) == left.case.change(source=None)
    assert session.view == left.view
    assert session.shown == 1
    assert session.newest == left.newest
    assert session.guesses == left.guesses
    assert [(r.number, r.name, r.end) for r in session.runs] == [
        (r.number, r.name, r.end) for r in left.runs
    ]
    assert session.runs[1].panels is not None
    for now, before in zip(session.runs, left.runs, strict=True):
        assert now.saved
        assert now.case.change(source=None) == before.case.change(source=None)
        for one, other in zip(now.frames, before.frames, strict=True):
            assert same(one.step, other.step)
            assert same(one.quality, other.quality)
            assert same(one.walls.values, other.walls.values)
    assert session.runs[2].last_step.repaired is not None
    assert not session.unsaved_case
    assert session.outdated == left.outdated


def test_what_is_saved_again_is_the_same(file, folder):
    found = opened(file)
    again = save(folder / "b.slideviz", found.session, found.content.designs)
    with zipfile.ZipFile(file) as one, zipfile.ZipFile(again) as other:
        assert one.namelist() == other.namelist()
        texts = [json.loads(each.read("session.json")) for each in (one, other)]
        arrays = [name for name in one.namelist() if name.endswith(".npy")]
        assert arrays
        assert all(one.read(name) == other.read(name) for name in arrays)
    for text in texts:
        text["source"] = None
    assert texts[0] == texts[1]


def test_it_is_read_by_numpy_and_by_hand(file, left, tmp_path):
    with np.load(file) as arrays:
        points = arrays["runs/0/frames/0/step/mesh"]
    assert np.array_equal(points, left.runs[0].frames[0].mesh.points)
    with zipfile.ZipFile(file) as archive:
        text = archive.read("case.cfg").decode()
    assert "MESH_FILENAME= mesh.su2" in text
    assert "VIEW_COLOR= skew" in text


def test_messages_keep_their_kind_and_their_place(left, tmp_path):
    told = (
        "a text",
        Message("is wrong", "mend it", (Path("a.cfg"), "zone 1"), 3, "'x'", ("STEPS",)),
        Doubt("hardly moves", level="note"),
    )
    first = left.runs[0].frames[0]
    frames = (replace(first, step=replace(first.step, messages=told), label="time 1"),)
    session = replace(left, runs=(replace(left.runs[0], frames=frames),))
    place = Path(left.path).parent
    found = opened(save(place / "m.slideviz", session)).session.runs[0].frames[0]
    assert found.step.messages == told
    assert [type(one) for one in found.step.messages] == [str, Message, Doubt]
    assert found.label == "time 1"


# On another machine ----------------------------------------------------------------------


def test_the_mesh_beside_it_is_taken_first_and_without_one_a_sentence_names_it(
    file, folder, left, tmp_path
):
    alone = Path(shutil.copy(file, tmp_path / "c.slideviz"))
    with pytest.raises(MissingMeshError, match=r"its mesh mesh\.su2 is neither beside it nor in"):
        opened(alone)
    chosen = opened(alone, mesh_file=folder / "mesh.su2").session
    assert chosen.path == folder / "mesh.su2"
    assert all(one.case.mesh_file == folder / "mesh.su2" for one in chosen.runs)
    shutil.copy(folder / "mesh.su2", tmp_path)
    assert opened(alone).session.path == tmp_path / "mesh.su2"
    far = tmp_path / "far"
    far.mkdir()
    session = jobs.open_file(next(folder.glob("*.cfg")), None, NOBODY).session
    saved = save(far / "d.slideviz", session)
    shutil.copy(folder / "mesh.su2", far)
    assert opened(saved).session.path == far / "mesh.su2"


def test_copies_of_mesh_and_files_travel_with_it(tmp_path):
    here = tmp_path / "here"
    write_sample("hexahedron", here, size=6)
    session = run(changes.set_case(opened(next(here.glob("*.cfg"))).session, steps=1))
    files = [session.case.mesh_file, *session.case.motions[0].files]
    assert len(files) == 2
    saved = save(tmp_path / "e.slideviz", session, copied=files)
    shutil.rmtree(here)
    found = opened(saved, unpacked=tmp_path / "cache").session
    assert (tmp_path / "cache") in found.path.parents
    assert found.case.motions[0].files[0].is_file()
    assert not found.outdated
    assert np.array_equal(found.deformed.mesh.points, session.deformed.mesh.points)
    # Unpacked by hand, the case finds them, too.
    with zipfile.ZipFile(saved) as archive:
        archive.extractall(tmp_path / "by hand")
    assert opened(tmp_path / "by hand" / "case.cfg").session.mesh is not None
    assert opened(saved).session.mesh is not None


def test_runs_of_another_mesh_are_left_out_and_that_is_told(file, folder, tmp_path):
    shutil.copy(file, tmp_path)
    mesh = read(folder / "mesh.su2")
    write(tmp_path / "mesh.su2", mesh.with_points(1.01 * mesh.points))
    found = opened(tmp_path / file.name)
    assert found.session.runs == ()
    assert found.session.shown is None
    assert "has changed since the session was saved" in found.remark
    assert found.content.designs.rows
    assert digest(mesh) != digest(mesh.with_points(1.01 * mesh.points))


def test_of_a_file_without_the_runs_it_is_not_told_that_the_mesh_has_changed(left, folder):
    path = folder / "autosave.slideviz"
    write_session(path, left, stored_session(left, DesignTable(), None), None)
    found = opened(path)
    assert found.session.runs == ()
    assert found.session.shown is None
    assert found.remark == ""


def test_it_is_written_whole_or_not_at_all(left, designs, tmp_path):
    path = tmp_path / "f.slideviz"
    path.write_text("before")
    calls = iter([False, False, True])
    kept = (designs, left.case)
    with pytest.raises(Cancelled):
        jobs.save_session(path, left, kept, None, (), jobs.Job(stopped=lambda: next(calls)))
    assert path.read_text() == "before"
    with pytest.raises(CaseError, match="the folder does not exist"):
        write_session(tmp_path / "no" / "g.slideviz", left, stored_session(left, *kept), None)


# Damaged and hostile files ---------------------------------------------------------------


def refused(path, match=None):
    """The sentence with which a file is refused."""
    with pytest.raises(SlidevizError, match=match) as told:
        opened(path, unpacked=path.parent / "cache")
    text = str(told.value)
    assert "\n" not in text
    assert path.name in text
    return text


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_bytes_are_told_in_one_sentence_or_change_nothing(file, left, data):
    content = bytearray(file.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        # Half of the places are in the directory at the end, which has no check sum.
        begin = data.draw(st.sampled_from([0, len(content) - 3000]))
        content[data.draw(st.integers(begin, len(content) - 1))] = data.draw(st.integers(0, 255))
    bad = file.with_name("damaged.slideviz")
    bad.write_bytes(content[: data.draw(st.integers(0, len(content)))] or content)
    session, told = left, ""
    try:
        session = opened(bad, unpacked=file.with_name("cache")).session
    except SlidevizError as error:
        told = str(error)
    assert "\n" not in told
    if not told:
        for now, before in zip(session.runs, left.runs, strict=False):
            assert np.array_equal(now.last.mesh.points, before.last.mesh.points)


def rewritten(file, path, changed, **more):
    """A session file with other members: bytes by name, or None to leave one out."""
    with zipfile.ZipFile(file) as source, zipfile.ZipFile(path, "w") as target:
        for info in source.infolist():
            content = changed.get(info.filename, source.read(info))
            if content is not None:
                target.writestr(info.filename, content)
        for name, content in more.get("added", {}).items():
            target.writestr(name, content, compress_type=more.get("compress", 0))
    return path


def head_with(file, *place, value):
    """The JSON of a session with another value at a place."""
    with zipfile.ZipFile(file) as archive:
        head = json.loads(archive.read("session.json"))
    at = head
    for name in place[:-1]:
        at = at[name]
    at[place[-1]] = value
    return {"session.json": json.dumps(head)}


STEP = ("runs", 0, "frames", 0, "step")


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("runs",), 3),
        (("runs",), [None]),
        (("runs", 0, "number"), "1"),
        (("runs", 0, "number"), True),
        (("runs", 0, "end"), "exploded"),
        (("runs", 0, "class"), "Popen"),
        (("runs", 0, "case"), "session.json"),
        (("runs", 0, "case"), "../../etc/passwd"),
        ((*STEP, "mesh"), "../mesh.npy"),
        ((*STEP, "mesh"), "runs/0/frames/0/step/control.npy"),
        ((*STEP, "mesh"), 7),
        ((*STEP, "control"), "runs/0/frames/0/step/mesh.npy"),
        ((*STEP, "node_counts"), {"moving": "many"}),
        ((*STEP, "messages"), [3]),
        ((*STEP, "safe"), {"class": "SafeFraction"}),
        (("view", "color_by"), "poison"),
        (("view", "motion_index"), -2),
        (("view", "section_index"), -1),
        (("view", "marked_cell"), -7),
        (("view", "ranges"), [["skew", [0.0]]]),
        (("designs", "results"), {"one": {}}),
        (("version",), None),
        (("mesh",), 5),
        (("mesh",), ["x"]),
        (("source",), {"path": 4}),
    ],
)
def test_a_wrong_type_is_told(file, tmp_path, folder, place, value):
    shutil.copy(folder / "mesh.su2", tmp_path)
    bad = rewritten(file, tmp_path / "bad.slideviz", head_with(file, *place, value=value))
    assert "is damaged, or not a session file" in refused(bad)


def test_a_newer_file_is_told(file, folder, tmp_path):
    shutil.copy(folder / "mesh.su2", tmp_path)
    bad = rewritten(file, tmp_path / "new.slideviz", head_with(file, "version", value=99))
    assert "was saved by a newer slideviz; update slideviz" in refused(bad)


def npy(values, shape=None, descr="<f8"):
    header = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape or values.shape}}}"
    head = header.ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head.encode() + bytes(values)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x93NUMPY\x01\x00",
        npy(np.zeros((4, 3))),
        npy(np.zeros(1), (10**12, 3)),
        npy(np.zeros(1), (-1, 3)),
        npy(np.zeros(1), (10**30,)),
        npy(np.zeros((4, 3)), descr="|O"),
        npy(np.zeros((4, 3)), descr="<i8"),
        npy(np.zeros((4, 3)), descr=[("a", "<f8")]),
        b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 0xFFFF,
    ],
)
def test_an_array_of_absurd_size_or_type_is_told(file, folder, tmp_path, content):
    shutil.copy(folder / "mesh.su2", tmp_path)
    changed = {"runs/0/frames/0/step/mesh.npy": content}
    assert "is damaged" in refused(rewritten(file, tmp_path / "bad.slideviz", changed))


def test_numbers_beyond_the_mesh_and_points_that_are_not_finite_are_told(
    file, folder, left, tmp_path
):
    shutil.copy(folder / "mesh.su2", tmp_path)
    points = left.runs[0].frames[0].mesh.points.copy()
    points[3, 1] = np.nan
    changed = {"runs/0/frames/0/step/mesh.npy": npy(points)}
    assert "has a wrong type" in refused(rewritten(file, tmp_path / "nan.slideviz", changed))
    for bad in ([len(points)], [-1], [10**18]):
        changed = {"runs/0/frames/0/step/control.npy": npy(np.array(bad), descr="<i8")}
        assert "beyond the mesh" in refused(rewritten(file, tmp_path / "far.slideviz", changed))


def test_a_bomb_is_not_unpacked(file, folder, tmp_path):
    shutil.copy(folder / "mesh.su2", tmp_path)
    path = tmp_path / "bomb.slideviz"
    many = {"files/0/big.su2": bytes(10**7)}
    rewritten(file, path, {}, added=many, compress=zipfile.ZIP_DEFLATED)
    assert "compressed, or larger than the file" in refused(path)
    deep = "[" * 200_000 + "]" * 200_000
    refused(rewritten(file, tmp_path / "deep.slideviz", {"session.json": deep}))


@pytest.mark.parametrize(
    "name",
    ["files/../../up.su2", "files/0/../up.su2", "files/0/..", "files/0/", "files//etc/x",
     "files/0/a/b.su2", "files/0/a\\b.su2", "files/x/a.su2", "files/" + 300 * "x"],
)  # fmt: skip
def test_no_member_leaves_the_folder_of_copies(file, folder, tmp_path, name):
    inner = tmp_path / "inner"
    inner.mkdir()
    shutil.copy(folder / "mesh.su2", inner)
    bad = rewritten(file, inner / "bad.slideviz", {}, added={name: "x"})
    told = ""
    try:
        opened(bad, unpacked=inner / "cache")
    except SlidevizError as error:
        told = str(error)
    assert "\n" not in told
    every = {each for each in tmp_path.rglob("*") if each.is_file()}
    outside = every - set((inner / "cache").rglob("*"))
    assert sorted(each.name for each in outside) == ["bad.slideviz", "mesh.su2"]


def test_a_link_in_it_is_not_followed(file, folder, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("secret")
    inner = tmp_path / "inner"
    inner.mkdir()
    shutil.copy(folder / "mesh.su2", inner)
    link = zipfile.ZipInfo("files/0/mesh.su2")
    link.external_attr = 0o120777 << 16
    bad = rewritten(file, inner / "bad.slideviz", {}, added={link: str(secret)})
    opened(bad, unpacked=inner / "cache")
    copies = [each for each in (inner / "cache").rglob("*") if not each.is_dir()]
    assert [each.read_text() for each in copies] == [str(secret)]
    assert not any(each.is_symlink() for each in copies)


@pytest.mark.parametrize("content", [b"", b"PK", b"not a zip", b"\0" * 5000])
def test_what_is_no_session_is_told(tmp_path, content):
    path = tmp_path / "a.slideviz"
    path.write_bytes(content)
    refused(path)


@pytest.mark.parametrize("name", ["case.cfg", "session.json", "runs/0/case.cfg"])
def test_a_missing_member_or_a_wrong_case_is_told(file, folder, tmp_path, name):
    shutil.copy(folder / "mesh.su2", tmp_path)
    for content in (None, b"NONSENSE= 3", b"\xff\xfe\0", b""):
        refused(rewritten(file, tmp_path / "bad.slideviz", {name: content}))


def test_a_case_without_a_mesh_is_told(file, tmp_path):
    changed = {"case.cfg": b"STEPS= 3\n"}
    refused(rewritten(file, tmp_path / "bad.slideviz", changed), "the case in it names no mesh")


# Pictures --------------------------------------------------------------------------------


def picture(path, text=None):
    known = PngInfo()
    if text is not None:
        known.add_itxt("slideviz", text)
    Image.new("RGB", (4, 4)).save(path, pnginfo=known)
    return path


def test_a_picture_opens_as_the_case_in_it(folder, left, tmp_path):
    text = case_text(folder / "a.png", view_to_case(left, CAMERA))
    found = opened(picture(folder / "a.png", text))
    assert found.camera == CAMERA
    assert found.session.view.color_by == "skew"
    assert found.session.case.source is None
    assert not found.session.unsaved_case
    with pytest.raises(MissingMeshError, match=r"its mesh mesh\.su2 is neither"):
        opened(picture(tmp_path / "a.png", text))
    chosen = opened(tmp_path / "a.png", mesh_file=folder / "mesh.su2")
    assert chosen.session.path == folder / "mesh.su2"


@pytest.mark.parametrize("content", [b"", b"no picture", None])
def test_a_picture_without_a_case_is_told(tmp_path, content):
    path = picture(tmp_path / "a.png")
    if content is not None:
        path.write_bytes(content)
    refused(path, "has no case in it; open a picture that the window has exported")
    bomb = picture(tmp_path / "b.png", 20_000_000 * "x")
    assert bomb.stat().st_size > 10_000_000
    refused(bomb)


def test_a_picture_with_a_wrong_case_is_told(tmp_path):
    refused(picture(tmp_path / "a.png", "STEPS= many"), "STEPS: ")
    refused(picture(tmp_path / "a.png", "STEPS= 3"), "the case in it names no mesh")


@pytest.mark.parametrize("name", ["points", "points.gz", "regionProperties"])
def test_a_mesh_of_several_files_is_not_copied_in_part(left, tmp_path, name):
    mesh = tmp_path / "constant" / "polyMesh" / name
    with pytest.raises(CaseError, match="several files; save the session without its mesh"):
        save(tmp_path / "a.slideviz", left, copied=[mesh])
    assert not (tmp_path / "a.slideviz").exists()
