"""Ctrl+C and SIGTERM end a command at any moment: a line, a code, and nothing is left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from slideviz.samples.table import write_sample
from slideviz.system.atomic import atomic_write, require_writable
from slideviz.system.cleanup import PREFIX, draft
from tests.processes import is_running, wait_until

SAID = {
    signal.SIGINT: "slideviz: cancelled; it leaves nothing half-written\n",
    signal.SIGTERM: "slideviz: ended by SIGTERM; it leaves nothing half-written\n",
}


@pytest.fixture
def square(tmp_path: Path) -> Path:
    write_sample("square", tmp_path)
    return tmp_path


@pytest.fixture
def start(square) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Return what starts a command in the folder of the case; all are ended with the test."""
    started: list[subprocess.Popen[str]] = []

    def begun(*words: str) -> subprocess.Popen[str]:
        child = subprocess.Popen(
            [sys.executable, "-m", "slideviz", *words],
            cwd=square,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        started.append(child)
        return child

    yield begun
    for child in started:
        child.kill()
        child.communicate()


def drafts(folder: Path) -> list[Path]:
    return list(folder.glob(f"{PREFIX}*"))


def heeds_signals(child: subprocess.Popen[str]) -> bool:
    """Return whether a program has its own answer to SIGTERM already."""
    status = Path(f"/proc/{child.pid}/status").read_text()
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def children_of(pid: int) -> list[int]:
    return [
        int(number)
        for task in Path(f"/proc/{pid}/task").iterdir()
        for number in (task / "children").read_text().split()
    ]


COMMANDS = {
    "info": ["info", "mesh.su2"],
    "section": ["section", "mesh.su2", "--plane", "y=0.5", "-o", "a.png"],
    "film": ["film", "square.cfg", "-o", "a.mp4", "--steps", "20", "--size", "320x200"],
    "run": ["run", "square.cfg", "--steps", "50", "--picture", "a.png"],
}
MOMENTS = [
    pytest.param("info", signal.SIGINT, 0.0, marks=pytest.mark.slow),
    ("section", signal.SIGINT, 0.1),
    pytest.param("section", signal.SIGINT, 0.5, marks=pytest.mark.slow),
    pytest.param("run", signal.SIGINT, 0.9, marks=pytest.mark.slow),
    pytest.param("film", signal.SIGTERM, 0.3, marks=pytest.mark.slow),
]
MORE = [
    (name, number, 0.15 * k)
    for name in COMMANDS
    for k in range(20)
    for number in (signal.SIGINT, signal.SIGTERM)
]


def end(start, folder: Path, name: str, number: signal.Signals, wait: float) -> None:
    child = start(*COMMANDS[name])
    wait_until(lambda: heeds_signals(child))
    time.sleep(wait)
    child.send_signal(number)
    _, err = child.communicate(timeout=60)
    if child.returncode:  # else it was done before
        assert (child.returncode, err) == (128 + number, SAID[number])
    assert drafts(folder) == []


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc here")
@pytest.mark.parametrize(("name", "number", "wait"), MOMENTS)
def test_a_signal_ends_a_command_while_it_starts(square, start, name, number, wait):
    end(start, square, name, number, wait)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "number", "wait"), MORE)
def test_a_signal_ends_a_command_at_any_moment(square, start, name, number, wait):
    end(start, square, name, number, wait)


@pytest.mark.slow
def test_nothing_is_left_of_a_film_that_is_ended(square, start):
    child = start(*COMMANDS["film"][:-2], "--between", "50")
    wait_until(lambda: drafts(square) and children_of(child.pid))
    programs = children_of(child.pid)
    child.send_signal(signal.SIGTERM)
    _, err = child.communicate(timeout=60)
    assert child.returncode == 143
    assert err.endswith(SAID[signal.SIGTERM])
    assert drafts(square) == []
    wait_until(lambda: not any(map(is_running, programs)))


def test_what_a_killed_run_left_is_removed_by_the_next(square):
    code = (
        "import time; from pathlib import Path; from slideviz.system.cleanup import draft\n"
        "with draft(Path()) as file: file.touch(); time.sleep(300)"
    )
    child = subprocess.Popen([sys.executable, "-c", code], cwd=square)
    wait_until(lambda: drafts(square))
    child.kill()
    child.wait()
    assert drafts(square)
    with atomic_write(square / "next") as file:
        file.write(b"x")
    assert drafts(square) == []


def test_only_drafts_of_dead_processes_of_this_machine_are_removed(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    with draft(tmp_path) as mine:
        mine.touch()
        machine = mine.name.removeprefix(PREFIX).partition(f"-{os.getpid()}-")[0]
        others = [
            f"{PREFIX}0123456789abcdef.tmp",  # as older versions named them
            f"{PREFIX}another-{machine}-{dead.pid}-0123456789abcdef.tmp",
            f"{PREFIX}{machine}-{os.getppid()}-0123456789abcdef.tmp",
            f"{PREFIX}{machine}-{dead.pid}-0123456789abcdef.txt",
            f"{PREFIX}{machine}-x-0123456789abcdef.tmp",
        ]
        for name in others:
            (tmp_path / name).touch()
        left = tmp_path / f"{PREFIX}{machine}-{dead.pid}-0123456789abcdef.tmp"
        left.touch()
        folder = tmp_path / f"{PREFIX}{machine}-{dead.pid}-1123456789abcdef.tmp"
        folder.mkdir()
        (folder / "0").touch()
        require_writable(tmp_path / "a")
        assert {path.name for path in drafts(tmp_path)} == {*others, mine.name}


@pytest.mark.parametrize("number", SAID)
def test_a_signal_while_python_ends_changes_no_code(number):
    """A command that is done has its own code, also while its modules are taken down."""
    code = (
        "import os, sys; from slideviz import __main__ as m; m._heed_signals()\n"
        "class Last:\n"
        "    def __del__(self, kill=os.kill, pid=os.getpid(), write=os.write):\n"
        f"        kill(pid, {int(number)}); write(1, b'alive')\n"
        "last = Last()\n"
        "sys.exit(3)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (3, "alive", "")


def test_an_ignored_signal_stays_ignored(square):
    """As of a command that a script put into the background, or that nohup started."""
    code = (
        "import os, signal, sys; from slideviz import __main__ as m; m._heed_signals()\n"
        "os.kill(os.getpid(), signal.SIGINT); os.kill(os.getpid(), signal.SIGHUP)\n"
        "print('alive')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        preexec_fn=lambda: [
            signal.signal(number, signal.SIG_IGN) for number in (signal.SIGINT, signal.SIGHUP)
        ],
    )
    assert (done.returncode, done.stdout) == (0, "alive\n")
