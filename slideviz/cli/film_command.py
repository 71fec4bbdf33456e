"""What ``slideviz film`` does, and the words for sizes and details."""

from __future__ import annotations

import argparse
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slideviz.case.model import Case
    from slideviz.view.moved import Zoom
    from slideviz.view.state import Frame

SMOOTH = 4
"""Films of fewer steps are told that images can be put in between."""


def film(arguments: argparse.Namespace) -> int:
    """Deform a mesh as a case says, and write its steps as a film."""
    from slideviz.cli import DONE, INVERTED
    from slideviz.cli.progress import Bar
    from slideviz.cli.run_command import read_case
    from slideviz.view.film import film as draw
    from slideviz.view.reel import Reel, check_film

    file = arguments.output
    reel = Reel(arguments.size, arguments.fps, arguments.hold, arguments.between)
    check_film(file, reel, overwrite=arguments.force)  # before the work, not after it
    frames = _frames(arguments, read_case(arguments))
    drawing = draw(
        frames,
        file,
        reel,
        colour_by=arguments.color.replace("-", "_"),
        zoom=arguments.zoom,
        overwrite=arguments.force,
    )
    with Bar(not arguments.quiet) as bar, closing(drawing):
        for drawn in drawing:
            bar.count(drawn.done, drawn.total, "image")
    last = frames[-1].quality
    if not arguments.quiet:
        _print_film(arguments, reel.count(len(frames)), reel.pace(len(frames)), frames)
    if last.inverted:
        print(
            f"slideviz: {last.inverted} of {len(last)} cells are inverted in the last step; "
            f"`slideviz run {arguments.case}` says which, and what may help",
            file=sys.stderr,
        )
        return INVERTED
    return DONE


def _frames(arguments: argparse.Namespace, case: Case) -> list[Frame]:
    """Return the undeformed mesh and every step, with their quality."""
    from slideviz import deform, quality, read
    from slideviz.cli.progress import Bar
    from slideviz.errors import CaseError
    from slideviz.view.state import Frame

    if case.mesh_file is None:
        raise CaseError(f"{arguments.case}: MESH_FILENAME is missing; it names the mesh to deform")
    mesh = read(case.mesh_file, zone=case.zone)
    frames = [Frame(mesh, quality(mesh, reference=mesh, metric=case.quality_metric))]
    with Bar(not arguments.quiet) as bar:
        for step in deform(case, mesh, bar):
            found = quality(step.mesh, reference=mesh, metric=case.quality_metric)
            frames.append(Frame(step.mesh, found, step))
    for warning in step.warnings:
        print(f"slideviz: warning: {warning}", file=sys.stderr)
    return frames


def _print_film(
    arguments: argparse.Namespace, count: int, pace: float, frames: list[Frame]
) -> None:
    steps, last = len(frames) - 1, frames[-1].quality
    print(f"{steps} steps, min {last.min:.6g}, mean {last.mean:.6g}, {last.inverted} inverted")
    print(f"film: {arguments.output} ({count} images, {pace:.3g} a second)")
    if steps < SMOOTH and not arguments.between:
        print("few steps; --between 20 puts 20 images between two of them")


def add_film(calls: argparse._SubParsersAction) -> None:
    """Add the command ``film`` to the parser."""
    call = calls.add_parser(
        "film",
        help="deform a mesh and write the steps as MP4, GIF or numbered pictures",
        description="Deform a mesh as a case file says, and write the steps as a film.",
    )
    call.add_argument("case", type=Path, help="the case file (.cfg)")
    call.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE",
        help="FILE.mp4 or FILE.gif; a folder, or a pattern such as step_%%03d.png",
    )
    call.add_argument(
        "--size", type=size, metavar="WxH", help="pixels (1280x800; GIF 800x500; PNG 1600x1000)"
    )
    call.add_argument(
        "--fps", type=float, metavar="N", help="images a second (10; fewer if there are few)"
    )
    call.add_argument(
        "--hold", type=float, default=1.5, metavar="S", help="the last image stays S seconds (1.5)"
    )
    call.add_argument(
        "--between",
        type=int,
        default=0,
        metavar="N",
        help="images between two steps: nodes on straight lines, quality of that mesh (0)",
    )
    call.add_argument(
        "--color",
        choices=("size-skew", "size", "skew", "displacement"),
        default="size-skew",
        help="what the colours say (size-skew)",
    )
    add_zoom(call)
    call.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change a key of the case for this run; may be repeated",
    )
    call.add_argument("--zone", type=int, metavar="N", help="zone of the mesh file, from 1")
    call.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")
    call.add_argument("--force", action="store_true", help="replace files that exist")
    call.set_defaults(command=film)


def add_zoom(call: argparse.ArgumentParser) -> None:
    """Add the option ``--zoom``, which is the same for pictures and films."""
    call.add_argument(
        "--zoom",
        type=zoom,
        default="auto",
        metavar="X,Y[,Z],WIDTH",
        help="middle and width of what is seen; `all` is the whole mesh, `auto` (default) too, "
        "unless what moves is tiny in it",
    )


def size(text: str) -> tuple[int, int]:
    """Return width and height of ``1280x800``."""
    width, sign, height = text.lower().partition("x")
    if not (sign and width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form WIDTHxHEIGHT, as 1280x800")
    return int(width), int(height)


def zoom(text: str) -> Zoom:
    """Return the detail of ``X,Y,WIDTH`` or ``X,Y,Z,WIDTH``, or the words themselves."""
    if text == "auto":
        return "auto"
    if text == "all":
        return "all"
    from slideviz.view.moved import Detail

    try:
        *centre, width = (float(word) for word in text.split(","))
    except ValueError:
        centre, width = [], 0.0
    if len(centre) not in (2, 3) or not 0.0 < width < float("inf"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither X,Y,WIDTH (X,Y,Z,WIDTH in 3D; WIDTH above 0) nor `all` nor `auto`"
        )
    return Detail(tuple(centre), width)
