"""The picture in the docs of time and memory against cells, from what ``make bench`` measured."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

PICTURE = Path(__file__).parents[2] / "docs" / "evidence" / "size.svg"
SERIES = {
    "test_run_of_the_command": ("SU2 text, in memory", "#0b6e99", "o"),
    "test_stream": ("SU2 binary, streamed", "#c4572c", "s"),
}


def draw_sizes(benches: Iterable) -> Path | None:
    """Draw time and memory against cells; return the file, None without enough of them."""
    rows = [
        (bench.name.partition("[")[0], bench.extra_info["cells"], bench.stats.min, bench.extra_info)
        for bench in benches
        if bench.name.partition("[")[0] in SERIES
    ]
    if len(rows) < 4:
        return None
    figure = Figure((9.0, 3.6), layout="constrained")
    time, memory = figure.subplots(1, 2)
    for name, (label, color, marker) in SERIES.items():
        mine = sorted((cells, seconds, told) for key, cells, seconds, told in rows if key == name)
        cells = [row[0] for row in mine]
        time.loglog(cells, [row[1] for row in mine], color=color, marker=marker, label=label)
        gigabytes = [row[2]["largest_memory_gb"] for row in mine]
        memory.loglog(cells, gigabytes, color=color, marker=marker, label=label)
    time.set(xlabel="cells", ylabel="whole command, s", ylim=(0.5, 1000))
    memory.set(xlabel="cells", ylabel="largest resident memory, GB", ylim=(0.1, 10))
    for axes in (time, memory):
        axes.grid(which="both", color="#d9d9d9", linewidth=0.5)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False)
    with mpl.rc_context({"svg.hashsalt": "slideviz"}):
        figure.savefig(PICTURE, metadata={"Date": None})
    return PICTURE
