"""The command ``slideviz`` in a process of its own, with the memory that it took."""

from __future__ import annotations

import subprocess
import sys

MEASURED = """
import resource, sys
from slideviz.cli import run
code = run(sys.argv[1:])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6)
sys.exit(code)
"""


def call(*arguments: object) -> tuple[int, float]:
    """Return the exit code of the command and the most memory it took, in GB."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode in (0, 3), done.stderr
    return done.returncode, float(done.stdout.splitlines()[-1])
