"""The parsers of the commands; they load neither NumPy nor the commands, so that help is quick."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.cli.options import (
    add_changes,
    add_reference,
    add_shared,
    add_zoom,
    checked,
    integer,
    size,
)
from slideviz.cli.section_options import limits, neighbours, pair_of_names, pixels, section_reader
from slideviz.formats.table import FILE_FORMATS, own_endings
from slideviz.terms import COLOR_MAPS, QUANTITIES, REPAIR_TARGETS, SKEW_METRICS

if TYPE_CHECKING:
    from slideviz.case.limits import Limit
    from slideviz.design.deformed_wheel import Count


def add_run(calls: argparse._SubParsersAction) -> None:
    """Add the command ``run`` to the parser."""
    call = calls.add_parser("run", help="deform a mesh as a case file says")
    add_shared(call, "case")
    call.add_argument("-o", "--output", type=Path, metavar="MESH", help="deformed mesh to write")
    add_changes(call)
    add_shared(call, "json", "metrics")
    call.add_argument(
        "--history", type=Path, metavar="FILE", help="convergence of the data reduction (CSV)"
    )
    call.add_argument("--steps-dir", type=Path, metavar="DIR", help="write the mesh of every step")
    call.add_argument(
        "--steps-file",
        type=Path,
        metavar="FILE",
        help=f"all steps with their quality in one file for ParaView ({own_endings('series')})",
    )
    call.add_argument(
        "--picture",
        type=Path,
        metavar="FILE",
        help="picture of the quality (PNG); keys VIEW_... are for the window",
    )
    call.add_argument("--picture-size", type=size, metavar="WxH", help="pixels (1600x1000)")
    add_zoom(call)
    add_shared(call, "zone")
    add_shared(
        call, "stream", help="for meshes larger than memory (SU2): only the boundary is in memory"
    )
    add_shared(call, "quiet", "force")
    call.set_defaults(holds=True)


def add_info(calls: argparse._SubParsersAction) -> None:
    """Add the command ``info`` to the parser."""
    call = calls.add_parser("info", help="what is in a mesh file")
    call.add_argument("mesh", type=Path)
    add_shared(call, "zone", "json", "stream")


def quality_limits(text: str) -> tuple[Limit, ...]:
    """Return the limits of a text."""
    # Late: the case takes 0.5 s, and help does not need it.
    from slideviz.case.limits import read_limits

    found = read_limits(text)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} has no limit; write e.g. min > 0.3")
    return found


def add_quality(calls: argparse._SubParsersAction) -> None:
    """Add the command ``quality`` to the parser."""
    call = calls.add_parser("quality", help="size-skew quality of a mesh")
    call.add_argument("mesh", type=Path)
    add_reference(call, "case that made it: its MESH_FILENAME is the reference")
    call.add_argument(
        "--metric",
        choices=tuple(SKEW_METRICS),
        default="knupp",
        help="rbf-slide: hexahedra as that program measures them (default: knupp)",
    )
    call.add_argument(
        "--limits",
        type=checked(quality_limits),
        default=(),
        metavar="LIMITS",
        help='limits like those of the key LIMITS, e.g. "min > 0.3, inverted = 0"; exit code 4 if '
        "one is not met",
    )
    add_shared(call, "metrics", "zone", "json")
    call.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help=f"mesh with quality ({own_endings('quality')}), or .csv",
    )
    add_shared(call, "stream")


def _names(text: str) -> tuple[str, ...]:
    """Return the names of a text, separated by commas."""
    return tuple(filter(None, (name.strip() for name in text.split(","))))


def _below(text: str) -> float:
    """Return the value of a text as of the key REPAIR_BELOW."""
    # Late: the case takes 0.5 s, and help does not need it.
    from slideviz.case.keys import KEYS

    return float(KEYS["REPAIR_BELOW"].kind.read(text))


def add_repair(calls: argparse._SubParsersAction) -> None:
    """Add the command ``repair`` to the parser."""
    call = calls.add_parser("repair", help="mend inverted and poor cells of a mesh")
    call.add_argument("mesh", type=Path)
    call.add_argument(
        "-o", "--output", type=Path, metavar="OUT", required=True, help="repaired mesh to write"
    )
    call.add_argument(
        "--reference", type=Path, metavar="UNDEFORMED", help="undeformed mesh, with the same cells"
    )
    for role, what in (
        ("fixed", "boundaries that stay; so do boundaries that are not named"),
        ("sliding", "boundaries along which nodes may slide"),
        ("periodic", "pairs of periodic boundaries, which may move alike"),
    ):
        call.add_argument(f"--{role}", type=_names, default=(), metavar="A,B", help=what)
    call.add_argument(
        "--below",
        type=checked(_below),
        default=0.1,
        metavar="Q",
        help="mend valid cells of a lower quality, too (0.1); 0: only those not proved valid",
    )
    call.add_argument(
        "--target",
        choices=tuple(REPAIR_TARGETS),
        help="shapes that cells shall have: of the reference (the default, if there is one), or "
        "the ideal ones",
    )
    call.add_argument(
        "--metric", choices=tuple(SKEW_METRICS), default="knupp", help="of the quality (knupp)"
    )
    add_shared(call, "zone", "json", "quiet", "force")
    call.set_defaults(holds=True)


def add_film(calls: argparse._SubParsersAction) -> None:
    """Add the command ``film`` to the parser."""
    call = calls.add_parser(
        "film",
        help="deform a mesh and write the steps as MP4, GIF or numbered pictures",
        description="Deform a mesh as a case file says, and write the steps as a film.",
    )
    add_shared(call, "case")
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
        "--fps", type=float, metavar="N", help="images per second (10; fewer if there are few)"
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
        choices=tuple(QUANTITIES),
        default="size-skew",
        help="what the colors show (size-skew)",
    )
    call.add_argument(
        "--designs",
        type=Path,
        metavar="TABLE",
        help="an image for each design of a table (see sweep) instead of the steps",
    )
    add_zoom(call)
    add_changes(call)
    call.add_argument(
        "--beside",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="show a second run next to it with this change, e.g. SLIDING_MODE=none; may be "
        "repeated",
    )
    add_shared(call, "zone", "quiet")
    call.add_argument("--force", action="store_true", help="replace files that exist")


CUT_HELP = "cut them (default in 3D); in 2D: the curve of their numbers along the line"


EXAMPLES = """\
examples:
  slideviz section stator.su2 --cylinder 0.275 --copies 2 -o mid_span.png
  slideviz section out.su2 --reference mesh.su2 --plane 0,0,1,0,0,0.5 -o half.svg
  slideviz section stator.su2 --cone 10,z,0,0,-1.5 --copies 2 -o cone.png
  slideviz section stator.su2 --span 0.9 --between HUB,SHROUD -o tip.png
  slideviz section out.su2 --plane z=0.5 --color displacement --reference mesh.su2 -o moved.pdf
"""


def add_section(calls: argparse._SubParsersAction) -> None:
    """Add the command ``section`` to the parser."""
    call = calls.add_parser(
        "section",
        help=f"picture of a {names()} through a mesh",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    call.add_argument("mesh", type=Path)
    add = call.add_argument
    where = call.add_mutually_exclusive_group(required=True)
    for name, row in SECTION_SHAPES.items():
        metavar = row.metavar or name.upper()
        where.add_argument(
            f"--{name}", type=section_reader(row), dest="asked", metavar=metavar, help=row.option
        )
    where.add_argument(
        "--meridional",
        action="store_true",
        help="instead of a section: the mean quality of the cells around the axis, by z and r",
    )
    add(
        "--between",
        type=pair_of_names,
        metavar="HUB,SHROUD",
        help="the walls of --span and --meridional; by default SPAN of the case, or what their "
        "names say",
    )
    add("-o", "--output", type=Path, metavar="FILE", required=True, help=".png, .svg or .pdf")
    add_reference(
        call,
        "case that names periodic boundaries and axis; its MESH_FILENAME is the reference "
        "where it has the same cells",
    )
    add("--color", choices=tuple(QUANTITIES), default="size-skew", help="(default: size-skew)")
    add("--range", type=limits, metavar="LO,HI", help="ends of the color bar")
    maps = tuple(COLOR_MAPS)
    add("--map", choices=maps, default=maps[0], help=f"color map (default: {maps[0]})")
    cells = call.add_mutually_exclusive_group()
    cells.add_argument("--whole", action="store_true", default=None, help="show cells whole")
    cells.add_argument("--cut", action="store_false", dest="whole", help=CUT_HELP)
    view = call.add_mutually_exclusive_group()
    view.add_argument(
        "--unrolled",
        action="store_true",
        help="lay sections with an axis flat, a cylinder to (z, r theta); the default",
    )
    view.add_argument("--3d", action="store_true", dest="in_space", help="show it in space")
    add(
        "--copies",
        type=neighbours,
        metavar="N",
        default=0,
        help="neighbouring passages to draw on each side, or wheel for all",
    )
    add(
        "--size",
        type=pixels,
        metavar="WxH",
        help="pixels (default: 1600 wide, and as high as the section needs)",
    )
    add("--no-edges", action="store_false", dest="edges", help="leave out the mesh lines")
    add("--no-title", action="store_false", dest="title", help="leave out the title")
    add("--no-axes", action="store_false", dest="axes", help="leave out axes and their numbers")
    add("--metric", choices=tuple(SKEW_METRICS), default="knupp", help="as for quality")
    add_shared(call, "zone")
    add_shared(call, "json", help="numbers of the cut as JSON; - is the terminal")
    add_shared(call, "stream")
    call.set_defaults(wrong_usage=call.error)


def add_gap(calls: argparse._SubParsersAction) -> None:
    """Add the command ``gap`` to the parser."""
    call = calls.add_parser(
        "gap",
        help="throat, tip gap and other smallest distances, before and after",
        description="Measure the smallest distances between blades (the throat), between blades "
        "and walls (tip gap, hub gap) and between other boundaries, by span, before and after the "
        "run of a case. Blades are the moving boundaries. No mesh is written.",
    )
    add_shared(call, "case")
    call.add_argument(
        "--between",
        type=pair_of_names,
        action="append",
        default=[],
        metavar="A,B",
        help="measure between these two boundaries, too; may be repeated",
    )
    call.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the curves as .png, .svg or .pdf"
    )
    add_changes(call)
    add_shared(call, "json")
    add_shared(call, "zone")
    add_shared(call, "quiet")


def add_compare(calls: argparse._SubParsersAction) -> None:
    """Add the command ``compare`` to the parser."""
    about = "one case by several methods: table, plots and pictures"
    call = calls.add_parser(
        "compare",
        help=about,
        description=f"Deform {about}. It first lists what it will compute, and what is impossible.",
        epilog="exit codes: 0 compared (also if cells are inverted: see the table); 1 no "
        "combination could be computed; 130 cancelled, finished rows are in the table",
    )
    add_shared(call, "case")
    call.add_argument(
        "--methods", metavar="LIST", help="of none,ps,ds,idw,elastic, or all (default: none,ps,ds)"
    )
    call.add_argument(
        "--periodic",
        metavar="LIST",
        help="of none,periodic,fixed,moving, or all (default: the mode of the case; moving adds "
        "fixed for the methods that cannot move nodes)",
    )
    call.add_argument("--steps", metavar="LIST", help="numbers of steps, or auto (default: 1,5,20)")
    call.add_argument(
        "--span",
        choices=("r", "x", "y", "z", "none"),
        help="direction of the spanwise plots (default: r or z of a 3D mesh, none of a 2D one)",
    )
    call.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder (default: NAME_compared)"
    )
    add_shared(call, "set")
    add_shared(call, "zone")
    call.add_argument(
        "--no-pictures", action="store_true", help="table and plots only, no quality pictures"
    )
    add_shared(call, "quiet")


def add_sweep(calls: argparse._SubParsersAction) -> None:
    """Add the command ``sweep`` to the parser."""
    call = calls.add_parser(
        "sweep",
        help="a run for each row of a table of designs",
        description="Deform a mesh by each design of a table, on all cores or on a Dask cluster, "
        "and write a table of quality, errors and times. Columns are numbers of the motions, such "
        "as BLADE.translate.y or motion2.angle_deg, and keys of the case, such as STEPS; "
        "`--columns` "
        "lists them.",
        epilog="exit codes: 0 done (also if cells are inverted or a design failed: see the "
        "table); 1 no design could be computed; 130 cancelled, 143 ended by SIGTERM: finished "
        "designs are in the table, and --resume continues",
    )
    add_shared(call, "case")
    call.add_argument(
        "table", type=Path, nargs="?", help="the table of designs (CSV), or 'displacement_*.txt'"
    )
    call.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder (default: NAME_swept)"
    )
    call.add_argument("--columns", action="store_true", help="list the possible columns")
    call.add_argument("--meshes", action="store_true", help="write the mesh of each design")
    call.add_argument(
        "--workers", type=integer, metavar="N", help="processes (default: one for each core)"
    )
    call.add_argument(
        "--scheduler", metavar="ADDRESS", help="work on a Dask cluster, e.g. tcp://node1:8786"
    )
    call.add_argument("--resume", action="store_true", help="continue an interrupted sweep")
    call.add_argument(
        "--force", action="store_true", help="start again, and replace existing results"
    )
    add_shared(call, "set")
    call.add_argument(
        "--time-step",
        type=float,
        metavar="DT",
        help="number the meshes by time / DT, like SU2's files (table with a column time)",
    )
    add_shared(
        call, "stream", help="with --meshes, for meshes larger than memory (SU2): one at a time"
    )
    add_shared(call, "zone", "json", "quiet")


def add_convert(calls: argparse._SubParsersAction) -> None:
    """Add the command ``convert`` to the parser."""
    call = calls.add_parser("convert", help="write a mesh in another format")
    call.add_argument("mesh", type=Path, help="the mesh to read")
    call.add_argument("output", type=Path, help="the mesh to write; its ending names the format")
    add_shared(call, "zone", help="one zone, from 1 (default: all)")
    add_shared(
        call,
        "stream",
        help="for meshes larger than memory: from .su2 to .su2b or back, piece by piece",
    )
    call.set_defaults(holds=True)


def passages(text: str) -> Count | list[Count]:
    """Return a number of passages, or "all"; with commas one for each zone."""
    words = [word.strip() for word in text.split(",")]
    counts: list[Count] = ["all" if word.lower() == "all" else integer(word) for word in words]
    return counts if len(counts) > 1 else counts[0]


def add_wheel(calls: argparse._SubParsersAction) -> None:
    """Add the command ``wheel`` to the parser."""
    call = calls.add_parser(
        "wheel",
        help="write the whole wheel of a passage",
        description="Deform a passage as a case says, and write the wheel that its copies make, "
        "turned about the axis and merged at the periodic boundaries. Without motions the "
        "passages are undeformed.",
    )
    add_shared(call, "case")
    call.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="MESH",
        required=True,
        help="the wheel: .su2, or .su2b for large ones",
    )
    call.add_argument(
        "--passages",
        type=passages,
        default="all",
        metavar="N",
        help="their number; all for a whole turn (default); with commas one for each zone",
    )
    call.add_argument(
        "--numbered",
        action="store_true",
        help="boundaries of their own for each passage: blade_1, blade_2",
    )
    call.add_argument(
        "--designs",
        type=Path,
        metavar="TABLE",
        help="motions of passages (CSV, see `slideviz sweep`): one row for each passage from the "
        "first on; the others move as the case says",
    )
    add_changes(call)
    add_shared(call, "json")
    add_shared(call, "zone")
    add_shared(call, "quiet")


_OF_A_RUN = ("history", "picture", "steps_dir", "steps_file")
"""Options of ``slideviz run`` that `report_outcome` reads; this command sets them to None."""


def add_def(calls: argparse._SubParsersAction) -> None:
    """Add the command ``def`` to the parser."""
    call = calls.add_parser("def", help="deform as a configuration of SU2 says, like SU2_DEF")
    add_config(call)
    add_shared(call, "json", "force")
    call.set_defaults(holds=True, **dict.fromkeys(_OF_A_RUN))


def add_config(call: argparse.ArgumentParser) -> None:
    """Add the arguments that ``def`` and ``dot`` share."""
    call.add_argument("case", type=Path, metavar="CONFIG", help="the configuration of SU2 (.cfg)")
    add_shared(call, "set", help="change a key for this run; may be repeated")
    add_shared(call, "quiet")


def add_dot(calls: argparse._SubParsersAction) -> None:
    """Add the command ``dot`` to the parser."""
    call = calls.add_parser("dot", help="gradients for SU2's design variables, like SU2_DOT_AD")
    add_config(call)
    add_shared(call, "json")
    call.set_defaults(holds=True)


def add_sample(calls: argparse._SubParsersAction) -> None:
    """Add the command ``sample`` to the parser."""
    call = calls.add_parser("sample", help="write a sample case")
    call.add_argument("name", nargs="?", help="name of the sample; without it, list all")
    call.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder (default: NAME)")
    call.add_argument(
        "--size", type=integer, metavar="N", help="size; the list says what it counts"
    )
    call.add_argument(
        "--format",
        type=str.lower,
        choices=tuple(FILE_FORMATS),
        default="su2",
        help="of the mesh; su2b (binary) for up to 200 million cells (default: su2)",
    )
    call.add_argument("--variant", metavar="NAME", help="other motions; listed without NAME")
    call.add_argument("--force", action="store_true", help="replace files that exist")
    add_shared(call, "quiet")


def add_keys(calls: argparse._SubParsersAction) -> None:
    """Add the command ``keys`` to the parser."""
    calls.add_parser("keys", help="reference of all case keys")
