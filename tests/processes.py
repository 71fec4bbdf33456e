"""Processes that tests start: waiting for what they do, and whether they still run."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path


def wait_until(what: Callable[[], object]) -> None:
    """Wait until something is true; the timeout of the test ends what never is."""
    while not what():
        time.sleep(0.01)


def is_running(pid: int) -> bool:
    """Return whether a process runs; one that ended and was not waited for does not.

    Its first thread may have ended while another one still does.
    """
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        return state != "Z" or len(list(Path(f"/proc/{pid}/task").iterdir())) > 1
    except OSError:
        return False
