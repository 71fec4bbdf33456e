"""``slideviz convert``: writes a mesh in another format."""

from __future__ import annotations

from argparse import Namespace
from functools import partial

from slideviz.cli.output_paths import OutputPath, require_output_paths
from slideviz.cli.progress import Bar
from slideviz.cli.terminal import DONE, say
from slideviz.errors import CaseError
from slideviz.formats.files import convert
from slideviz.solver.steps import Progress
from slideviz.streaming.stream_input import missing_memory_of


def main(arguments: Namespace) -> int:
    """Write a mesh in another format, with notes on what that leaves out; return the exit code."""
    require_output_paths(arguments, OutputPath(arguments.output, "OUT", is_mesh=True))
    if _is_to_be_streamed(arguments):
        return _convert_streamed(arguments)
    convert(arguments.mesh, arguments.output, arguments.zone, warn=partial(say, "warning"))
    print(arguments.output)
    return DONE


def _is_to_be_streamed(arguments: Namespace) -> bool:
    """Return whether to convert piece by piece: with ``--stream``, or if memory is too small."""
    # Late: streaming takes 0.1 s, and is for large meshes.
    from slideviz.streaming.converting import streamed_kind

    kind = streamed_kind(arguments.mesh, arguments.output)
    if arguments.stream:
        if kind is None:
            raise CaseError(
                f"{arguments.mesh} to {arguments.output}: --stream converts from .su2 to .su2b and "
                "back; leave it out, or choose these formats"
            )
        return True
    missing = missing_memory_of(arguments.mesh, kind) if kind else ""
    if missing:
        say("note", f"{missing}; it is streamed")
    return bool(missing)


def _convert_streamed(arguments: Namespace) -> int:
    # Late: streaming takes 0.1 s, and is for large meshes.
    from slideviz.streaming.converting import convert_streamed

    with Bar() as bar:
        convert_streamed(
            arguments.mesh,
            arguments.output,
            arguments.zone,
            warn=partial(say, "warning"),
            tick=lambda part: bar.phase(Progress(1, 1, "convert", part)),
        )
    print(arguments.output)
    return DONE
