"""Programs in processes of their own, with the memory that they took."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping

MEASURED = """
import os, sys
said = [(os.POSIX_SPAWN_DUP2, 2, 1)]  # standard output is for the number
pid = os.posix_spawnp(sys.argv[1], sys.argv[1:], os.environ, file_actions=said)
_, status, used = os.wait4(pid, 0)
print(used.ru_maxrss / 1e6)
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""A small process between: what a process took at most counts what its parent had at the start."""


def call(*arguments: object) -> tuple[int, float]:
    """Return the exit code of the command ``slideviz`` and the most memory it took, in GB."""
    return call_other(sys.executable, "-m", "slideviz", *arguments, accepted=(0, 3))


def call_other(
    *command: object, accepted: tuple[int, ...] = (0,), environment: Mapping[str, str] | None = None
) -> tuple[int, float]:
    """Return the exit code of a program and the most memory it took, in GB."""
    done = subprocess.run(
        [sys.executable, "-S", "-c", MEASURED, *map(str, command)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode in accepted, done.stderr[-2000:]
    return done.returncode, float(done.stdout.splitlines()[-1])
