"""The limits that SECURITY.md states are true: files that would break them are refused."""

import re
import time
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import slideviz as sv
from slideviz.case.lines import LARGEST, read_text
from slideviz.cli import run
from slideviz.errors import CaseError, MeshError, SlidevizError
from slideviz.formats import files
from slideviz.formats.openfoam import foam_file
from slideviz.session import jobs, session_file
from slideviz.session.design_table import MOST, DesignTable
from slideviz.system.file_checks import read_json
from tests.builders import square
from tests.cgns_files import passage_grid, save_passage

PAGE = (Path(__file__).parents[1] / "SECURITY.md").read_text("utf-8")


def opened(path):
    return jobs.open_file(path, None, jobs.Job())


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sv.write("mesh.su2", square(4))
    Path("case.cfg").write_text("MESH_FILENAME= mesh.su2\nMARKER_MOVING= ( BLOCK )\n")
    return tmp_path


@pytest.fixture
def session(here):
    """A session with a copy of its mesh."""
    found = opened(Path("case.cfg")).session
    camera = (1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5)
    table = (DesignTable(), found.case)
    return jobs.save_session(
        Path("a.slideviz"),
        found,
        table,
        camera,
        [Path("mesh.su2")],
        jobs.Job(),
    )


def test_the_page_states_the_limits_of_the_code():
    sizes = {
        f"{size / 1e6:,.0f} MB" if size < 1e9 else f"{size / 1e9:.0f} GB"
        for size in LARGEST.values()
    }
    assert [size for size in sizes if size not in PAGE] == []
    assert f"{MOST:,} designs" in PAGE
    assert (files._SECONDS, files._SECONDS_PER_BYTE) == (20, 20e-6)
    assert (files._MEMORY, files._MEMORY_PER_BYTE) == (2 << 30, 400)
    assert session_file._LARGEST_TEXT == 100_000_000
    assert (foam_file.UNPACKED, foam_file._SPARE) == (200, 1 << 20)
    assert foam_file.LARGEST_FACE == 100
    assert "private advisories of GitHub" in PAGE
    assert not re.search(r"[\w.]+@[\w.]+", PAGE)


@pytest.mark.parametrize("what", LARGEST)
def test_texts_larger_than_their_limit_are_not_read(here, what):
    path = Path("big.txt")
    with path.open("wb") as file:
        file.truncate(LARGEST[what] + 1)
    with pytest.raises(CaseError, match=f"big.txt: has .* MB, and no {what} has more than"):
        read_text(path, what)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("mesh.su2", "NPOIN= ", "NPOIN= 99999999999"),
        ("mesh.su2", "NELEM= ", "NELEM= 99999999999"),
        ("mesh.su2", "MARKER_ELEMS= ", "MARKER_ELEMS= 99999999999"),
    ],
)
def test_counts_take_no_memory_before_they_are_compared_with_the_size(here, name, old, new):
    text = Path(name).read_text()
    assert old in text
    Path(name).write_text(text.replace(old, new, 1))
    tracemalloc.start()
    try:
        with pytest.raises(MeshError, match=r"mesh\.su2"):
            sv.read(name)
        assert tracemalloc.get_traced_memory()[1] < 10e6
    finally:
        tracemalloc.stop()


def test_counts_of_binary_meshes_are_compared_with_the_size(here):
    sv.write("a.su2b", sv.read("mesh.su2"))
    content = Path("a.su2b").read_bytes()
    for place in range(0, len(content) - 8, 4):
        Path("b.su2b").write_bytes(content[:place] + b"\xff\xff\xff\x7f" + content[place + 4 :])
        tracemalloc.start()
        try:
            sv.read("b.su2b")
        except MeshError:
            pass
        finally:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert peak < 50e6, place


def test_hdf5_bombs_are_refused(here):
    """Numbers that the file does not have, and that HDF5 would fill in, or unpack."""
    sv.write("a.med", square(4))
    with h5py.File("a.med", "r+") as file:
        file.create_dataset("bomb", (10**10,), "f8", chunks=(1000,), compression="gzip")
    with pytest.raises(MeshError, match=r"'/bomb' is said to have 80,000 MB, and the file has 0"):
        sv.read("a.med")


def test_a_bomb_in_cgns_ends_at_the_limit_of_memory(here):
    path = save_passage(Path("a.cgns"), passage_grid((2, 2, 2)))
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visititems(
            lambda name, _: names.append(name) if name.endswith("CoordinateX/ data") else None
        )
        for name in names:
            kind = file[name].dtype
            del file[name]
            file.create_dataset(
                name, (3, 10**5, 10**6), kind, chunks=(1, 1, 1000), compression="gzip"
            )
    with pytest.raises(MeshError, match=r"a\.cgns"):
        sv.read(path)


@pytest.mark.parametrize("ending", [".vtu", ".xdmf"])
def test_entities_of_xml_are_not_expanded_without_an_end(here, ending):
    laughs = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 12))
    head = f'<?xml version="1.0"?><!DOCTYPE V [<!ENTITY e0 "ha">{laughs}]>'
    kind = "VTKFile" if ending == ".vtu" else "Xdmf"
    path = Path(f"a{ending}")
    path.write_text(f'{head}<{kind} type="UnstructuredGrid"><DataItem>&e11;</DataItem></{kind}>')
    begin = time.process_time()
    with pytest.raises(MeshError, match=f"a{ending}: cannot be read"):
        sv.read(path)
    assert time.process_time() - begin < 20


def changed_session(path, change):
    """A session whose members ``change`` replaces."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile("b.slideviz", "w") as archive:
        for name, content in change(members).items():
            archive.writestr(name, content)
    return Path("b.slideviz")


def test_zip_bombs_are_refused(session):
    with zipfile.ZipFile("bomb.slideviz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("case.cfg", b"%" * 50_000_000)
        archive.writestr("session.json", b"{}")
    assert Path("bomb.slideviz").stat().st_size < 100_000
    with pytest.raises(CaseError, match="its members are compressed, or larger than the file"):
        opened(Path("bomb.slideviz"))


def test_texts_of_sessions_have_a_limit(session, monkeypatch):
    monkeypatch.setattr(session_file, "_LARGEST_TEXT", 10)
    with pytest.raises(CaseError, match=r"is damaged, or not a session file .*is too large"):
        opened(session)


def test_json_that_is_nested_too_deep_is_damaged(session):
    deep = b"[" * 100_000 + b"]" * 100_000
    with pytest.raises(CaseError, match="is damaged, or not a session file"):
        opened(changed_session(session, lambda members: members | {"session.json": deep}))
    Path("deep.json").write_bytes(deep)
    with pytest.raises(ValueError, match="nested too deep"):
        read_json(Path("deep.json"))


def test_arrays_of_sessions_are_no_pickles(here):
    """An array of objects would be unpickled, which runs code."""
    np.save("objects.npy", np.array([print], object), allow_pickle=True)
    with zipfile.ZipFile("c.zip", "w") as archive:
        archive.write("objects.npy")
    with zipfile.ZipFile("c.zip") as archive, pytest.raises(ValueError, match="OBJECT array"):
        session_file._Reader(archive, Path("c.zip"))._array("objects.npy", np.float64)


def test_files_of_sessions_stay_in_their_folder(session):
    moved = {"files/../../../evil.su2": b"x", "files/..": b"x"}
    for name, content in moved.items():
        path = changed_session(session, lambda members, n=name, c=content: members | {n: c})
        try:
            opened(path)
        except SlidevizError:
            continue
    assert not Path("../evil.su2").exists()
    assert not Path("../../evil.su2").exists()


def test_texts_and_sizes_of_pictures_have_limits(here):
    info = PngInfo()
    info.add_itxt("slideviz", "%" * 1_100_000, zip=True)
    Image.new("RGB", (4, 4)).save("a.png", pnginfo=info)
    with pytest.raises(CaseError, match="has no case in it"):
        opened(Path("a.png"))
    content = bytearray(Path("a.png").read_bytes())
    content[16:24] = (60_000).to_bytes(4, "big") * 2
    content[29:33] = zlib.crc32(bytes(content[12:29])).to_bytes(4, "big")
    Path("b.png").write_bytes(content)
    with pytest.raises(CaseError, match="has no case in it"):
        opened(Path("b.png"))


@pytest.mark.parametrize(
    "text", ["(" * 200_000, "MOTION= " + "(" * 100_000, 'MESH_FILENAME= "' * 9999]
)
def test_brackets_nested_deep_are_no_case(here, text, capsys):
    Path("deep.cfg").write_text(text)
    assert run(["run", "deep.cfg", "-o", "out.su2"]) == 1
    told = capsys.readouterr().err
    assert "internal error" not in told
    assert max(map(len, told.splitlines())) < 2000


def test_cells_of_tables_have_a_limit(here, capsys):
    Path("designs.csv").write_text("STEPS\n" + "1" * 140_000 + "\n")
    assert run(["sweep", "case.cfg", "designs.csv", "-o", "swept"]) == 1
    assert "field larger than field limit (131072)" in capsys.readouterr().err
