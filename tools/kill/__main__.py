"""``python -m tools.kill``: end runs, sweeps, wheels and films at random times, in many ways.

A command is killed (SIGKILL), ended (SIGTERM, SIGINT), or finds a full disk, files that may not
grow (RLIMIT_FSIZE) or little memory (RLIMIT_AS). Then each of its files must be as it was before,
or as an undisturbed command writes it; no draft may stay, but after SIGKILL, where the next command
removes it; and an end that the command noticed has its exit code and a message.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import NoReturn

import numpy as np

import slideviz.__main__
import slideviz.cli.convert_command
import slideviz.cli.def_command
import slideviz.cli.picture_command
import slideviz.cli.repair_command
import slideviz.cli.run_command
import slideviz.cli.sweep_command
import slideviz.cli.wheel_command
from slideviz.system.cleanup import PREFIX

Rng = np.random.Generator


@dataclass(frozen=True)
class Scenario:
    """A command, and the files that it writes whole or not at all."""

    words: str
    files: tuple[str, ...] = ("out.su2",)
    growing: tuple[str, ...] = ()
    """Tables that have whole lines at any time, in the order in which designs end."""
    drawn: bool = False
    """Whether it draws, so that its bytes differ: files must be complete pictures."""


SCENARIOS = {
    "run": Scenario("run case.cfg -q -o out.su2 --json out.json", ("out.su2", "out.json")),
    "steps": Scenario("run case.cfg -q -o out.su2 --steps 3 --steps-file out.vtkhdf", ("out.su2",)),
    "streamed": Scenario(
        "run case.cfg -q -o out.su2b --set MESH_FILENAME=mesh.su2b --stream", ("out.su2b",)
    ),
    "text streamed": Scenario("run case.cfg -q -o out.su2b --stream", ("out.su2b",)),
    "convert": Scenario("convert mesh.su2 out.vtu", ("out.vtu",)),
    "convert streamed": Scenario("convert mesh.su2 out.su2b --stream", ("out.su2b",)),
    "def": Scenario("def config.cfg -q", ("out.su2",)),
    "repair": Scenario("repair folded.su2 -o out.su2 -q", ("out.su2",)),
    "wheel": Scenario("wheel repeats.cfg -q -o out.su2 --steps 1 --set RELAX=no", ("out.su2",)),
    "sweep": Scenario(
        "sweep case.cfg designs.csv -o swept -q --workers 2 --meshes",
        ("swept/design_1.su2", "swept/design_2.su2", "swept/design_3.su2"),
        ("swept/results.csv",),
    ),
    "picture": Scenario("picture case.cfg -q -o out.png", ("out.png",), drawn=True),
    "film": Scenario("film case.cfg -q -o out.gif --steps 3 --force", ("out.gif",), drawn=True),
}
"""The scenarios by name."""
NOTICED = {signal.SIGTERM: 143, signal.SIGINT: 130}
DONE = (0, 3)
_PATIENCE = 60.0


class Command:
    """A command in a process that is forked: what it imports is there, so it begins at once."""

    def __init__(
        self, folder: Path, words: str, before: Callable[[], object] = lambda: None
    ) -> None:
        self.told = TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
        self.pid = os.fork()
        if self.pid == 0:
            self._be_command(folder, words, before)

    def _be_command(self, folder: Path, words: str, before: Callable[[], object]) -> NoReturn:
        code = 1
        try:
            os.chdir(folder)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(self.told.fileno(), 2)
            sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
            sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
            sys.argv = ["slideviz", *words.split()]
            before()
            code = slideviz.__main__.main()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(code)

    def ended(self, number: int, after: float) -> tuple[int, str]:
        """Send a signal after some seconds; return exit code and messages."""
        code = self._waited(after)
        if code is None:
            os.kill(self.pid, number)
            code = self._waited(_PATIENCE)
        if code is None:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
            return -1000, "it does not end"
        self.told.seek(0)
        with self.told:
            return code, self.told.read()

    def _waited(self, seconds: float) -> int | None:
        end = time.monotonic() + seconds
        while True:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                return os.waitstatus_to_exitcode(status)
            if time.monotonic() > end:
                return None
            time.sleep(0.002)


def undisturbed(folder: Path, words: str) -> float:
    """Run a command, and return its seconds."""
    begin = time.monotonic()
    code, told = Command(folder, words).ended(signal.SIGKILL, 10 * _PATIENCE)
    if code not in DONE:
        raise SystemExit(f"{words}: {code}: {told}")
    return time.monotonic() - begin


def _limit(kind: int, most: int) -> Callable[[], object]:
    return lambda: resource.setrlimit(kind, (most, most))


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[None]:
    """Context in which a folder is a disk of ``size`` bytes; as root only."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "none", folder], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def is_whole(path: Path) -> bool:
    """Return whether a picture or film is complete."""
    content = path.read_bytes()
    if path.suffix == ".png":
        return content.startswith(b"\x89PNG") and content.endswith(b"IEND\xaeB`\x82")
    return content.startswith(b"GIF8") and content.endswith(b";")


def wrong(
    scenario: Scenario, folder: Path, old: dict[str, bytes], new: dict[str, bytes]
) -> Iterator[str]:
    """Yield which files are neither as before nor as an undisturbed command writes them."""
    for name in scenario.files:
        path = folder / name
        if not path.exists():
            if name in old:
                yield f"{name} is gone"
            continue
        content = path.read_bytes()
        if content == old.get(name) or (scenario.drawn and is_whole(path)):
            continue
        if name.endswith((".json", ".vtu")):  # they have seconds, and versions
            if len(content) < 0.9 * len(new[name]):
                yield f"{name} has {len(content)} bytes, not {len(new[name])}"
        elif content != new[name]:
            yield f"{name} is neither old nor new"
    for name in scenario.growing:
        path = folder / name
        if path.exists():
            lines = path.read_text("utf-8").splitlines(keepends=True)
            commas = {line.count(",") for line in lines if '"' not in line}
            if len(commas) > 1 or (lines and not lines[-1].endswith("\n")):
                yield f"{name} has half a line: {lines[-1]!r}"


def drafts(folder: Path) -> list[str]:
    """Return the names of temporary files in a folder and its folders."""
    return [path.name for path in folder.rglob(f"{PREFIX}*")]


class Killer:
    """Ends commands of one kind, and looks at what they left."""

    def __init__(self, name: str, place: Path, inputs: Path) -> None:
        self.name = name
        self.scenario = SCENARIOS[name]
        self.place = place / name.replace(" ", "-")
        self.inputs = inputs
        shutil.copytree(inputs, self.place)
        self.seconds = undisturbed(self.place, self.scenario.words)
        self.new = {name: (self.place / name).read_bytes() for name in self.scenario.files}

    def once(self, rng: Rng) -> tuple[str, list[str]]:
        """End one command; return the way, and what is wrong then."""
        ways = ["SIGKILL", "SIGTERM", "SIGINT", "file size", "memory"]
        if os.geteuid() == 0:
            ways.append("disk")
        way = str(rng.choice(ways))
        folder = self.place.with_name(f"{self.place.name}-here")
        folder.mkdir()
        with ExitStack() as stack:
            stack.callback(shutil.rmtree, folder, ignore_errors=True)
            if way == "disk":
                room = sum(path.stat().st_size for path in self.inputs.iterdir())
                size = room + 64_000 + int(rng.integers(sum(map(len, self.new.values())) * 2 + 1))
                stack.enter_context(small_disk(folder, size))
            shutil.copytree(self.inputs, folder, dirs_exist_ok=True)
            old = {}
            if way != "disk" and rng.random() < 0.5 and not self.scenario.growing:
                for name in self.scenario.files:
                    old[name] = b"old"
                    (folder / name).write_bytes(b"old")
            return way, list(self._wrong(rng, way, folder, old))

    def _wrong(self, rng: Rng, way: str, folder: Path, old: dict[str, bytes]) -> Iterator[str]:
        before: Callable[[], object] = lambda: None  # noqa: E731
        if way == "file size":
            most = int(rng.integers(max(map(len, self.new.values())) + 1))
            before = _limit(resource.RLIMIT_FSIZE, most)
        elif way == "memory":
            most = _addresses() + int(rng.uniform(0.0, 1.5) * 2**30)
            before = _limit(resource.RLIMIT_AS, most)
        process = Command(folder, self.scenario.words, before)
        if way.startswith("SIG"):
            number = getattr(signal, way)
            code, told = process.ended(number, float(rng.uniform(0.0, self.seconds)))
            allowed: tuple[int, ...] = (-number, NOTICED.get(number, -number), *DONE)
        else:
            code, told = process.ended(signal.SIGKILL, _PATIENCE)
            allowed = (1, *DONE)
        # Before slideviz begins, Python itself ends in its own way.
        begins = code == 1 and "KeyboardInterrupt" in told
        if code not in allowed and not begins and not (way == "memory" and _by_python(code, told)):
            yield f"exit code {code}: {told[-300:]}"
        early = begins or (way == "memory" and _by_python(code, told))
        if code == 1 and ("Traceback" in told or not told.strip()) and not early:
            yield f"message: {told[-600:]}"
        yield from wrong(self.scenario, folder, old, self.new)
        left = drafts(folder)
        if left and way not in ("SIGKILL", "memory") and code != -9:
            yield f"drafts stay: {left}"
        elif left:
            for inner in ("", "swept/"):
                if (folder / inner).is_dir():
                    undisturbed(folder, f"convert mesh.su2 {inner}next.su2")
            if drafts(folder):
                yield f"the next command leaves drafts: {drafts(folder)}"


def _addresses() -> int:
    return int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()


def _by_python(code: int, told: str) -> bool:
    """Return whether Python or a library found no memory before slideviz could say so."""
    words = (
        "MemoryError",
        "cannot allocate",
        "failed to map",
        "error while loading",
        "Fatal Python",
    )
    return code in (1, 127, -6, -11) and (not told.strip() or any(word in told for word in words))


def main(argv: Sequence[str]) -> int:
    """End commands until the time is over; 1 where something was wrong."""
    parser = argparse.ArgumentParser(prog="make kill", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--only", metavar="NAMES", help=f"with commas: {', '.join(SCENARIOS)}")
    arguments = parser.parse_args(argv)
    names = arguments.only.split(",") if arguments.only else list(SCENARIOS)
    begin = time.monotonic()
    rng = np.random.default_rng(arguments.seed)
    counts, ways, faults = Counter[str](), Counter[str](), Counter[str]()
    with TemporaryDirectory(prefix="slideviz-kill-") as place:
        inputs = Path(place, "inputs")
        inputs.mkdir()
        # In a process of its own: this one must have no threads when it forks.
        write = [sys.executable, "-m", "tools.kill.inputs", str(inputs)]
        subprocess.run(write, check=True)
        killers: dict[str, Killer] = {}
        while time.monotonic() - begin < 60 * arguments.minutes:
            name = names[int(rng.integers(len(names)))]
            if name not in killers:
                killers[name] = Killer(name, Path(place), inputs)
            way, problems = killers[name].once(rng)
            counts[name] += 1
            ways[way] += 1
            for problem in problems:
                faults[f"{name}, {way}"] += 1
                _say(f"{name}, {way}: {problem}")
    _say(f"{counts.total():,} ends (seed {arguments.seed}): {_told(counts)}")
    _say(_told(ways))
    _say(f"{faults.total()} faults {_told(faults)}")
    return 1 if faults else 0


def _told(counts: Counter[str]) -> str:
    return ", ".join(f"{count} {name}" for name, count in counts.most_common())


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
