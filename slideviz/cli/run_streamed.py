"""``slideviz run --stream``: from file to file, with only the boundary in memory."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.cli.run_outcome import CELLS, tell, write_qualities

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.terms import FileFormat


def is_to_be_streamed(
    arguments: argparse.Namespace, case: Case, output: Path, kind: FileFormat | None
) -> bool:
    """Tell whether a run is streamed: as asked for, or as the mesh is too large for the memory.

    Raises
    ------
    CaseError
        That is asked for of a run that cannot be.
    """
    from slideviz.deformation.streaming import missing_memory
    from slideviz.errors import CaseError

    needs = [name for name in ("picture", "steps_dir", "steps_file") if getattr(arguments, name)]
    binary = (kind or output.suffix.lower().removeprefix(".")) == "su2b"
    if arguments.stream or arguments.resume:
        if needs:
            option = f"--{needs[0].replace('_', '-')}"
            raise CaseError(f"{option} needs the mesh in memory; leave it out, or --stream")
        if not binary:
            raise CaseError(
                f"{output}: a streamed run writes SU2 binary meshes; end its name in .su2b"
            )
        return True
    missing = missing_memory(case) if binary and not needs else ""
    if missing and not arguments.quiet:
        print(f"slideviz: note: {missing}; it is streamed", file=sys.stderr, flush=True)
    return bool(missing)


def run_streamed(
    arguments: argparse.Namespace, case: Case, begin: float, output: Path, qualities: Path | None
) -> int:
    """Deform a mesh from file to file, with the same report as ``run``."""
    from slideviz.cli.progress import Bar
    from slideviz.cli.report import LISTED, run_report
    from slideviz.deformation.streaming import stream
    from slideviz.mesh.ranks import ALONE

    with Bar(not arguments.quiet) as bar:
        done = stream(
            case,
            output,
            tell=bar.phase,
            note=lambda text: print(f"slideviz: note: {text}", file=sys.stderr, flush=True),
            resume=arguments.resume,
            replaces=case.mesh_file if arguments.force else None,
            listed=LISTED,
            ranks=arguments.ranks or ALONE,
        )
    seconds = dict(done.seconds)
    if qualities:
        seconds["write"] -= time.perf_counter()
        write_qualities(qualities, done.quality)
        seconds["write"] += time.perf_counter()
    seconds["total"] = time.perf_counter() - begin
    report = run_report(
        case,
        done.skin,
        done.steps,
        seconds,
        quality=done.quality,
        undeformed=done.undeformed,
        folded=done.folded,
    )
    files = {"mesh": output, CELLS: qualities}
    return tell(arguments, report, files, done.quality, done.undeformed, done.folded)
