"""A reader in a process of its own can be stopped, limited, and may crash."""

import subprocess
import sys

import numpy as np
import pytest

from slideviz.errors import MeshError
from slideviz.formats import files
from slideviz.formats.files import read, write
from slideviz.formats.meshio.bridge import read_with_meshio
from tests.formats.su2_samples import SOLID, assert_same, save
from tests.processes import is_running, wait_until

NETGEN = """\
mesh3d
dimension
3
geomtype
0
bcnames
{count}
1 wall
"""

FAR_NODE = """\
$MeshFormat
4.1 0 8
$EndMeshFormat
$Nodes
1 3 1 900000000000
2 1 0 3
1
2
900000000000
0 0 0
1 0 0
0 1 0
$EndNodes
$Elements
1 1 1 1
2 1 2 1
1 1 2 900000000000
$EndElements
"""


@pytest.fixture
def vtu(tmp_path):
    path = tmp_path / "a.vtu"
    write(path, read(save(tmp_path, SOLID)))
    return path


@pytest.fixture
def started(monkeypatch):
    """Return the list of the processes that are started."""
    found = []

    class Popen(subprocess.Popen):
        def __init__(self, *args, **kwargs):
            super().__init__(*args, **kwargs)
            found.append(self)

    monkeypatch.setattr(subprocess, "Popen", Popen)
    return found


def test_the_mesh_is_the_same(vtu, started, capfd):
    seen = []
    mesh = read(vtu, progress=seen.append)
    here = read_with_meshio(vtu)
    assert_same(mesh, here)
    assert (mesh.name, mesh.source) == (here.name, here.source)
    for array in (mesh.points, mesh.cells.connectivity, mesh.markers[0].cells.types):
        assert not array.flags.writeable
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert len(started) == 1
    assert capfd.readouterr() == ("", "")


def test_the_fault_is_the_same(tmp_path):
    path = save(tmp_path, "nonsense", "a.msh")
    with pytest.raises(MeshError) as here:
        read_with_meshio(path)
    with pytest.raises(MeshError, match=r"a.msh: cannot be read as gmsh: meshio says") as there:
        read(path)
    assert str(there.value) == str(here.value)


def test_stopping_ends_the_process(vtu, started):
    class StoppedError(Exception):
        pass

    def stop(done):
        if started:
            raise StoppedError

    with pytest.raises(StoppedError):
        read(vtu, progress=stop)
    assert started[0].returncode is not None


def test_a_reader_that_takes_too_long(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_SECONDS", 1)
    path = save(tmp_path, NETGEN.format(count=10**12), "a.vol")
    with pytest.raises(
        MeshError, match=r"a.vol: cannot be read: it takes longer than a file of th"
    ):
        read(path)


@pytest.mark.parametrize("rest", ["", "BEGIN BULK", "BEGIN BULK\n\n$ end\n#\n// x\n  \n"])
def test_a_nastran_file_that_ends_before_its_data(tmp_path, rest):
    path = save(tmp_path, f"SOL 101\n{rest}", "a.bdf")
    with pytest.raises(MeshError, match=r"a.bdf: there are no data after a line BEGIN BULK; expo"):
        read(path)


def test_a_reader_that_wants_too_much_memory(tmp_path):
    path = save(tmp_path, FAR_NODE, "a.msh")
    with pytest.raises(MeshError, match=r"a.msh: cannot be read: it needs more memory than a file"):
        read(path)
    read(save(tmp_path, FAR_NODE.replace("900000000000", "9"), "b.msh"))


def test_a_reader_that_crashes(vtu, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(
        MeshError, match=r"a.vtu: cannot be read: meshio crashed on it \(code 1\); "
    ):
        read(vtu)


def test_a_reader_that_does_not_start(vtu, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/no/such/file")
    with pytest.raises(MeshError, match=r"a.vtu: cannot be read: its reader does not start: No su"):
        read(vtu)


def test_modules_beside_the_mesh_are_not_run(vtu, monkeypatch):
    (vtu.parent / "numpy.py").write_text("raise SystemExit(5)")
    monkeypatch.chdir(vtu.parent)
    assert len(read("a.vtu").cells) == 4


def test_limits_grow_with_the_file():
    seconds, memory = np.transpose([files._limits(size) for size in (0, 10**6, 10**9)])
    assert seconds.tolist() == [20, 40, 20020]
    assert memory[0] <= memory[1] <= memory[2]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such a call")
def test_the_reader_does_not_outlive_a_killed_program():
    child = "import os, time; from slideviz.system.platform import end_with; end_with(os.getppid())"
    code = (
        "import subprocess, sys\n"
        f"call = [sys.executable, '-c', {child + '; print(1, flush=True); time.sleep(300)'!r}]\n"
        "reader = subprocess.Popen(call, stdout=subprocess.PIPE)\n"
        "reader.stdout.read(1)\n"
        "print(reader.pid, flush=True)\n"
        "reader.wait()\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as parent:
        reader = int(parent.stdout.readline())
        assert is_running(reader)
        parent.kill()
    wait_until(lambda: not is_running(reader))
