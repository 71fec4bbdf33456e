"""The table of commands: the arguments of each, which add themselves to a parser, and its help.

It loads neither NumPy nor the commands, so that help is quick.
"""

from __future__ import annotations

from argparse import Action, ArgumentTypeError, _ActionsContainer
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

from slideviz.case.section_shapes import SECTION_SHAPES, names
from slideviz.cli.argument_readers import (
    integer,
    limits,
    metric_names,
    names_in,
    neighbours,
    pair_of_names,
    passages,
    pixels,
    quality_limits,
    repair_below,
    section_reader,
    size,
    zoom,
)
from slideviz.errors import CaseError
from slideviz.formats.table import FILE_FORMATS, own_endings
from slideviz.terms import COLOR_MAPS, QUANTITIES, REPAIR_TARGETS, SKEW_METRICS

Read = TypeVar("Read")
Add = Callable[[_ActionsContainer], object]
"""Adds an argument, or a group of them, to a parser."""


def argument(flags: str, words: str | None = None, **keywords: Any) -> Add:
    """Return an argument with ``flags``, separated by blanks, and ``words`` for its help."""

    def add(parser: _ActionsContainer) -> Action:
        return parser.add_argument(*flags.split(), help=words, **keywords)

    return add


def switch(flags: str, words: str, **keywords: Any) -> Add:
    """Return an option without a value: True where it is given."""
    return argument(flags, words, **{"action": "store_true", **keywords})


def file(flags: str, metavar: str | None = None, words: str | None = None, **keywords: Any) -> Add:
    """Return an argument that is a path."""
    return argument(flags, words, type=Path, metavar=metavar, **keywords)


def value(flags: str, read: Callable[[str], Any], metavar: str, words: str, **keywords: Any) -> Add:
    """Return an argument that ``read`` reads: its CaseError means wrong usage."""
    return argument(flags, words, type=_checked(read), metavar=metavar, **keywords)


def several(flags: str, metavar: str, words: str, read: Callable[[str], Any] = str) -> Add:
    """Return an option that may be repeated; its value is the list of all, as of `value`."""
    return value(flags, read, metavar, words, action="append", default=[])


def choice(flags: str, values: Iterable[str], words: str, default: str | None = None) -> Add:
    """Return an option that is one of ``values``."""
    return argument(flags, words, choices=tuple(values), default=default)


def one_of(*arguments: Add, required: bool = False) -> Add:
    """Return arguments of which only one may be given."""

    def add(parser: _ActionsContainer) -> None:
        group = parser.add_mutually_exclusive_group(required=required)
        for each in arguments:
            each(group)

    return add


def _checked(read: Callable[[str], Read]) -> Callable[[str], Read]:
    @wraps(read)
    def checked(text: str) -> Read:
        try:
            return read(text)
        except CaseError as problem:
            raise ArgumentTypeError("; ".join(map(str, problem.messages))) from None

    return checked


@dataclass(frozen=True)
class Command:
    """A command, which ``main`` in the module ``NAME_command`` does."""

    help: str  # its line in the list of commands
    arguments: tuple[Add, ...] = ()
    description: str | None = None
    epilog: str | None = None
    examples: str = ""  # instead of an epilog, its lines as they are
    holds: bool = False
    """Whether notes and warnings wait until nothing can be refused any more."""


CASE = file("case", words="the case file (.cfg)")
MESH = file("mesh")
ZONE = value("--zone", int, "N", "zone of the mesh file, from 1")
QUIET = switch("-q --quiet", "print nothing but warnings and errors")
JSON = file("--json", "FILE", "report as JSON; - is the terminal")
FORCE = switch("--force", "allow writing over the input mesh")
REPLACE = switch("--force", "replace files that exist")
STREAM = switch("--stream", "for meshes larger than memory (SU2)")
METRICS = value(
    "--metrics",
    metric_names,
    "NAMES",
    "other numbers too, also in a .vtu, .vtkhdf or .csv file: all, or names with commas, e.g. "
    "skewness,expansion,growth",
    default=(),
)
SET = several(
    "--set",
    "KEY=VALUE",
    "change a key of the case; may be repeated; paths are relative to the current folder",
)
CHANGES = (
    several(
        "--set",
        "KEY=VALUE",
        "change a key of the case for this run; may be repeated; paths are relative to the current "
        "folder",
    ),
    argument("--steps", "number of steps, or auto (--set STEPS=N)", dest="step_count", metavar="N"),
)
"""Options that change the case for one run."""
ZOOM = value(
    "--zoom",
    zoom,
    "X,Y[,Z],WIDTH",
    "center and width of the picture; `all` is the whole mesh, as is `auto` (default), unless the "
    "moving body is tiny in it; `view` is the view, colors and sections of the keys VIEW_...",
    default="auto",
)
REFERENCE = file(
    "--reference",
    "UNDEFORMED",
    "mesh to compare with; without it only the shape of cells is measured",
)
CONFIG = (
    file("case", "CONFIG", "the configuration of SU2 (.cfg)"),
    several("--set", "KEY=VALUE", "change a key for this run; may be repeated"),
    QUIET,
)
"""The arguments that ``def`` and ``dot`` share."""
_MAPS = tuple(COLOR_MAPS)
_ABOUT_COMPARE = "one case by several methods: table, plots and pictures"

_EXAMPLES = """\
examples:
  slideviz section stator.su2 --cylinder 0.275 --copies 2 -o mid_span.png
  slideviz section out.su2 --reference mesh.su2 --plane 0,0,1,0,0,0.5 -o half.svg
  slideviz section stator.su2 --cone 10,z,0,0,-1.5 --copies 2 -o cone.png
  slideviz section stator.su2 --span 0.9 --between HUB,SHROUD -o tip.png
  slideviz section out.su2 --plane z=0.5 --color displacement --reference mesh.su2 -o moved.pdf
"""

COMMANDS = {
    "run": Command(
        "deform a mesh as a case file says",
        (
            CASE,
            file("-o --output", "MESH", "deformed mesh to write"),
            *CHANGES,
            JSON,
            METRICS,
            file("--history", "FILE", "convergence of the data reduction (CSV)"),
            file("--steps-dir", "DIR", "write the mesh of every step"),
            file(
                "--steps-file",
                "FILE",
                f"all steps with their quality in one file for ParaView ({own_endings('series')})",
            ),
            file(
                "--picture",
                "FILE",
                "picture of the quality (PNG); keys VIEW_... are for the window",
            ),
            value("--picture-size", size, "WxH", "pixels (1600x1000)"),
            ZOOM,
            ZONE,
            switch(
                "--stream", "for meshes larger than memory (SU2): only the boundary is in memory"
            ),
            QUIET,
            FORCE,
        ),
        holds=True,
    ),
    "info": Command("what is in a mesh file", (MESH, ZONE, JSON, STREAM)),
    "quality": Command(
        "size-skew quality of a mesh",
        (
            MESH,
            REFERENCE,
            file("--case", "CASE", "case that made it: its MESH_FILENAME is the reference"),
            choice(
                "--metric",
                SKEW_METRICS,
                "rbf-slide: hexahedra as that program measures them (default: knupp)",
                "knupp",
            ),
            value(
                "--limits",
                quality_limits,
                "LIMITS",
                'limits like those of the key LIMITS, e.g. "min > 0.3, inverted = 0"; exit code 4 '
                "if one is not met",
                default=(),
            ),
            METRICS,
            ZONE,
            JSON,
            file("-o --output", "FILE", f"mesh with quality ({own_endings('quality')}), or .csv"),
            STREAM,
        ),
    ),
    "repair": Command(
        "mend inverted and poor cells of a mesh",
        (
            MESH,
            file("-o --output", "OUT", "repaired mesh to write", required=True),
            file("--reference", "UNDEFORMED", "undeformed mesh, with the same cells"),
            *(
                value(f"--{role}", names_in, "A,B", words, default=())
                for role, words in (
                    ("fixed", "boundaries that stay; so do boundaries that are not named"),
                    ("sliding", "boundaries along which nodes may slide"),
                    ("periodic", "pairs of periodic boundaries, which may move alike"),
                )
            ),
            value(
                "--below",
                repair_below,
                "Q",
                "mend valid cells of a lower quality, too (0.1); 0: only those not proved valid",
                default=0.1,
            ),
            choice(
                "--target",
                REPAIR_TARGETS,
                "shapes that cells shall have: of the reference (the default, if there is one), or "
                "the ideal ones",
            ),
            choice("--metric", SKEW_METRICS, "of the quality (knupp)", "knupp"),
            ZONE,
            JSON,
            QUIET,
            FORCE,
        ),
        holds=True,
    ),
    "picture": Command(
        "deform a mesh and write a picture of a step",
        (
            CASE,
            file("-o --output", "FILE.png", "the picture", required=True),
            value("--step", int, "N", "the step to show; 0 is the undeformed mesh (the last)"),
            several(
                "--beside",
                "KEY=VALUE",
                "show a second run next to it with this change; or `undeformed`; may be repeated",
            ),
            value("--size", size, "WxH", "pixels (1600x1000)", default=(1600, 1000)),
            ZOOM,
            *CHANGES,
            ZONE,
            QUIET,
        ),
        "Deform a mesh as a case file says, and write a picture of a step. No mesh is written.",
    ),
    "film": Command(
        "deform a mesh and write the steps as MP4, GIF or numbered pictures",
        (
            CASE,
            file(
                "-o --output",
                "FILE",
                "FILE.mp4 or FILE.gif; a folder, or a pattern such as step_%%03d.png",
                required=True,
            ),
            value("--size", size, "WxH", "pixels (1280x800; GIF 800x500; PNG 1600x1000)"),
            value("--fps", float, "N", "images per second (10; fewer if there are few)"),
            value("--hold", float, "S", "the last image stays S seconds (1.5)", default=1.5),
            value(
                "--between",
                int,
                "N",
                "images between two steps: nodes on straight lines, quality of that mesh (0)",
                default=0,
            ),
            choice("--color", QUANTITIES, "what the colors show (size-skew)", "size-skew"),
            file(
                "--designs",
                "TABLE",
                "an image for each design of a table (see sweep) instead of the steps",
            ),
            ZOOM,
            *CHANGES,
            several(
                "--beside",
                "KEY=VALUE",
                "show a second run next to it with this change, e.g. SLIDING_MODE=none; may be "
                "repeated",
            ),
            ZONE,
            QUIET,
            REPLACE,
        ),
        "Deform a mesh as a case file says, and write the steps as a film.",
    ),
    "report": Command(
        "deform a mesh and write a report of the run as one HTML file",
        (
            CASE,
            file("-o --output", "FILE.html", "the report (default: NAME_report.html)"),
            ZOOM,
            *CHANGES,
            ZONE,
            QUIET,
        ),
        "Deform a mesh as a case file says, and write a report as one HTML file: picture, "
        "histogram, numbers of the run, limits, walls, warnings, case and versions. Nothing in it "
        "comes from a network. No mesh is written.",
    ),
    "section": Command(
        f"picture of a {names()} through a mesh",
        (
            MESH,
            one_of(
                *(
                    value(
                        f"--{name}",
                        section_reader(row),
                        row.metavar or name.upper(),
                        row.option,
                        dest="asked",
                    )
                    for name, row in SECTION_SHAPES.items()
                ),
                switch(
                    "--meridional",
                    "instead of a section: the mean quality of the cells around the axis, by z and "
                    "r",
                ),
                required=True,
            ),
            value(
                "--between",
                pair_of_names,
                "HUB,SHROUD",
                "the walls of --span and --meridional; by default SPAN of the case, or what their "
                "names say",
            ),
            file("-o --output", "FILE", ".png, .svg or .pdf", required=True),
            REFERENCE,
            file(
                "--case",
                "CASE",
                "case that names periodic boundaries and axis; its MESH_FILENAME is the reference "
                "where it has the same cells",
            ),
            choice("--color", QUANTITIES, "(default: size-skew)", "size-skew"),
            value("--range", limits, "LO,HI", "ends of the color bar"),
            choice("--map", _MAPS, f"color map (default: {_MAPS[0]})", _MAPS[0]),
            one_of(
                switch("--whole", "show cells whole", default=None),
                switch(
                    "--cut",
                    "cut them (default in 3D); in 2D: the curve of their numbers along the line",
                    action="store_false",
                    dest="whole",
                ),
            ),
            one_of(
                switch(
                    "--unrolled",
                    "lay sections with an axis flat, a cylinder to (z, r theta); the default",
                ),
                switch("--3d", "show it in space", dest="in_space"),
            ),
            value(
                "--copies",
                neighbours,
                "N",
                "neighbouring passages to draw on each side, or wheel for all",
                default=0,
            ),
            value(
                "--size",
                pixels,
                "WxH",
                "pixels (default: 1600 wide, and as high as the section needs)",
            ),
            switch("--no-edges", "leave out the mesh lines", action="store_false", dest="edges"),
            switch("--no-title", "leave out the title", action="store_false", dest="title"),
            switch(
                "--no-axes",
                "leave out axes and their numbers",
                action="store_false",
                dest="axes",
            ),
            choice("--metric", SKEW_METRICS, "as for quality", "knupp"),
            ZONE,
            file("--json", "FILE", "numbers of the cut as JSON; - is the terminal"),
            STREAM,
        ),
        examples=_EXAMPLES,
    ),
    "gap": Command(
        "throat, tip gap and other smallest distances, before and after",
        (
            CASE,
            several(
                "--between",
                "A,B",
                "measure between these two boundaries, too; may be repeated",
                pair_of_names,
            ),
            file("-o --output", "FILE", "the curves as .png, .svg or .pdf"),
            *CHANGES,
            JSON,
            ZONE,
            QUIET,
        ),
        "Measure the smallest distances between blades (the throat), between blades and walls (tip "
        "gap, hub gap) and between other boundaries, by span, before and after the run of a case. "
        "Blades are the moving boundaries. No mesh is written.",
        holds=True,
    ),
    "compare": Command(
        _ABOUT_COMPARE,
        (
            CASE,
            argument(
                "--methods",
                "of none,ps,ds,idw,elastic, or all (default: none,ps,ds)",
                metavar="LIST",
            ),
            argument(
                "--periodic",
                "of none,periodic,fixed,moving, or all (default: the mode of the case; moving adds "
                "fixed for the methods that cannot move nodes)",
                metavar="LIST",
            ),
            argument("--steps", "numbers of steps, or auto (default: 1,5,20)", metavar="LIST"),
            choice(
                "--span",
                ("r", "x", "y", "z", "none"),
                "direction of the spanwise plots (default: r or z of a 3D mesh, none of a 2D one)",
            ),
            file("-o --output", "DIR", "folder (default: NAME_compared)"),
            SET,
            ZONE,
            switch("--no-pictures", "table and plots only, no quality pictures"),
            QUIET,
        ),
        f"Deform {_ABOUT_COMPARE}. It first lists what it will compute, and what is impossible.",
        "exit codes: 0 compared (also if cells are inverted: see the table); 1 no combination "
        "could be computed; 130 cancelled, finished rows are in the table",
    ),
    "sweep": Command(
        "a run for each row of a table of designs",
        (
            CASE,
            file("table", words="the table of designs (CSV), or 'displacement_*.txt'", nargs="?"),
            file("-o --output", "DIR", "folder (default: NAME_swept)"),
            switch("--columns", "list the possible columns"),
            switch("--meshes", "write the mesh of each design"),
            value("--workers", integer, "N", "processes (default: one for each core)"),
            argument(
                "--scheduler",
                "work on a Dask cluster, e.g. tcp://node1:8786",
                metavar="ADDRESS",
            ),
            switch("--resume", "continue an interrupted sweep"),
            switch("--force", "start again, and replace existing results"),
            SET,
            value(
                "--time-step",
                float,
                "DT",
                "number the meshes by time / DT, like SU2's files (table with a column time)",
            ),
            switch("--stream", "with --meshes, for meshes larger than memory (SU2): one at a time"),
            ZONE,
            JSON,
            QUIET,
        ),
        "Deform a mesh by each design of a table, on all cores or on a Dask cluster, and write a "
        "table of quality, errors and times. Columns are numbers of the motions, such as "
        "BLADE.translate.y or motion2.angle_deg, and keys of the case, such as STEPS; `--columns` "
        "lists them.",
        "exit codes: 0 done (also if cells are inverted or a design failed: see the table); 1 no "
        "design could be computed; 130 cancelled, 143 ended by SIGTERM: finished designs are in "
        "the table, and --resume continues",
    ),
    "convert": Command(
        "write a mesh in another format",
        (
            file("mesh", words="the mesh to read"),
            file("output", words="the mesh to write; its ending names the format"),
            value("--zone", int, "N", "one zone, from 1 (default: all)"),
            switch(
                "--stream",
                "for meshes larger than memory: from .su2 to .su2b or back, piece by piece",
            ),
        ),
        holds=True,
    ),
    "wheel": Command(
        "write the whole wheel of a passage",
        (
            CASE,
            file("-o --output", "MESH", "the wheel: .su2, or .su2b for large ones", required=True),
            value(
                "--passages",
                passages,
                "N",
                "their number; all for a whole turn (default); with commas one for each zone",
                default="all",
            ),
            switch("--numbered", "boundaries of their own for each passage: blade_1, blade_2"),
            file(
                "--designs",
                "TABLE",
                "motions of passages (CSV, see `slideviz sweep`): one row for each passage from "
                "the first on; the others move as the case says",
            ),
            *CHANGES,
            JSON,
            ZONE,
            QUIET,
        ),
        "Deform a passage as a case says, and write the wheel that its copies make, turned about "
        "the axis and merged at the periodic boundaries. Without motions the passages are "
        "undeformed.",
        holds=True,
    ),
    "def": Command(
        "deform as a configuration of SU2 says, like SU2_DEF", (*CONFIG, JSON, FORCE), holds=True
    ),
    "dot": Command(
        "gradients for SU2's design variables, like SU2_DOT_AD", (*CONFIG, JSON), holds=True
    ),
    "sample": Command(
        "write a sample case",
        (
            argument("name", "name of the sample; without it, list all", nargs="?"),
            file("-o --output", "DIR", "folder (default: NAME)"),
            value("--size", integer, "N", "size; the list says what it counts"),
            argument(
                "--format",
                "of the mesh; su2b (binary) for up to 200 million cells (default: su2)",
                type=str.lower,
                choices=tuple(FILE_FORMATS),
                default="su2",
            ),
            argument("--variant", "other motions; listed without NAME", metavar="NAME"),
            REPLACE,
            QUIET,
        ),
    ),
    "keys": Command("reference of all case keys"),
}
"""The commands, in the order of the help."""
