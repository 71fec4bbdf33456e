"""The long job that makes a sample case and opens it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from slideviz.mesh.io.private import private_folder
from slideviz.session.jobs import Doing, Opened, Report, Stopped, open_file, require_going

SIZES = {"turbine-row": 20_000, "stator": 20_000}
"""Cells of the samples that are large unless asked for: the first look should be quick."""


def open_sample(
    name: str, folder: Path, report: Report, stopped: Stopped, size: int | None = None
) -> Opened:
    """Return a sample case, written into a folder of its own and ready to be shown.

    ``size`` as of ``slideviz.samples.table.sample``; without one, not larger than ``SIZES``.

    Raises
    ------
    SlidevizError
        There is no such sample, or it cannot be written.
    """
    from slideviz.samples.table import write_sample

    report(Doing(f"Making the sample {name}"))
    with suppress(OSError):  # writing says why
        private_folder(folder)
    own = folder / (name if size is None else f"{name}-{size}")
    written = write_sample(name, own, size or SIZES.get(name), overwrite=True)
    require_going(stopped)
    case = next(path for path in written if path.suffix == ".cfg")
    return open_file(case, None, report, stopped)
