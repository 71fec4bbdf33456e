"""Convergence of greedy selections on the dense square (thesis Figures 5.19 to 5.23)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from slideviz.case.cfg import set_key
from slideviz.plots.draw import GreedyRun, convergence
from slideviz.rbf.problem import Cycle
from slideviz.samples.table import sample
from slideviz.solver.deform import deform
from slideviz.study.plots import WIDTH, save_figure
from tools.study.cases import GREEDY, Greedy

TOLERANCE = 1e-6
SHOWN = (1e-3, 1e-4, 1e-5)
"""Tolerances at which the number of control nodes is compared."""


def dense(folder: Path, size: int) -> list[Path]:
    """Write a figure for each of the thesis's and ``nodes.csv``; return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    made = sample("square", size, "motion")
    paths = []
    for name in dict.fromkeys(line.figure for line in GREEDY):
        runs = []
        for series, line in enumerate(line for line in GREEDY if line.figure == name):
            cycles = _history(made.case, made.mesh, line, TOLERANCE)
            runs.append(
                GreedyRun(
                    line.label,
                    np.array([cycle.control_nodes for cycle in cycles]),
                    np.array([cycle.error for cycle in cycles]),
                    np.array([cycle.level for cycle in cycles]),
                    TOLERANCE,
                    series,
                )
            )
        figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
        convergence(figure.add_subplot(), runs)
        paths += save_figure(figure, folder, f"figure_{name}")
    return [*paths, _nodes(folder / "nodes.csv", made)]


def _history(case, mesh, line: Greedy, tolerance: float) -> tuple[Cycle, ...]:
    given = case.change(sliding=line.method, periodic="none", steps=1)
    for text in ("DATA_REDUCTION=YES", f"DATA_RED_TOLERANCE={tolerance}", *line.settings):
        given = set_key(given, *text.split("="))
    *_, last = deform(given, mesh)
    return last.history


def _nodes(path: Path, made) -> Path:
    with path.open("w", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["method", "selection", "tolerance", "control_nodes"])
        for method in ("none", "ps", "ds"):
            for pick in ("one", "double", "block"):
                for tolerance in SHOWN:
                    line = Greedy("", "", method, ("MULTILEVEL=NO", f"SELECTION={pick}"))
                    history = _history(made.case, made.mesh, line, tolerance)
                    writer.writerow([method, pick, tolerance, history[-1].control_nodes])
    return path
