"""SU2 meshes converted piece by piece: the bytes and words of a conversion in memory."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.formats import binary_copy
from slideviz.formats.su2 import text as su2_text
from slideviz.formats.su2 import write
from slideviz.streaming import converting, stream_input
from tests.builders import grid
from tests.formats.test_su2b import THREE_D, TWO_D, packed
from tests.streaming.test_run_text import odd_mesh

HALO = "MARKER_TAG= SEND_RECEIVE\nMARKER_ELEMS= 1\nSEND_TO= 1\n1 0 0\n"


@pytest.fixture(autouse=True)
def small(tmp_path, monkeypatch):
    """Pieces and blocks have few rows; the folder is the current one."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(su2_text, "BLOCK_BYTES", 700)
    monkeypatch.setattr(binary_copy, "PIECES", 3)
    monkeypatch.setattr(write, "_BLOCK_ROWS", 17)
    monkeypatch.setattr(converting, "NEAR", 5)


def converted(capsys, source, ending, *more):
    """Return exit code, words and bytes of a conversion."""
    out = Path(f"out{ending}")
    out.unlink(missing_ok=True)
    code = run(["convert", source, str(out), *more])
    found = capsys.readouterr()
    return code, found.out, found.err, out.read_bytes() if out.exists() else None


def check_alike(capsys, source, ending, *more):
    found = converted(capsys, source, ending, *more)
    assert converted(capsys, source, ending, "--stream", *more) == found
    assert not [path for path in Path().iterdir() if path.name.startswith(".")]
    return found


@pytest.mark.parametrize("kind", ["plain", "mixed", "simplex", "prism"])
@pytest.mark.parametrize(("zones", "more"), [(1, []), (3, []), (3, ["--zone", "2"])])
def test_a_text_becomes_the_binary_that_memory_gives(capsys, kind, zones, more):
    odd_mesh(Path("mesh.su2"), kind, zones)
    code, _, err, whole = check_alike(capsys, "mesh.su2", ".su2b", *more)
    assert code == 0
    assert "lacks the FFD boxes" in err
    assert ("leave out --zone and write a .su2 file to keep them" in err) is bool(more)
    Path("mesh.su2b").write_bytes(whole)
    assert check_alike(capsys, "mesh.su2b", ".su2")[0] == 0


@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("more", [[], ["--zone", "2"]])
def test_a_binary_of_any_width_and_byte_order_becomes_a_text(capsys, width, order, more):
    Path("two.su2b").write_bytes(packed([THREE_D, THREE_D], width, order))
    code, _, err, _ = check_alike(capsys, "two.su2b", ".su2", *more)
    said = "lacks the other zones of two.su2b; leave out --zone to keep them"
    assert (code, said in err) == (0, bool(more))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("NMARK= 4\n", f"NMARK= 5\n{HALO}", "has a halo (SEND_RECEIVE markers), which an SU2 bin"),
        ("MARKER_TAG= x_m", f"MARKER_TAG= {'x' * 33}", "cannot be written to an SU2 binary file"),
        ("\n9 0", "\n9 99", "node 99 does not exist"),
        ("NPOIN= 25", "NPOIN= 26", "NPOIN= 26"),
    ],
)
def test_mistakes_of_a_text_leave_what_was_there(capsys, old, new, message):
    sv.write("mesh.su2", grid((4, 4)))
    text = Path("mesh.su2").read_text()
    assert old in text
    Path("mesh.su2").write_text(text.replace(old, new, 1))
    code, _, err, whole = check_alike(capsys, "mesh.su2", ".su2b")
    assert (code, whole) == (1, None)
    assert message in err


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (np.uint64([0, 6]), np.uint64([0, 1 << 40]), "the offset of element 1 is 1099511627776"),
        (np.uint64([9, 0, 5]), np.uint64([9, 99, 5]), "element 0 has the node 99"),
        (np.float64([0.5, 0.5]), np.float64([0.5, np.nan]), "the coordinate nan, which is not fin"),
    ],
)
def test_mistakes_of_a_binary_are_told(capsys, old, new, message):
    sv.write("mesh.su2b", grid((4, 4)))
    data = Path("mesh.su2b").read_bytes()
    assert old.tobytes() in data
    Path("mesh.su2b").write_bytes(data.replace(old.tobytes(), new.tobytes(), 1))
    code, _, err, whole = check_alike(capsys, "mesh.su2b", ".su2")
    assert (code, whole) == (1, None)
    assert message in err


def test_there_must_be_such_a_zone_and_a_name_for_a_text(capsys):
    Path("two.su2b").write_bytes(packed([TWO_D, THREE_D]))
    assert "has the zones 1 to 2" in check_alike(capsys, "two.su2b", ".su2", "--zone", "3")[2]
    sv.write("mesh.su2b", grid((4, 4)))
    data = Path("mesh.su2b").read_bytes().replace(b"x_p", b"x%p")
    Path("mesh.su2b").write_bytes(data)
    assert "'x%p' cannot be written to an SU2 file" in check_alike(capsys, "mesh.su2b", ".su2")[2]


@pytest.mark.parametrize(("ending", "other"), [(".su2", ".su2b"), (".su2b", ".su2")])
def test_room_is_asked_for_before_the_work(monkeypatch, capsys, ending, other):
    sv.write(f"mesh{ending}", grid((4, 4)))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(9, 9, 100))
    code, _, err, whole = converted(capsys, f"mesh{ending}", other, "--stream")
    assert (code, whole) == (1, None)
    assert "MB of disk are needed in " in err


def test_a_mesh_too_large_for_the_memory_is_streamed_by_itself(monkeypatch, capsys):
    sv.write("mesh.su2", grid((4, 4)))
    expected = converted(capsys, "mesh.su2", ".su2b")
    size = Path("mesh.su2").stat().st_size
    monkeypatch.setattr(stream_input, "free_memory", lambda: stream_input.NEEDED["su2"] * size - 1)
    found = converted(capsys, "mesh.su2", ".su2b")
    assert "mesh.su2 needs about 0 GB of memory, 0 GB are free; it is streamed" in found[2]
    assert found[3] == expected[3]
    assert converted(capsys, "mesh.su2", ".vtu")[:1] == (0,)


@pytest.mark.parametrize("ending", [".su2", ".vtu", ".cgns"])
def test_other_formats_are_not_streamed(capsys, ending):
    sv.write("mesh.su2", grid((4, 4)))
    code, _, err, whole = converted(capsys, "mesh.su2", ending, "--stream")
    assert (code, whole) == (1, None)
    assert f"mesh.su2 to out{ending}: --stream converts from .su2 to .su2b and back" in err
