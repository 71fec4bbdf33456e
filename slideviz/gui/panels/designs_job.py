"""The job that runs a table of designs, with its results handed over in batches."""

from __future__ import annotations

from collections.abc import Callable

from qtpy.QtCore import QObject, Signal

from slideviz.case.model import Case
from slideviz.design.sweeps.table import DesignRow
from slideviz.gui.responsiveness.settings import ROWS_MS
from slideviz.gui.responsiveness.timers import later
from slideviz.gui.responsiveness.worker import JobRunner
from slideviz.mesh.model import Mesh
from slideviz.session.design_table import DesignTable, run_designs
from slideviz.session.jobs import JobProgress


class DesignsJob(QObject):
    """The job that runs the designs of a table in a thread.

    Parameters
    ----------
    ended : callable
        Called with a sentence, empty if all designs were run, and whether it is an error.

    Signals
    -------
    came(list of Row)
        Results since the last emission: not one by one, as each repaints the whole window.
    said(str, float)
        The progress, in words and from 0 to 1.
    """

    came = Signal(list)
    said = Signal(str, float)

    def __init__(self, ended: Callable[[str, bool], None], parent: QObject) -> None:
        super().__init__(parent)
        self._news, self._fraction = "", 0.0
        self._arrived: list[DesignRow] = []
        self._ended = ended
        self.runner = JobRunner(self)
        self._soon = later(self, self._take, ROWS_MS)
        self.runner.doing.connect(self._doing)
        self.runner.kept.connect(self._kept)
        self.runner.finished.connect(lambda _: self._end(""))
        self.runner.cancelled.connect(lambda: self._end("Stopped; the results stay."))
        self.runner.failed.connect(lambda error: self._end(str(error), wrong=True))

    def start(self, case: Case, mesh: Mesh, table: DesignTable) -> None:
        """Run the designs of a table that have no result."""
        self.runner.start(run_designs, case, mesh, table)

    def _doing(self, doing: JobProgress) -> None:
        self._news, self._fraction = doing.text, doing.fraction or 0.0
        if not self._soon.isActive():
            self._soon.start()

    def _kept(self, rows: list[DesignRow]) -> None:
        self._arrived += rows
        if not self._soon.isActive():
            self._soon.start()

    def _take(self) -> None:
        """Emit the results since the last emission, and the progress."""
        self._soon.stop()
        rows, self._arrived = self._arrived, []
        if rows:
            self.came.emit(rows)
        if self.runner.busy:
            self.said.emit(self._news, self._fraction)

    def _end(self, text: str, wrong: bool = False) -> None:
        self._take()
        self._ended(text, wrong)
