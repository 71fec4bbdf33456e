"""Processes of a sweep: they hold the mesh, and one that is killed takes one design with it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from functools import partial
from multiprocessing import Pipe

import pytest

import slideviz as sv
from slideviz.design.sweeps import sweep as module
from slideviz.design.sweeps import sweep as sweeping
from slideviz.design.sweeps.sweep import Processes, pack_mesh
from slideviz.errors import DeformError
from slideviz.samples.table import sample
from tests.processes import is_running, wait_until


@pytest.fixture(scope="module")
def passage():
    return sample("passage", 12)


@pytest.mark.slow
def test_killed_workers_lose_one_design_each_and_none_is_left(passage, monkeypatch):
    made = []

    class Watched(Processes):
        def __init__(self, *args):
            super().__init__(*args)
            made.append(self)

    monkeypatch.setattr(sweeping, "Processes", Watched)
    angles = [-0.05 * k for k in range(30)]
    killed = set()
    rows = []
    for row in sv.sweep(passage.case, {"motion1.angle": angles}, mesh=passage.mesh, workers=2):
        rows.append(row)
        if len(rows) in (4, 12):
            pid = made[0].pids[0]
            os.kill(pid, signal.SIGKILL)
            killed.add(pid)
    assert sorted(row.design for row in rows) == list(range(1, 31))
    assert not any(row.problem for row in rows)
    # One may have been killed between two designs, or before it began.
    assert made[0].lost <= sum(row.lost for row in rows) <= len(killed) == 2
    assert not any(map(is_running, made[0].pids))
    by_design = sorted(rows, key=lambda row: row.design)
    rotation, shift = passage.case.motions
    case = passage.case.change(motions=(replace(rotation, angle_deg=angles[-1]), shift))
    *_, last = sv.deform(case, passage.mesh)
    assert by_design[-1].min == sv.quality(last.mesh, reference=passage.mesh).min


def test_the_call_that_a_killed_worker_had_not_begun_is_done_by_another(passage):
    with Processes(1, pack_mesh(passage.mesh)) as workers:
        workers.submit(divmod, 1, 1).result()
        long = workers.submit(time.sleep, 60)
        others = [workers.submit(divmod, 7, k) for k in (1, 2, 3)]
        wait_until(long.running)
        assert not any(call.running() for call in others)
        os.kill(workers.pids[0], signal.SIGKILL)
        assert [call.result(timeout=60) for call in others] == [(7, 0), (3, 1), (2, 1)]
        with pytest.raises(BrokenProcessPool):
            long.result(timeout=60)
        assert workers.lost == 1
        pid = workers.pids[0]
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: not is_running(pid))
        assert workers.submit(divmod, 7, 2).result(timeout=60) == (3, 1)
        assert workers.lost == 1, "no call is lost with a process that has none"


def test_workers_end_with_their_parent_however_it_ends(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import sys, time\n"
        "from slideviz.design.sweeps.sweep import Processes\n"
        "from slideviz.design.sweeps.sweep import Packed\n"
        "import pickle\n"
        "if __name__ == '__main__':\n"
        "    workers = Processes(1, Packed('none', pickle.dumps(None)))\n"
        "    workers.submit(divmod, 1, 1).result()\n"
        "    print(workers.pids[0], flush=True)\n"
        "    time.sleep(60)\n"
    )
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        assert is_running(pid)
        parent.kill()
    wait_until(lambda: not is_running(pid))


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (
            partial(signal.raise_signal, 9),
            "killed before they begin, perhaps because memory is short",
        ),
        (partial(os._exit, 1), 'must be under `if __name__ == "__main__":`'),
    ],
)
def test_why_no_process_starts_is_told(passage, monkeypatch, end, said):
    monkeypatch.setattr(module, "_begin", end)
    if "__name__" in said:
        monkeypatch.setattr(sys.modules["__main__"], "__file__", "script.py", raising=False)
    with pytest.raises(DeformError, match=re.escape(said)) as found:
        list(sv.sweep(passage.case, {"STEPS": [1, 2]}, mesh=passage.mesh, workers=1))
    assert ("__name__" in str(found.value)) is ("__name__" in said)
    monkeypatch.setattr(sys.modules["__main__"], "__package__", "slideviz")  # the command
    with pytest.raises(DeformError) as found:
        list(sv.sweep(passage.case, {"STEPS": [1, 2]}, mesh=passage.mesh, workers=1))
    assert "__name__" not in str(found.value)


@pytest.mark.slow
def test_a_script_without_a_guard_is_told(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import slideviz as sv\n"
        "from slideviz.samples.table import sample\n"
        "made = sample('passage', 12)\n"
        "list(sv.sweep(made.case, {'STEPS': [1, 2]}, mesh=made.mesh, workers=1))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert 'must be under `if __name__ == "__main__":`' in done.stderr


def test_a_sweep_that_is_given_up_ends_at_once(passage):
    """The others would take longer than any test may."""
    steps = [1, *[9999] * 50]
    rows = sv.sweep(passage.case, {"STEPS": steps}, mesh=passage.mesh, workers=1)
    assert next(rows).design == 1
    rows.close()


def test_what_a_process_cannot_do_is_an_error_of_the_call(passage):
    with Processes(1, pack_mesh(passage.mesh)) as workers:
        with pytest.raises(ZeroDivisionError):
            workers.submit(divmod, 1, 0).result()
        with pytest.raises(AttributeError, match="lambda"):
            workers.submit(lambda: 1).result()
        with pytest.raises(RuntimeError, match="cannot be sent back"):
            workers.submit(threading.Lock).result()
        assert workers.submit(divmod, 7, 2).result() == (3, 1)
        assert workers.lost == 0


@pytest.mark.slow
def test_a_killed_worker_of_a_dask_cluster(passage):
    distributed = pytest.importorskip("distributed")
    angles = [-0.05 * k for k in range(80)]
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        rows = []
        asked = {"motion1.angle": angles}
        for row in sv.sweep(passage.case, asked, client.get_executor(), mesh=passage.mesh):
            rows.append(row)
            if len(rows) == 7:
                os.kill(next(iter(cluster.workers.values())).process.process.pid, signal.SIGKILL)
    assert sorted(row.design for row in rows) == list(range(1, 81))
    assert not any(row.problem for row in rows)
    own = {row.design: row.min for row in sv.sweep(passage.case, asked, mesh=passage.mesh)}
    assert {row.design: row.min for row in rows} == own


def test_no_worker_heeds_ctrl_c_while_it_starts():
    """Also the first one, for which multiprocessing starts its tracker, and unblocks signals."""
    script = (
        "import signal\n"
        "from multiprocessing import resource_tracker\n"
        "from slideviz.design.sweeps.sweep import _settings_of_workers\n"
        "with _settings_of_workers():\n"
        "    resource_tracker.getfd()  # as `Popen` does before it starts a process\n"
        "    print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))\n"
        "print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, []))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert done.stdout == b"True\nFalse\n"


@pytest.mark.parametrize("has_mesh", [False, True], ids=["before", "after its mesh"])
def test_a_worker_whose_parent_has_ended_says_nothing(has_mesh):
    here, there = Pipe()
    if has_mesh:
        here.send(pack_mesh(sample("square", 4).mesh))
    here.close()
    assert module._serve_calls(there, lambda: None) is None
