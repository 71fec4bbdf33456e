"""Streamed runs on several ranks: the bits of one process, one sentence, nothing half-written."""

import importlib.util
import json
import os
import pickle
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

import slideviz as sv
from slideviz.cli import run
from slideviz.errors import MeshError, NodeError
from slideviz.formats.su2b.layout import MAGIC
from slideviz.samples.table import write_sample
from slideviz.streaming import run as streamed_run
from slideviz.streaming import skin
from slideviz.streaming.run import stream
from slideviz.system import ranks, threads
from slideviz.system.cleanup import PREFIX
from tests.streaming.test_run import made

MPI = shutil.which("mpirun") and importlib.util.find_spec("mpi4py")
needs_mpi = pytest.mark.skipif(
    not MPI and os.environ.get("SLIDEVIZ_TESTS") != "all",
    reason="needs mpirun (openmpi-bin) and mpi4py",
)

DRIVER = """
import os, signal, sys, time
rank = int(os.environ.get("OMPI_COMM_WORLD_RANK", 0))
from slideviz.streaming import run as streamed_run
from slideviz.streaming import skin
from slideviz.formats import binary_copy
from slideviz.formats.su2 import text as su2_text
streamed_run.CHUNK, skin.BLOCK, su2_text.BLOCK_BYTES, binary_copy.PIECES = 37, 50, 700, 2
move = streamed_run.write_points
def late(*given):
    time.sleep({pause})
    {hook}
    return move(*given)
streamed_run.write_points = late
from slideviz.__main__ import _heed_signals
_heed_signals()
from slideviz.cli import run
sys.exit(run(sys.argv[1:]))
"""
"""A command in small parts; ``hook`` comes before each that is written, with its ``given``."""


OPEN_MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",  # which containers forbid
}


def started(folder, count, *words, hook="pass", pause=0.0):
    script = DRIVER.format(hook=hook, pause=pause)
    call = [sys.executable, "-c", script, "run", "square.cfg", "-q", *words]
    if count:
        call = ["mpirun", "--oversubscribe", "-n", str(count), *call]
    root = str(Path(sv.__file__).parents[1])
    environment = os.environ | OPEN_MPI | {"PYTHONPATH": root}
    pipe = subprocess.PIPE
    return subprocess.Popen(call, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True)


def done(process):
    try:
        out, err = process.communicate(timeout=120)
    finally:
        process.kill()
    return process.returncode, out, err


@pytest.fixture
def square(tmp_path):
    write_sample("square", tmp_path, 25, file_format="su2b")
    return tmp_path


def results(folder):
    report = json.loads((folder / "out.json").read_text())
    for name in ("seconds", "condition"):  # the second is an estimate, which differs
        assert report.pop(name)
    return report, (folder / "out.su2b").read_bytes(), (folder / "out_qual.txt").read_bytes()


WORDS = ("--stream", "-o", "out.su2b", "--json", "out.json")


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """What one process makes, in parts of the usual size."""
    folder = tmp_path_factory.mktemp("alone")
    write_sample("square", folder, 25, file_format="su2b")
    here = Path.cwd()
    os.chdir(folder)
    try:
        assert run(["run", "square.cfg", "-q", *WORDS]) == 0
    finally:
        os.chdir(here)
    return results(folder)


@needs_mpi
@pytest.mark.parametrize(
    "count", [pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)]
)
def test_bits_are_those_of_one_process(square, alone, count):
    assert done(started(square, count, *WORDS)) == (0, "", "")
    assert results(square) == alone
    assert not list(square.glob(".*"))


@pytest.mark.slow
@needs_mpi
def test_a_text_is_that_of_a_run_in_memory(tmp_path):
    write_sample("square", tmp_path, 25)
    case = sv.Case.read(tmp_path / "square.cfg")
    *_, last = sv.deform(case, sv.read(case.mesh_file))
    sv.write(tmp_path / "memory.su2", last.mesh)
    words = ("--stream", "-o", "out.su2")
    assert done(started(tmp_path, 2, *words)) == (0, "", "")
    assert (tmp_path / "out.su2").read_bytes() == (tmp_path / "memory.su2").read_bytes()
    assert not list(tmp_path.glob(".*"))


class Sent(ranks.SerialPool):
    """One process that sends itself all that ranks send each other."""

    size = 3

    @contextmanager
    def sharing(self, make, *given):
        make, given = sent((make, given))
        with make(*given) as work:
            yield lambda tasks: (sent(work(sent(task))) for task in tasks)


def sent(thing):
    return pickle.loads(pickle.dumps(thing, 5))


@pytest.mark.parametrize(
    ("name", "size", "sets"),
    [
        ("square", 25, ("STEPS=2", "SLIDING_MODE=ds", "RBF_KERNEL=thin-plate")),
        ("cylindrical", 9, ("STEPS=2", "METHOD=idw")),
        ("polar", 12, ("STEPS=auto", "REPAIR=YES", "REPAIR_BELOW=0.9")),
        ("stator", 5000, ("STEPS=2",)),
    ],
)
def test_what_moves_nodes_can_be_sent(tmp_path, monkeypatch, name, size, sets):
    """Every kind of field and frame."""
    case = made(tmp_path, name, size, sets)
    one = stream(case, tmp_path / "one.su2b")
    monkeypatch.setattr(streamed_run, "CHUNK", 500)
    monkeypatch.setattr(skin, "BLOCK", 300)
    other = stream(case, tmp_path / "other.su2b", ranks=Sent())
    assert (tmp_path / "one.su2b").read_bytes() == (tmp_path / "other.su2b").read_bytes()
    assert np.array_equal(one.quality.values, other.quality.values)
    assert one.quality.summary() == other.quality.summary()
    assert one.folded == other.folded


@needs_mpi
@pytest.mark.slow
def test_steps_are_found_by_all_and_inverted_cells_told_by_one(square):
    """Unsound trials are errors of some rank, after which all go on together."""
    words = ("--set", "STEPS=auto", "--set", "SLIDING_MODE=none", "--set", "PERIODIC_MODE=none")
    found = []
    for count in (0, 2):
        code, out, err = done(started(square, count, *WORDS, *words))
        assert code in (0, 3)
        assert out == ""
        said = [line for line in err.splitlines() if line.startswith("slideviz:")]
        found.append((code, said, results(square)))
    assert found[0] == found[1]
    assert len(found[0][2][0]["tried"]) > 1


@pytest.mark.slow
@needs_mpi
def test_an_error_of_one_rank_is_told_once_and_leaves_nothing(square):
    (square / "out.su2b").write_bytes(b"older")
    hook = "if rank and given[-1][0]: raise OSError(28, 'full')"
    code, out, err = done(started(square, 2, *WORDS, hook=hook, pause=0.01))
    assert (code, out) == (1, "")
    assert err.count("slideviz:") == 1
    assert "slideviz: out.su2b: cannot be written: the disk is full; free some space or" in err
    assert (square / "out.su2b").read_bytes() == b"older"
    assert not list(square.glob(".*"))


def test_errors_of_other_ranks_can_be_raised():
    here = ranks.Ranks(SimpleNamespace(rank=3), 1)
    with pytest.raises(FileNotFoundError) as gone:
        Path("nowhere").read_bytes()
    told = here._portable(gone.value)
    assert isinstance(told, MeshError)
    assert f"nowhere: not there for rank 3 on {os.uname().nodename}; put mesh and" in str(told)

    class OddError(Exception):
        def __init__(self, one, two):
            super().__init__(f"{one} and {two}")

    told = here._portable(OddError(1, 2))
    assert isinstance(told, RuntimeError)
    assert str(told) == "OddError: 1 and 2"
    node = NodeError("nodes {} and {}", 3, 4)
    assert here._portable(node) is node
    assert sent(node).nodes == (3, 4)
    assert str(sent(node)) == "nodes 3 and 4"


@pytest.mark.slow
@needs_mpi
def test_a_killed_rank_ends_all_and_leaves_nothing(square):
    kill = "if rank == 1 and given[-1][0] > 300: time.sleep(.5), os.kill(os.getpid(), 9)"
    code, out, err = done(started(square, 2, *WORDS, hook=kill, pause=0.02))
    assert (code != 0, out) == (True, "")
    assert err.count("slideviz: ended by SIGTERM; it leaves nothing half-written\n") == 1
    assert err.count("slideviz:") == 1
    assert not (square / "out.su2b").exists()
    assert not list(square.glob(".*"))


@needs_mpi
def test_processes_that_are_not_connected_are_told(square):
    environment = {"OMPI_COMM_WORLD_SIZE": "3", "OMPI_COMM_WORLD_RANK": "0"}
    call = [sys.executable, "-m", "slideviz", "run", "square.cfg", "--stream"]
    root = str(Path(sv.__file__).parents[1])
    process = subprocess.run(
        call,
        cwd=square,
        env=os.environ | environment | {"PYTHONPATH": root},
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 1
    assert "3 processes were started, but mpi4py, with Open MPI" in process.stderr
    assert "sees 1; start them with the mpirun of that MPI" in process.stderr


@pytest.mark.parametrize(
    ("size", "rank"),
    [
        ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
        ("PMI_SIZE", "PMI_RANK"),
        ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
    ],
)
def test_what_several_processes_cannot_share_is_told_once(square, monkeypatch, capfd, size, rank):
    monkeypatch.chdir(square)
    monkeypatch.setenv(size, "4")
    monkeypatch.setenv(rank, "0")
    for words in (["run", "square.cfg", "-o", "out.su2b"], ["info", "mesh.su2b"], []):
        assert run(words) == 1
        said = capfd.readouterr().err
        assert "4 processes of one command were started, but only `slideviz run` with" in said
        assert f"(unset {size} where" in said
    monkeypatch.setitem(sys.modules, "mpi4py", None)
    assert run(["run", "square.cfg", "--stream"]) == 1
    said = capfd.readouterr().err
    assert "4 processes were started, which needs mpi4py; install it with `pip" in said
    monkeypatch.setitem(sys.modules, "mpi4py", ModuleType("mpi4py"))  # without its MPI
    assert run(["run", "square.cfg", "--stream"]) == 1
    said = capfd.readouterr().err
    assert "4 processes were started, but mpi4py finds no MPI library: cannot import name" in said
    assert said.count("\n") == 1
    assert not (square / "out.su2b").exists()
    # One process is none of several.
    monkeypatch.setenv(size, "1")
    assert run(["run", "square.cfg", "--stream", "-q", "-o", "out.su2b"]) == 0


def test_other_ranks_say_nothing(square):
    environment = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "1"}
    root = str(Path(sv.__file__).parents[1])
    process = subprocess.run(
        [sys.executable, "-m", "slideviz", "info", "mesh.su2b"],
        cwd=square,
        env=os.environ | environment | {"PYTHONPATH": root},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (process.returncode, process.stdout, process.stderr) == (0, "", "")


def test_mpi_is_not_loaded_for_one_process(square):
    script = (
        "import sys; from slideviz.cli import run; "
        "run(['run', 'square.cfg', '--stream', '-q', '-o', 'out.su2b']); "
        "sys.exit('mpi4py' in sys.modules)"
    )
    root = str(Path(sv.__file__).parents[1])
    call = [sys.executable, "-c", script]
    subprocess.run(call, cwd=square, env=os.environ | {"PYTHONPATH": root}, check=True)


@pytest.mark.parametrize(
    ("cores", "each"),
    [([{0}, {1}], 1), ([{0, 1}] * 4, 1), ([{0, 1, 2, 3}] * 2, 2), ([{0, 1, 2}, {3, 4, 5}], 3)],
)
def test_ranks_of_a_machine_share_its_cores(monkeypatch, cores, each):
    """Bound to cores or not."""
    given = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: cores[0])
    monkeypatch.setattr(os, "sched_setaffinity", lambda _, those: given.append(those))
    near = SimpleNamespace(size=len(cores), allgather=lambda _: cores)
    assert ranks._threads_of(near) == each
    assert given == [set().union(*cores)]


@contextmanager
def working(seen):
    def work(task):
        if task == 7:
            raise KeyError(task)
        time.sleep(0.002 * (task % 3))
        seen.append(task)
        return 10 * task

    yield work


def test_parts_come_in_order_and_none_is_begun_after_an_error():
    seen = []
    with ranks.SERIAL.sharing(working, seen) as do:
        assert list(do(range(7))) == list(range(0, 70, 10))
        assert list(do([])) == []
        come = do(range(5, 1000))
        assert [next(come), next(come)] == [50, 60]
        with pytest.raises(KeyError):
            next(come)
    assert max(seen) < 100


def test_threads_are_limited_for_a_time():
    before = threads.cores()
    with ranks.thread_limit(1):
        assert threads.cores() == 1
    assert threads.cores() == before


@needs_mpi
@pytest.mark.slow
def test_killing_ranks_at_random_moments_leaves_no_half_mesh(square, alone):
    random = np.random.default_rng(5)
    begin = time.monotonic()
    assert done(started(square, 2, *WORDS, pause=0.05))[0] == 0
    usual = time.monotonic() - begin
    reference = (square / "out.su2b").read_bytes()
    (square / "out.su2b").write_bytes(b"older")
    for turn in range(20):
        count = int(random.integers(2, 5))
        process = started(square, count, *WORDS, pause=0.05)
        time.sleep(random.uniform(0.2, 1.0) * usual)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        if turn % 3 == 0:
            process.terminate()  # mpirun itself
        elif turn % 3 == 1:
            process.send_signal(2)
        elif children:
            os.kill(int(random.choice(children)), 9)
        done(process)
        assert (square / "out.su2b").read_bytes() in (b"older", reference)
        for file in square.glob(f"{PREFIX}*"):
            assert file.read_bytes()[:4] not in MAGIC
    assert done(started(square, 2, *WORDS))[0] == 0
    assert results(square) == alone
