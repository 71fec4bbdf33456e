"""The job that runs a table of designs, in processes of their own."""

from __future__ import annotations

import time
from dataclasses import replace

from slideviz.case.model import Case
from slideviz.case.words import counted
from slideviz.design.sweeps.sweep import sweep
from slideviz.mesh.model import Mesh
from slideviz.session.design_table import DesignTable
from slideviz.session.jobs import JobProgress, Report, Stopped, raise_if_cancelled


def run_designs(
    case: Case, mesh: Mesh, table: DesignTable, report: Report, stopped: Stopped
) -> None:
    """Run designs without a result; report each `DesignRow`, and the progress as `JobProgress`.

    Raises
    ------
    SlidevizError
        The table has mistakes, or no process can be started.
    """
    total = len(table.rows)
    left = [at for at in range(1, total + 1) if at not in table.results]
    wanted = [design for at, design in enumerate(table.designs(), start=1) if at in set(left)]
    report(JobProgress(f"Starting with {counted(len(left), 'design')}"))
    begin = time.monotonic()
    rows = sweep(case, wanted, mesh=mesh, going_on=lambda: raise_if_cancelled(stopped))
    for done, row in enumerate(rows, start=1):
        report(replace(row, design=left[row.design - 1]))
        rest = (time.monotonic() - begin) / done * (len(left) - done)
        words = f"{total - len(left) + done} of {total}, {rest:.0f} s left"
        report(JobProgress(words, done / len(left)))
