"""``python -m tools.laws``: deforms random meshes and reports which laws do not hold."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

from slideviz.errors import SlidevizError
from slideviz.formats.files import write
from slideviz.solver.deform import deform
from tools.laws import machines
from tools.laws.cases import random_run
from tools.laws.check import Outcome, check, simplified

EVERY_LOOP = (58, 6, 34, 25, 38, 76, 99, 1, 95, 35, 59, 60)
"""Seeds that together use all methods, frames and types of cells."""


MACHINES = 4
"""One seed in so many has a machine, too."""


def main(argv: Sequence[str]) -> int:
    """Run the seeds; 1 when a law is broken."""
    parser = argparse.ArgumentParser(prog="make laws", description=__doc__)
    parser.add_argument("--runs", type=int, default=5000, metavar="N")
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--only", metavar="SEEDS", help="these seeds, with commas")
    parser.add_argument(
        "--save", type=Path, metavar="DIR", help="write the meshes and cases there, no more"
    )
    parser.add_argument(
        "--simplify", action="store_true", help="with --save: cases as plain as break a law too"
    )
    arguments = parser.parse_args(argv)
    seeds = range(arguments.seed, arguments.seed + arguments.runs)
    wanted = [int(word) for word in arguments.only.split(",")] if arguments.only else list(seeds)
    if arguments.save:
        for seed in wanted:
            _say(str(save(seed, arguments.save, arguments.simplify)))
        return 0
    begin, ended, laws = time.perf_counter(), Counter[str](), Counter[str]()
    slowest = (0.0, 0)
    for outcome in outcomes(wanted, arguments.jobs):
        ended[outcome.ended] += 1
        slowest = max(slowest, (outcome.seconds, outcome.seed))
        for law, text in outcome.broken:
            laws[law] += 1
            _say(f"{law}: {text}\n    python -m tools.laws --only {outcome.seed}")
    _say(f"\n{len(wanted)} runs in {time.perf_counter() - begin:.0f} s")
    _say(f"the longest took {slowest[0]:.1f} s (seed {slowest[1]})")
    for kind, count in ended.most_common():
        _say(f"{count:6d} {kind}")
    _say("violations: " + (", ".join(f"{n} {law}" for law, n in laws.most_common()) or "none"))
    return 1 if laws else 0


def outcomes(seeds: Sequence[int], jobs: int = 1) -> Iterator[Outcome]:
    """Yield what became of each seed, in order."""
    if jobs == 1:
        yield from map(of_seed, seeds)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(of_seed, seeds, chunksize=10)


def of_seed(seed: int) -> Outcome:
    """Return what became of a seed."""
    _compile()
    outcome = check(random_run(seed))
    if seed % MACHINES:
        return outcome
    return replace(outcome, broken=(*outcome.broken, *machines.broken(seed)))


@cache
def _compile() -> None:
    """Let Numba compile all loops, once in a process.

    That could take longer than a run may, and an alarm that rings while it compiles can crash it.
    """
    for seed in EVERY_LOOP:
        run = random_run(seed)
        with suppress(SlidevizError):
            list(deform(run.case, run.mesh))


def save(seed: int, folder: Path, simplify: bool = False) -> Path:
    """Write mesh and case of a seed, or one as plain as possible; returns the case file."""
    run = simplified(random_run(seed)) if simplify else random_run(seed)
    folder.mkdir(parents=True, exist_ok=True)
    mesh, case = folder / f"{seed}.su2", folder / f"{seed}.cfg"
    write(mesh, run.mesh)
    run.case.change(mesh_file=mesh).write(case)
    return case


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
