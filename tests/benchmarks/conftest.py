"""Prints what the times mean below pytest-benchmark's table."""

import os
import platform
from pathlib import Path


def pytest_terminal_summary(terminalreporter, config):
    session = getattr(config, "_benchmarksession", None)
    rows = [bench for bench in session.benchmarks if bench.extra_info] if session else []
    if not rows:
        return
    terminalreporter.section("what this is in pairs, cells and bytes")
    load = os.getloadavg()[0]
    terminalreporter.write_line(f"{_processor()}, {os.cpu_count()} cores, load {load:.1f}")
    for bench in rows:
        told = ", ".join(f"{name} {value:.4g}" for name, value in bench.extra_info.items())
        terminalreporter.write_line(f"{bench.name}: {bench.stats.min:.3f} s; {told}")


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines()
        return next(line.split(":")[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"
