"""Prints what the times mean below pytest-benchmark's table."""

import os
import platform
from pathlib import Path

from tests.benchmarks import bench_peers
from tests.benchmarks.rbf_slide import GROUP
from tests.benchmarks.size_plot import draw_sizes

LONG = 0.3
"""RBF-SliDe's seconds from which its processor time means something."""


def pytest_addoption(parser):
    stores = "store the ratios of this run to a fixed kernel (bench_ratios.py)"
    parser.addoption("--store-ratios", action="store_true", help=stores)


def pytest_terminal_summary(terminalreporter, config):
    session = getattr(config, "_benchmarksession", None)
    found = [bench for bench in session.benchmarks if bench.extra_info] if session else []
    rows = [bench for bench in found if bench.group not in (GROUP, bench_peers.GROUP)]
    if rows:
        terminalreporter.section("what this is in pairs, cells and bytes")
        load = os.getloadavg()[0]
        terminalreporter.write_line(f"{_processor()}, {os.cpu_count()} cores, load {load:.1f}")
    for bench in rows:
        told = ", ".join(f"{name} {value:.4g}" for name, value in bench.extra_info.items())
        terminalreporter.write_line(f"{bench.name}: {bench.stats.min:.3f} s; {told}")
    picture = draw_sizes(found)
    if picture:
        terminalreporter.write_line(f"time and memory against cells: {picture}")
    peers = [bench for bench in found if bench.group == bench_peers.GROUP]
    if peers:
        terminalreporter.section("beside what a user would take instead")
        for line in _peers(peers, terminalreporter.stats.get("skipped", [])):
            terminalreporter.write_line(line)
    beside = [bench for bench in found if bench.group == GROUP]
    if beside:
        terminalreporter.section("beside RBF-SliDe at the same tolerance")
        for line in _beside(beside):
            terminalreporter.write_line(line)


def _peers(benches, skipped):
    """Yield a line for each peer, and one for each that was left out."""
    yield f"{'':52} {'seconds':>8} {'GB':>6} {'min':>7} {'mean':>7} {'inverted':>8}"
    for bench in sorted(benches, key=lambda bench: bench.extra_info["cells"]):
        told = bench.extra_info
        yield (
            f"{bench.name.removeprefix('test_'):52} {bench.stats.min:8.2f} "
            f"{told['memory_gb']:6.2f} {told['min_quality']:7.4f} {told['mean_quality']:7.4f} "
            f"{told['inverted']:8d}"
        )
        if "rbf_slide_seconds" in told:
            yield (
                f"{'rbf_slide[thesis], its own table, deformation alone':52} "
                f"{told['rbf_slide_seconds']:8.2f} {'':6} {told['rbf_slide_quality']:7.4f}"
            )
    for report in skipped:
        if "bench_peers" in report.nodeid:
            yield f"{report.nodeid.partition('::test_')[2]:52} left out: {report.longrepr[2]}"


def _beside(benches):
    """Yield a line for each row of RBF-SliDe's table, and the counts."""
    yield "seconds (processor), minimum quality and control nodes: ours / RBF-SliDe's"
    rows = [(bench.stats.min, bench.extra_info) for bench in benches]
    for bench, (seconds, told) in zip(benches, rows, strict=True):
        name = bench.name.partition("[")[2].rstrip("]")
        line = (
            f"{name:38} {told['tolerance']:7g} {told['pick']:12} "
            f"{seconds:6.2f} ({told['processor_seconds']:.2f}) / "
            f"{told['rbf_slide_seconds']:5.2f} s   "
            f"{told['quality']:.4f} / {told['rbf_slide_quality']:.4f}   "
            f"{told['control_nodes']:4d} / {told['rbf_slide_control_nodes']:4.0f}"
        )
        lower = told["quality"] < told["rbf_slide_quality"]
        yield line + (f"   lower; exact method {told['exact_quality']:.4f}" if lower else "")
    long = [(s, told) for s, told in rows if told["rbf_slide_seconds"] > LONG]
    fast = sum(seconds < told["rbf_slide_seconds"] for seconds, told in long)
    less = sum(told["processor_seconds"] < told["rbf_slide_seconds"] for _, told in long)
    yield f"faster in {fast} of {len(long)} rows above {LONG} s; less processor time in {less}"
    lost = [told for _, told in rows if told["quality"] < told["rbf_slide_quality"]]
    yield f"quality at least as good in {len(rows) - len(lost)} of {len(rows)} rows; none is nan"
    for margin in (0.01, 0.05):
        near = sum(t["quality"] < (1 - margin) * t["rbf_slide_quality"] for t in lost)
        yield f"no more than {margin:.0%} lower in {len(rows) - near} of {len(rows)} rows"
    below = sum(told["exact_quality"] < told["rbf_slide_quality"] for told in lost)
    yield f"lost rows where the exact method is lower too: {below} of {len(lost)}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines()
        return next(line.split(":")[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"
