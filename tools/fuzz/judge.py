"""What commands do with one input, in a process of its own that may crash, hang or be killed.

``python -m tools.fuzz.judge FOLDER`` reads lines of JSON from its input, lists of ``[kind, name,
alone]``, and answers each entry with a line: a `Verdict` of the input ``name`` in the folder.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import math
import os
import re
import resource
import shlex
import shutil
import sys
import traceback
import warnings
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import slideviz as sv
from slideviz.cli import parser, run
from slideviz.design.sweeps import sweep
from slideviz.errors import SlidevizError, path_error
from slideviz.formats import files
from slideviz.formats.table import MESHIO, format_for
from slideviz.mesh.model import Mesh
from slideviz.session import jobs
from slideviz.system.cleanup import PREFIX
from tools.fuzz.kinds import CASE, KINDS, PLAIN, Kind, write_base
from tools.fuzz.plain_su2 import PlainMesh, WrongError, plain_mesh

SECONDS = 30.0
"""Processor time that an input may take; on the clock it is `ON_THE_CLOCK` times as much."""
ON_THE_CLOCK = 10
MEMORY = 2 << 30
"""Memory in bytes that an input may take."""
_ADDRESSES = 4 << 30
"""Address space of the process: what asks for more gets none."""
ALL_COMMANDS = 20
"""Of inputs that cannot be read, one in so many goes through the other commands of its kind."""
DONE = (0, 3, 4)
"""Exit codes of commands that wrote what was asked for."""


@dataclass(frozen=True)
class Verdict:
    """What became of an input.

    ``problem`` is the kind of a finding and what is known of it, empty where all is right.
    ``signature`` is the same for inputs that end alike; ``accepted`` says whether the first command
    took the input.
    """

    problem: str
    signature: str
    accepted: bool
    seconds: float


def judged(kind: Kind, path: Path, base: Path, alone: bool = False) -> Verdict:
    """Return what the commands of a kind do with an input. ``base``: folder of `write_base`.

    ``alone``: with the isolated readers in processes of their own, as users have it.
    """
    folder = path.parent / "here"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(base / kind.folder, folder, copy_function=shutil.copyfile)
    content = path.read_bytes()
    name = f"input{kind.ending}"
    if kind.folder != PLAIN:
        line, _, content = content.partition(b"\n")
        name = line.decode("utf-8", "replace")
        if "\0" in name or not (folder / name).is_file():
            return Verdict("", "no file has this name", False, 0.0)
    (folder / name).write_bytes(content)
    begin = _seconds()
    ended = []
    problems: list[str] = []
    with contextlib.chdir(folder), _in_process(alone):
        for command in kind.commands:
            before = _state(folder)
            code, text, problem = _ran(shlex.split(command.replace("@", name)))
            ended.append(f"{code} {_without_numbers(text)}")
            problems += [f"{command}: {each}" for each in [problem] if each]
            problems += [f"{command}: {each}" for each in _wrong_files(folder, before, code)]
            if code in DONE:
                problems += [f"{command}: {each}" for each in _wrong_result(kind, command, name)]
            elif command.startswith("read ") and zlib.crc32(content) % ALL_COMMANDS:
                break
    seconds = _seconds() - begin
    if seconds > SECONDS:
        problems.append(f"hang: took {seconds:.0f} s")
    accepted = bool(ended) and ended[0][0] in "034"
    return Verdict("\n".join(problems), " | ".join(ended), accepted, seconds)


def _seconds() -> float:
    """Return the processor time of this process and its children: a machine may be busy."""
    return sum(
        sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )


class _OneThread(ThreadPoolExecutor):
    def __init__(self, _count: int, _mesh: object) -> None:
        super().__init__(1)


@contextlib.contextmanager
def _in_process(alone: bool) -> Iterator[None]:
    """Context in which isolated readers and sweeps start no process, which takes half a second."""
    if alone:
        yield
        return
    reader, processes = files.read_in_subprocess, sweep.Processes
    files.read_in_subprocess = _read_here  # type: ignore[assignment]
    sweep.Processes = _OneThread  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        files.read_in_subprocess, sweep.Processes = reader, processes  # type: ignore[misc]


def _read_here(path: Path, _progress: Any, function: str = "") -> Mesh:
    """Return what the isolated reader returns; whatever it raises is a refusal there."""
    row = replace(MESHIO, reader=function or format_for(path).reader)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh: Mesh = row.function("reader")(path)
            return mesh
    except SlidevizError:
        raise
    except (Exception, SystemExit) as problem:
        raise path_error(path, f"cannot be read: crashed ({type(problem).__name__})") from problem


def _ran(words: list[str]) -> tuple[int, str, str]:
    """Return exit code, errors, and what is wrong with the way in which a command ended."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(record=True) as caught,
    ):
        warnings.simplefilter("always")
        try:
            code = OTHERS[words[0]](Path(words[1])) if words[0] in OTHERS else run(words)
        except BaseException as problem:
            if isinstance(problem, KeyboardInterrupt):
                raise
            return 99, type(problem).__name__, f"traceback: {_place(problem)}"
        err.flush()
    text = err.buffer.getvalue().decode("utf-8", "replace")  # type: ignore[attr-defined]
    if "Traceback" in text or "internal error" in text:
        lines = [line for line in text.splitlines() if "slideviz" in line]
        return code, text, f"traceback: {' '.join(lines[-2:])[-600:]}"
    if code not in (0, 1, 2, 3, 4):
        return code, text, f"exit code {code}"
    if code in (1, 2) and not text.strip():
        return code, text, "no message"
    if any(len(line) > 2000 for line in text.splitlines()):
        return code, text, f"message of {len(text)} characters"
    for each in caught:
        if issubclass(each.category, RuntimeWarning) and "meshio" not in each.filename:
            return code, text, f"warning: {each.filename}:{each.lineno}: {each.message}"
    return code, text, ""


def _session(path: Path) -> int:
    try:
        opened = jobs.open_file(path, None, jobs.Job())
    except SlidevizError as problem:
        print(f"slideviz: {problem}", file=sys.stderr)  # noqa: T201
        return 1
    return 0 if opened.session.mesh is not None else 1


def _resume(path: Path) -> int:
    """Return the exit code of a sweep that goes on with results."""
    path.replace("swept/results.csv")
    return run(["sweep", CASE, "designs.csv", "-o", "swept", "-q", "--workers", "1", "--resume"])


def _read(path: Path) -> int:
    """Return the exit code of a command that only reads a mesh."""
    try:
        sv.read(path)
    except SlidevizError as problem:
        print(f"slideviz: {problem}", file=sys.stderr)  # noqa: T201
        return 1
    return 0


OTHERS = {"session": _session, "resume": _resume, "read": _read}
"""What is no command of slideviz."""


def _place(problem: BaseException) -> str:
    last = traceback.extract_tb(problem.__traceback__)
    place = next((f for f in reversed(last) if "slideviz" in f.filename), last[-1])
    where = f"{place.filename.rpartition('slideviz/')[2]}:{place.lineno}"
    return f"{type(problem).__name__} at {where}: {str(problem)[:200]}"


def _state(folder: Path) -> dict[str, tuple[int, int]]:
    """Return size and time stamp of the files and folders in a folder, by path."""
    found = {}
    waiting = [str(folder)]
    while waiting:
        with os.scandir(waiting.pop()) as entries:
            for entry in entries:
                status = entry.stat()
                found[entry.path] = (status.st_size, status.st_mtime_ns)
                if entry.is_dir():
                    waiting.append(entry.path)
    return found


def _wrong_files(folder: Path, before: dict[str, tuple[int, int]], code: int) -> Iterator[str]:
    """Yield which files a command left though it should not have."""
    for place, state in _state(folder).items():
        if before.get(place) == state:
            continue
        path = Path(place)
        if PREFIX in path.name or path.suffix == ".tmp":
            yield f"draft left: {path.name}"
        # A sweep keeps its table, whatever becomes of a design.
        changed = path.suffix in (".su2", ".su2b") or path.name in ("points", "points.gz")
        # Sessions unpack their files before they are read.
        changed = changed and "-" not in path.parent.name
        if changed and code not in DONE:
            yield f"half file: {path.relative_to(folder)} though it ended with {code}"


def _wrong_result(kind: Kind, command: str, name: str) -> Iterator[str]:
    """Yield what is wrong with what a command wrote."""
    report = Path("report.json")
    if report.exists() and "--json" in command:
        try:
            json.loads(report.read_text("utf-8"), parse_constant=_refused)
        except ValueError as problem:
            yield f"report: {problem}"
    out = Path("out.su2")
    if not out.exists() or "out.su2 " not in f"{command} ":
        return
    text = out.read_text("utf-8", "replace")
    try:
        written = plain_mesh(text)
    except WrongError as problem:
        if "several zones" not in str(problem):
            yield f"silent: out.su2 is wrong: {problem}"
        return
    if not all(math.isfinite(value) for point in written.points for value in point):
        yield "silent: out.su2 has points that are not finite"
    if kind.ending == ".su2" and command.startswith("convert"):
        yield from _unlike(written, Path(name).read_bytes())


def _refused(word: str) -> None:
    raise ValueError(f"{word} is not JSON")


def _unlike(written: PlainMesh, content: bytes) -> Iterator[str]:
    """Yield how a mesh differs from that of its file, read by the plainest means."""
    try:
        mesh = plain_mesh(content.decode("utf-8", "replace"))
    except WrongError as problem:
        if "several zones" not in str(problem):
            yield f"silent: the plain reader refuses it: {problem}"
        return
    except (ValueError, IndexError) as problem:
        yield f"silent: the plain reader fails: {problem!r}"
        return
    if mesh.dim != written.dim or mesh.cells != written.cells:
        yield "silent: other cells than the plain reader has"
    elif mesh.points != written.points:
        yield "silent: other points than the plain reader has"
    elif [facets for _, facets in mesh.markers] != [facets for _, facets in written.markers]:
        yield "silent: other boundaries than the plain reader has"


def _without_numbers(text: str) -> str:
    """Return a message without what differs between inputs of one kind."""
    text = re.sub(r"'[^']*'|\"[^\"]*\"|\([^)]*\)", "Q", text[:600])
    return re.sub(r"[-+]?\d[\w.+-]*|[^\x20-\x7e]", "#", text)[:300]


def peak_memory(fresh: bool = False) -> int:
    """Return the most memory in bytes that this process had since the last fresh start."""
    if fresh:
        Path("/proc/self/clear_refs").write_text("5")
        return 0
    text = Path("/proc/self/status").read_text("ascii")
    match = re.search(r"VmHWM:\s*(\d+) kB", text)
    return int(match[1]) * 1024 if match else 0


def resident() -> int:
    """Return the memory in bytes that this process has."""
    text = Path("/proc/self/status").read_text("ascii")
    match = re.search(r"VmRSS:\s*(\d+) kB", text)
    return int(match[1]) * 1024 if match else 0


def main(folder: Path) -> None:
    """Judge inputs until there are no more."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESSES, _ADDRESSES))
    base = folder / "base"
    if not base.exists():
        write_base(base)
    # argparse looks for a translation of each word, and parsers are the same each time: together
    # they took half of the time of an input that is refused.
    argparse._ = str  # type: ignore[attr-defined]
    made = cache(parser.command_parser)
    parser.command_parser = lambda names: made(tuple(names))
    channel = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in sys.stdin:
        for kind, name, alone in json.loads(line):
            peak_memory(fresh=True)
            before = resident()
            verdict = judged(KINDS[kind], folder / name, base, alone)
            taken = peak_memory() - before
            problem = verdict.problem
            if taken > MEMORY:
                problem += f"\nmemory: {taken / 1e9:.1f} GB"
            channel.write(json.dumps(asdict(verdict) | {"problem": problem.strip()}) + "\n")
            channel.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
