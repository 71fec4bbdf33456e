"""SU2 binary meshes in the commands: by ending and by key, converted, and what they cannot hold."""

from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.formats.losses import left_out
from slideviz.formats.su2b.layout import MAGIC
from slideviz.samples.table import write_sample
from tests.formats.test_su2b import THREE_D, TWO_D, packed

FFD = "FFD_NBOX= 1\nFFD_NLEVEL= 1\n"


@pytest.fixture
def square(tmp_path: Path, monkeypatch) -> Path:
    """A folder with the 25 by 25 square case, its mesh as text and binary, as current folder."""
    write_sample("square", tmp_path)
    monkeypatch.chdir(tmp_path)
    assert run(["convert", "mesh.su2", "mesh.su2b"]) == 0
    return tmp_path


def is_binary(path):
    return Path(path).read_bytes()[:4] in MAGIC


def test_a_run_gives_the_same_mesh_from_text_and_binary(square):
    call = ["run", "square.cfg", "-q", "--steps", "2"]
    assert run([*call, "-o", "text.su2"]) == 0
    binary = [*call, "--set", "MESH_FILENAME=mesh.su2b"]
    assert run([*binary, "-o", "binary.su2b", "--steps-dir", "steps"]) == 0
    one, other = sv.read("text.su2"), sv.read("binary.su2b")
    assert np.array_equal(one.points.view(np.int64), other.points.view(np.int64))
    assert sorted(p.name for p in Path("steps").iterdir()) == ["mesh_1.su2b", "mesh_2.su2b"]
    assert Path("steps/mesh_2.su2b").read_bytes() == Path("binary.su2b").read_bytes()
    for command in (["info"], ["quality", "--reference", "mesh.su2"]):
        assert run([command[0], "binary.su2b", *command[1:]]) == 0


def test_keys_say_the_format_whatever_the_ending(square, capsys):
    Path("mesh.su2b").rename("mesh.bin")
    call = ["run", "square.cfg", "-q", "--steps", "1", "--set", "MESH_FILENAME=mesh.bin"]
    call += ["--set", "MESH_FORMAT=SU2B", "--set", "MESH_OUT_FORMAT=su2b"]
    assert run([*call, "--set", "MESH_OUT_FILENAME=out.mesh"]) == 0
    assert is_binary("out.mesh")
    assert run([*call, "-o", "plain"]) == 0
    assert is_binary("plain")
    assert run([*call, "-o", "text.su2"]) == 1
    words = "text.su2: its ending is .su2, but MESH_OUT_FORMAT says SU2B; change one of them"
    assert words in capsys.readouterr().err
    assert not Path("text.su2").exists()
    text = Path("square.cfg").read_text().replace("MESH_OUT_FILENAME", "% MESH_OUT_FILENAME")
    Path("square.cfg").write_text(text + "MESH_OUT_FORMAT= SU2B\n")
    assert run(["run", "square.cfg", "-q", "--steps", "1"]) == 0
    assert is_binary("mesh_def.su2b")


def test_a_format_that_is_none_is_told(square, capsys):
    assert run(["run", "square.cfg", "--set", "MESH_FORMAT=CGNS"]) == 1
    assert "'CGNS' is not one of SU2 | SU2B" in capsys.readouterr().err
    assert run(["run", "square.cfg", "--set", "MESH_FORMAT=SU2B"]) == 1
    assert "mesh.su2: byte 0: this is not an SU2 binary mesh" in capsys.readouterr().err


def test_what_a_binary_mesh_loses_is_said_before_the_work(square, capsys):
    with Path("mesh.su2").open("a") as file:
        file.write(FFD)
    words = "lacks the FFD boxes of mesh.su2; write a .su2 file"
    for call in (["convert", "mesh.su2", "out.su2b"], ["run", "square.cfg", "-o", "out.su2b"]):
        assert run(call) == 0
        assert f"slideviz: warning: out.su2b {words}" in capsys.readouterr().err
    mesh = sv.read("mesh.su2")
    assert left_out(Path("a.su2b"), mesh) == "a.su2b does not hold the FFD boxes."
    assert left_out(Path("a.su2"), mesh) == left_out(Path("a.su2b"), sv.read("out.su2b")) == ""


def test_zones_that_a_run_does_not_write_are_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("two.su2b").write_bytes(packed([TWO_D, THREE_D]))
    marker = sv.read("two.su2b", zone=2).marker_names[0]
    Path("a.cfg").write_text(
        f"MESH_FILENAME= two.su2b\nZONE= 2\nMARKER_MOVING= ({marker})\n"
        f"MOTION= ({marker}, translate, 0, 0, 0)\n"
    )
    for name in ("out.su2", "out.vtu"):
        assert run(["run", "a.cfg", "-q", "-o", name]) == 0
        words = f"{name} lacks the other zones of two.su2b; write a .su2b file to keep them"
        assert words in capsys.readouterr().err
    assert run(["run", "a.cfg", "-q", "-o", "out.su2b"]) == 0
    assert "zone" not in capsys.readouterr().err


def test_convert_tells_what_every_zone_loses(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("two.su2b").write_bytes(packed([TWO_D, TWO_D]))
    assert run(["convert", "two.su2b", "two.su2"]) == 0
    with Path("two.su2").open("a") as file:
        file.write(FFD)
    assert run(["convert", "two.su2", "again.su2b"]) == 0
    assert "lacks the FFD boxes of two.su2; write" in capsys.readouterr().err


def test_a_halo_is_refused_before_the_work(square, capsys):
    sends = "MARKER_TAG= SEND_RECEIVE\nMARKER_ELEMS= 1\nSEND_TO= 1\n1 0 0\n"
    text = Path("mesh.su2").read_text().replace("NMARK= 5", "NMARK= 6") + sends
    Path("mesh.su2").write_text(text)
    Path("out.su2b").unlink(missing_ok=True)
    for call in (["convert", "mesh.su2", "out.su2b"], ["run", "square.cfg", "-o", "out.su2b"]):
        assert run(call) == 1
        assert "has a halo (SEND_RECEIVE markers)" in capsys.readouterr().err
    assert not Path("out.su2b").exists()


def test_convert_has_all_zones_or_one(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("two.su2b").write_bytes(packed([TWO_D, TWO_D], 4, ">"))
    assert run(["convert", "two.su2b", "two.su2"]) == 0
    assert run(["convert", "two.su2", "again.su2b"]) == 0
    assert capsys.readouterr().err == ""
    assert Path("again.su2b").read_bytes() == packed([TWO_D, TWO_D])
    assert run(["convert", "two.su2", "second.su2b", "--zone", "2"]) == 0
    assert Path("second.su2b").read_bytes() == packed([TWO_D])
    said = "lacks the other zones of two.su2; leave out --zone to keep them"
    assert said in capsys.readouterr().err
    assert run(["convert", "two.su2", "second.su2", "--zone", "2"]) == 0
    assert "second.su2 gets only the mesh of zone 2" in capsys.readouterr().err
    assert run(["convert", "two.su2b", "second.vtu", "--zone", "2"]) == 0
    assert len(sv.read("second.vtu").points) == 5
    assert "leave out --zone and write a .su2b file to keep them" in capsys.readouterr().err
    assert run(["convert", "two.su2b", "out.nothing"]) == 1
    assert "no mesh format has the ending .nothing" in capsys.readouterr().err
    assert run(["convert", "two.su2b", "two.su2b"]) == 1
    assert "is the input mesh" in capsys.readouterr().err


HALO = "MARKER_TAG= SEND_RECEIVE\nMARKER_ELEMS= 1\nSEND_TO= 1\n1 0 0\n"


@pytest.mark.parametrize(
    ("more", "lost"),
    [
        ("", ""),
        (FFD, "the FFD boxes"),
        ("NPERIODIC= 0\nANGLE= 1\n", "the other sections (NPERIODIC, ANGLE)"),
        (FFD + HALO, "the halo (SEND_RECEIVE; its cells are ordinary cells now) and the FFD boxes"),
    ],
)
def test_convert_and_run_say_exactly_what_a_vtu_file_loses(square, capsys, more, lost):
    text = Path("mesh.su2").read_text() + more
    Path("mesh.su2").write_text(text.replace("NMARK= 5", f"NMARK= {5 + text.count('SEND_TO')}"))
    assert run(["convert", "mesh.su2", "out.vtu"]) == 0
    told = f"slideviz: warning: out.vtu lacks {lost} of mesh.su2; write a .su2 file to keep them\n"
    assert capsys.readouterr().err == (told if lost else "")
    assert run(["run", "square.cfg", "-q", "--steps", "1", "-o", "out.vtu"]) == 0
    assert (told in capsys.readouterr().err) is bool(lost)


def test_convert_says_once_that_other_zones_are_lost(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("two.su2b").write_bytes(packed([TWO_D, TWO_D]))
    assert run(["convert", "two.su2b", "second.vtu", "--zone", "2"]) == 0
    assert capsys.readouterr().err.count("the other zones") == 1


@pytest.mark.parametrize("ending", [".vtu", ".vtkhdf"])
def test_convert_writes_the_quality_for_paraview(square, ending):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    assert run(["convert", "mesh.su2", f"out{ending}"]) == 0
    reader = vtkHDFReader() if ending == ".vtkhdf" else vtkXMLUnstructuredGridReader()
    reader.SetFileName(f"out{ending}")
    reader.Update()
    found = reader.GetOutput()
    grid = found.GetPartition(0, 0) if ending == ".vtkhdf" else found
    expected = sv.quality(sv.read("mesh.su2")).values
    values = vtk_to_numpy(grid.GetCellData().GetArray("size-skew"))
    assert np.array_equal(values[: len(expected)], expected)
