"""Checks the files that a command will read and write, before the work begins.

No input file must be overwritten, and no two results be written to one file.
"""

from __future__ import annotations

import os
import re
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.cli.terminal import say
from slideviz.errors import CaseError
from slideviz.formats.openfoam_paths import ENDING, case_folder, ending_of, mesh_path, stem_of
from slideviz.formats.table import MESHIO, format_for
from slideviz.system.atomic import make_folder, require_writable
from slideviz.system.file_checks import require_no_input, same_file

if TYPE_CHECKING:
    from slideviz.case.model import Case

_INPUTS = {
    "mesh": "the input mesh",
    "case": "the case file",
    "reference": "the reference mesh",
    "table": "the table of designs",
    "designs": "the table of designs",
}
"""Words for the input files of a command line, by the name of their argument."""


@dataclass(frozen=True)
class OutputPath:
    """A file that a command writes, or a folder of files."""

    path: Path | None  # none, or ``-`` for the terminal, where no file is written
    option: str  # the option or the key of the case that gives it, for messages
    named: bool = True
    """Whether it is on the command line; if not, there is a note where an older file is
    replaced."""
    files: str = ""
    """For a folder: a regular expression for the names of the files in it; else empty."""
    is_mesh: bool = False  # whether its ending must be one of a mesh format
    replaces: Path | None = None  # the only input file that it may overwrite
    remedy: str = ""  # the advice in the message where it is an input file

    def __post_init__(self) -> None:
        if self.is_mesh and self.path is not None:
            object.__setattr__(self, "path", mesh_path(self.path))


def input_paths(arguments: Namespace) -> dict[Path, str]:
    """Return the input files of a command line, with words for what each is."""
    paths = ((getattr(arguments, name, None), what) for name, what in _INPUTS.items())
    return {path: what for path, what in paths if path is not None}


def qualities_path(output: Path) -> Path:
    """Return the path of the qualities of cells, beside a mesh; CaseError if that is a folder."""
    if not output.name:
        raise CaseError(f"{output}: is a folder; expected the name of the mesh to write")
    folder = case_folder(output) if ending_of(output) == ENDING else output.parent
    return folder / f"{stem_of(output)}_qual.txt"


def add_case_inputs(arguments: Namespace, case: Case) -> None:
    """Add the input files of a case to those of the command line, ``arguments.inputs``."""
    for path, what in case.inputs().items():
        arguments.inputs.setdefault(path, what)


def require_output_paths(arguments: Namespace, *outputs: OutputPath) -> None:
    """Raise where a result must not or cannot be written; print which older files are replaced.

    Folders for results are made where they are missing. Raises SlidevizError if a result is an
    input file, or two results are one file; the folder is missing, there is no permission, a folder
    has that name, or no mesh format has that ending.
    """
    there = [output for output in outputs if output.path is not None and str(output.path) != "-"]
    for output in there:
        assert output.path is not None
        # First of all, whether an input would be overwritten: the worst mistake.
        for path in _paths(output):
            require_no_input(path, CaseError, output.replaces, output.remedy)
    for output, other in combinations(there, 2):
        if _overlap(output, other) or _overlap(other, output):
            file = output.path if other.files else other.path
            raise CaseError(
                f"{output.option} and {other.option} both name {file}; give each a file of its own"
            )
    is_case = any(ending_of(one.path) == ENDING for one in there if one.path is not None)
    for output in there:
        assert output.path is not None
        if output.is_mesh and format_for(output.path).writer == MESHIO.writer:
            # Late: meshio takes 0.1 s.
            from slideviz.formats.meshio.bridge import formats_of

            formats_of(output.path)
        if output.files:
            make_folder(output.path)
        else:
            place = output.path
            while is_case and not place.parent.exists():
                place = place.parent  # folders of a new case are made with it
            require_writable(place, CaseError, output.replaces)
    old_files = []
    for output in there:
        old = [path for path in _paths(output) if path.exists()]
        if old and not output.named:
            more = f" and {len(old) - 1} more" if len(old) > 1 else ""
            old_files.append(f"{old[0]}{more} ({output.option})")
    if old_files and not arguments.quiet:
        say("note", f"there already, and replaced by this run: {', '.join(old_files)}")


def _paths(output: OutputPath) -> Iterator[Path]:
    assert output.path is not None
    if not output.files:
        yield output.path
    elif output.path.is_dir():
        yield from sorted(
            path for path in output.path.iterdir() if re.fullmatch(output.files, path.name)
        )


def _overlap(output: OutputPath, other: OutputPath) -> bool:
    """Return whether the file ``other`` is ``output``, or would be one in that folder."""
    assert output.path is not None
    assert other.path is not None
    if other.files:
        return False
    if not output.files or same_file(output.path, other.path):
        return same_file(output.path, other.path)
    folder, name = os.path.split(os.path.realpath(other.path))
    inside = os.path.realpath(output.path) == folder and re.fullmatch(output.files, name)
    return bool(inside) or any(same_file(path, other.path) for path in _paths(output))
