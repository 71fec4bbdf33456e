"""``slideviz film``: deforms a mesh, and writes its steps as a film."""

from __future__ import annotations

import sys
from argparse import Namespace
from contextlib import closing
from dataclasses import replace
from textwrap import shorten

from slideviz import deform, quality
from slideviz.case.keys import KEYS
from slideviz.case.model import Case
from slideviz.case.words import counted
from slideviz.cli.mesh_source import changed_beside, read_case, read_mesh, require_mesh_file
from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.report import print_remarks
from slideviz.cli.terminal import DONE, INVERTED
from slideviz.design.sweeps.table import TIME, number_of, read_designs, require_distinct_times
from slideviz.errors import Remark
from slideviz.export.encode import film_kind
from slideviz.export.film import FilmOptions, check_film, require_pair_width
from slideviz.export.film import film as draw
from slideviz.mesh.model import Mesh
from slideviz.scene.overview import require_detail
from slideviz.session.opening import session_of_runs
from slideviz.session.state import Run, StepFrame
from slideviz.terms import DIFFERENCES

SMOOTH = 4  # films of fewer steps get a hint on ``--between``


def main(arguments: Namespace) -> int:
    """Deform a mesh as a case says, and write its steps as a film; return the exit code."""
    file = arguments.output
    film_options = FilmOptions(arguments.size, arguments.fps, arguments.hold, arguments.between)
    check_film(file, film_options, overwrite=arguments.force)  # before the work, not after it
    if arguments.color in DIFFERENCES and not arguments.beside:
        arguments.wrong_usage(f"--color {arguments.color} compares two runs; give --beside too")
    if arguments.beside:
        require_pair_width(film_options.pixels(file))
    case = read_case(arguments)
    if film_kind(file) != ".png":  # of pictures it is not known yet how many there will be
        require_output_paths(arguments, OutputPath(file, "-o"))
    first, runs = _runs(arguments, case)
    session = session_of_runs(first, runs, arguments.color)
    drawing = draw(session, file, film_options, zoom=arguments.zoom, overwrite=arguments.force)
    with Bar(not arguments.quiet) as bar, closing(drawing):
        for drawn in drawing:
            bar.count(drawn.done, drawn.total, "image")
    if not arguments.quiet:
        _print_film(arguments, film_options, runs)
    folded = [_print_inverted(arguments, run) for run in runs]
    return INVERTED if any(folded) else DONE


def _runs(arguments: Namespace, case: Case) -> tuple[StepFrame, list[Run]]:
    """Return the undeformed mesh, the run of the case, and one with the changes of ``--beside``."""
    other = changed_beside(case, arguments.beside)  # mistakes before the work
    mesh_file = require_mesh_file(arguments, case)
    case, mesh = read_mesh(case, mesh_file)
    require_detail(arguments.zoom, mesh)

    def undeformed(one: Case) -> StepFrame:
        return StepFrame(mesh, quality(mesh, reference=mesh, metric=one.quality_metric))

    first = undeformed(case)
    if not arguments.beside:
        return first, [Run(1, case, _frames(arguments, case, mesh), "done")]
    keys = [text.partition("=")[0].strip().upper() for text in arguments.beside]
    runs = [
        Run(number, one, _frames(arguments, one, mesh), "done", name=_words(one, keys))
        for number, one in enumerate((case, other), start=1)
    ]
    if other.quality_metric != case.quality_metric:
        runs[1] = replace(runs[1], undeformed=undeformed(other))
    return first, runs


def _words(case: Case, keys: list[str]) -> str:
    words = []
    for name in dict.fromkeys(keys):
        value = KEYS[name].get(case)
        text = "not set" if value is None else KEYS[name].kind.write(value)
        words.append(f"{name}= {shorten(text, 40, placeholder=' ...')}")
    return ", ".join(words)


def _frames(arguments: Namespace, case: Case, mesh: Mesh) -> tuple[StepFrame, ...]:
    frames = []
    warnings = list[Remark]()
    cases = [("", case)]
    if arguments.designs is not None:
        table = read_designs(case, arguments.designs)
        require_distinct_times(table)
        cases = [
            (
                f"design {design.number} of {len(table.rows)}"
                if design.values.get(TIME, "") == ""
                else f"time {number_of(design.values[TIME]):g}",
                design.case,
            )
            for design in table.rows
        ]
    with Bar(not arguments.quiet) as bar:
        for label, one in cases:
            steps = list(deform(one, mesh, bar))
            for step in steps[-1:] if label else steps:
                measured = quality(step.mesh, reference=mesh, metric=one.quality_metric)
                frames.append(StepFrame(step.mesh, measured, step, label=label))
            warnings += step.messages
    print_remarks(dict.fromkeys(warnings), quiet=arguments.quiet)
    return tuple(frames)


def _print_film(arguments: Namespace, film_options: FilmOptions, runs: list[Run]) -> None:
    for run in runs:
        last_frame = run.frames[-1]
        last = last_frame.quality
        name = f"{run.name}: " if run.name else ""
        steps = counted(len(run.frames), "design" if last_frame.label else "step")
        print(f"{name}{steps}, min {last.min:.6g}, mean {last.mean:.6g}, {last.inverted} inverted")
    most = 1 + max(len(run.frames) for run in runs)
    images = film_options.count(most)
    pace = film_options.pace(most)
    print(f"film: {arguments.output} ({images} images, {pace:.3g} a second)")
    if most - 1 < SMOOTH and not arguments.between:
        print("few steps; --between 20 puts 20 images between two steps")


def _print_inverted(arguments: Namespace, run: Run) -> bool:
    """Print how many cells are inverted in the last step, or in designs; return whether any are."""
    last = [frame for frame in run.frames if frame.label] or run.frames[-1:]
    folded = [frame for frame in last if frame.quality.inverted]
    name = f"{run.name}: " if run.name else ""
    command = f"slideviz run {arguments.case}"
    if arguments.designs is not None:
        command = f"slideviz sweep {arguments.case} {arguments.designs} --meshes"
    for frame in folded:
        print(
            f"slideviz: {name}{frame.quality.inverted} of {len(frame.quality)} cells are inverted "
            f"{f'at {frame.label}' if frame.label else 'in the last step'}; `{command}` says "
            "which, and what may help",
            file=sys.stderr,
        )
    return bool(folded)
