"""``python -m tools.fuzz``: damage inputs of every kind, and keep those that find a fault.

The corpus grows by each input that ends in a new way. It lies outside of the repository
(``--corpus``), and findings, as small as they could be made, in its folder ``findings``.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import select
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF
from tempfile import TemporaryDirectory

import numpy as np

from tools.fuzz.judge import ON_THE_CLOCK, SECONDS, Verdict
from tools.fuzz.kinds import KINDS, PLAIN, write_base
from tools.fuzz.minimise import minimised

CORPUS = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "slideviz-fuzz"
ONE_THREAD = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
_PER_PROCESS = 20_000
"""Inputs after which a fresh process takes over."""
BATCH = 32
"""Inputs that are drawn at a time: the process that judges them then never waits."""
SLOW = ("hang", "crash", "memory")
"""Beginnings of problems that take long to see again."""
_MOST_OF_A_KIND = 400
"""Inputs of one kind in the corpus."""


class Judge:
    """A process that judges inputs, started again where it ended."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process: subprocess.Popen[bytes] | None = None
        self.judged = 0  # inputs of this process
        self.limit = 0.0  # seconds until the next answer
        self.answers = b""  # read, and not taken yet

    def verdict(self, kind: str, content: bytes) -> Verdict:
        """Return the verdict on one input, as `verdicts`."""
        return next(iter(self.verdicts([(kind, content)])))

    def verdicts(self, inputs: Sequence[tuple[str, bytes]]) -> list[Verdict]:
        """Return the verdicts on inputs; those of a process that crashes or hangs, too.

        Where an isolated reader does so, the verdict is that on the program with it.
        """
        found: list[Verdict] = []
        while len(found) < len(inputs):
            found += self._judged(inputs[len(found) :], alone=False)
        for place, (verdict, one) in enumerate(zip(found, inputs, strict=True)):
            if verdict.problem.startswith(SLOW) and KINDS[one[0]].isolated:
                [alone] = self._judged([one], alone=True)
                # Limits are those of processor time; on a busy machine the clock goes on.
                in_time = alone.problem.startswith("hang") and "it takes longer" in alone.signature
                found[place] = replace(alone, problem="") if in_time else alone
        return found

    def _judged(self, inputs: Sequence[tuple[str, bytes]], alone: bool) -> list[Verdict]:
        """Return verdicts on inputs, up to the first one that ends the process."""
        if self.process is None or self.judged >= _PER_PROCESS:
            self._start()
        assert self.process is not None
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        words = []
        for place, (kind, content) in enumerate(inputs):
            (self.folder / f"input{place}").write_bytes(content)
            words.append([kind, f"input{place}", alone])
        self.process.stdin.write(json.dumps(words).encode() + b"\n")
        self.process.stdin.flush()
        found: list[Verdict] = []
        while len(found) < len(inputs):
            begin = time.monotonic()
            answer = self._line(self.limit)
            seconds = time.monotonic() - begin
            self.limit = ON_THE_CLOCK * SECONDS
            self.judged += 1
            if answer:
                found.append(Verdict(**json.loads(answer)))
                continue
            if self.process.poll() is None and seconds >= SECONDS:
                found.append(Verdict(f"hang: took {seconds:.0f} s", "hang", False, seconds))
            else:
                code = self.process.wait()
                found.append(Verdict(f"crash: exit code {code}", f"crash {code}", False, seconds))
            self.end()
            break
        return found

    def _start(self) -> None:
        self.end()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tools.fuzz.judge", str(self.folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if "SLIDEVIZ_DEBUG" not in os.environ else None,
            env=os.environ | dict.fromkeys(ONE_THREAD, "1"),
        )
        self.judged = 0
        self.answers = b""
        self.limit = 2 * ON_THE_CLOCK * SECONDS  # it loads and may compile

    def _line(self, seconds: float) -> bytes:
        """Return the next line of the process; b"" where it ended, or did not answer in time."""
        assert self.process is not None
        assert self.process.stdout is not None
        while b"\n" not in self.answers:
            if not select.select([self.process.stdout], [], [], seconds)[0]:
                return b""
            more = os.read(self.process.stdout.fileno(), 1 << 16)
            if not more:
                return b""
            self.answers += more
        line, _, self.answers = self.answers.partition(b"\n")
        return line

    def end(self) -> None:
        """Kill the process."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


class Corpus:
    """Inputs by kind, in memory and in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.inputs: dict[str, list[bytes]] = defaultdict(list)
        self.seen: set[str] = set()
        for kind, row in KINDS.items():
            place = folder / kind
            for path in sorted(place.glob(f"*{row.ending}")):
                self.inputs[kind].append(path.read_bytes())
        self.signatures = folder / "signatures.txt"
        if self.signatures.exists():
            self.seen = set(self.signatures.read_text("utf-8").splitlines())

    def add(self, kind: str, content: bytes, verdict: Verdict) -> None:
        """Keep an input that ends as none did before."""
        signature = f"{kind}: {verdict.signature}"
        if signature in self.seen or len(self.inputs[kind]) >= _MOST_OF_A_KIND:
            return
        self.seen.add(signature)
        with self.signatures.open("a", encoding="utf-8") as file:
            file.write(signature.replace("\n", " ") + "\n")
        self.inputs[kind].append(content)
        self.write(kind, content)

    def write(self, kind: str, content: bytes) -> Path:
        """Write an input into the folder of its kind, and return its path."""
        name = blake2b(content, digest_size=8).hexdigest() + KINDS[kind].ending
        path = self.folder / kind / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        return path


def main(argv: Sequence[str]) -> int:
    """Search for faults; 1 where one was found."""
    parser = argparse.ArgumentParser(prog="make fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--inputs", type=int, default=sys.maxsize, help="most inputs")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--only", metavar="KINDS", help=f"with commas: {', '.join(KINDS)}")
    parser.add_argument("--corpus", type=Path, default=CORPUS, metavar="DIR")
    arguments = parser.parse_args(argv)
    kinds = arguments.only.split(",") if arguments.only else list(KINDS)
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with TemporaryDirectory(prefix="slideviz-fuzz-", dir=memory) as place:
        return search(arguments, kinds, Path(place))


def search(arguments: argparse.Namespace, kinds: Sequence[str], place: Path) -> int:
    """Search until the time is over; 1 where a fault was found."""
    begin = time.monotonic()
    corpus, judge = Corpus(arguments.corpus), Judge(place)
    arguments.corpus.mkdir(parents=True, exist_ok=True)
    for name in ("base", "made"):
        write_base(place / name)
    seeds = {kind: list(KINDS[kind].make(place / "made" / PLAIN)) for kind in kinds}
    counts, found = Counter[str](), set[str]()
    for kind, contents in seeds.items():
        for content in contents:
            verdict = judge.verdict(kind, content)
            corpus.add(kind, content, verdict)
            if verdict.problem or not verdict.accepted:
                _say(f"{kind}: an input that is right: {verdict.problem or verdict.signature}")
    shares = np.array([KINDS[kind].share for kind in kinds])
    rng = np.random.default_rng(arguments.seed)
    _say(f"seed {arguments.seed}, corpus {arguments.corpus}")
    while time.monotonic() - begin < 60 * arguments.minutes and counts.total() < arguments.inputs:
        batch: list[tuple[str, bytes]] = []
        while len(batch) < BATCH:
            kind = kinds[int(rng.choice(len(kinds), p=shares / shares.sum()))]
            content = KINDS[kind].input(rng, [*seeds[kind], *corpus.inputs[kind]])
            if KINDS[kind].ending != ".cfg" or not _takes_long(content):
                batch.append((kind, content))
        for (kind, content), verdict in zip(batch, judge.verdicts(batch), strict=True):
            counts[kind] += 1
            if verdict.problem:
                _keep(corpus, judge, kind, content, verdict, found)
            corpus.add(kind, content, verdict)
    judge.end()
    used = sum(sum(resource.getrusage(who)[:2]) for who in (RUSAGE_SELF, RUSAGE_CHILDREN))
    minutes = (time.monotonic() - begin) / 60
    _say(f"{counts.total():,} inputs in {minutes:.1f} minutes, {used:.0f} s of processor time:")
    _say(", ".join(f"{count} {kind}" for kind, count in counts.most_common()))
    _say(f"{len(found)} findings" + (f" in {arguments.corpus / 'findings'}" if found else ""))
    return 1 if found else 0


def _keep(
    corpus: Corpus,
    judge: Judge,
    kind: str,
    content: bytes,
    verdict: Verdict,
    found: set[str],
) -> None:
    """Make a finding small, and write it with its words, unless one of its kind is known."""
    key = finding_key(verdict.problem)
    if key in found:
        return
    found.add(key)
    _say(f"{kind}: {verdict.problem[:500]}")
    slow = key.startswith(SLOW)

    def same(other: bytes) -> bool:
        return finding_key(judge.verdict(kind, other).problem) == key

    small = minimised(content, same, tries=4 if slow else 300)
    folder = corpus.folder / "findings"
    folder.mkdir(exist_ok=True)
    name = f"{kind.replace(' ', '-')}-{blake2b(key.encode(), digest_size=4).hexdigest()}"
    (folder / f"{name}{KINDS[kind].ending}").write_bytes(small)
    (folder / f"{name}.txt").write_text(f"{kind}\n{verdict.problem}\n", encoding="utf-8")


def finding_key(problem: str) -> str:
    """Return the same text for findings of one kind."""
    first = problem.splitlines()[0] if problem else ""
    return "".join("#" if sign.isdigit() else sign for sign in first)[:200]


def _takes_long(content: bytes) -> bool:
    """Return whether a case asks for more steps than a test can wait for."""
    text = content.upper().replace(b" ", b"")
    place = text.rfind(b"STEPS=")
    return place >= 0 and len(text[place + 6 :].split(b"\n")[0].strip()) > 1


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
