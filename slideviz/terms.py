"""All enumerations: their values, with labels, tips and colors.

Values are those of case files and of the command line. For each enumeration there is a type, such
as ``Sliding``, and a table with the words for its values, such as ``SLIDING``, whose rows are in
``terms.toml``. All lists, checks, options, legends and tips are made from them. This module imports
no other module of slideviz and no heavy library.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args


@dataclass(frozen=True)
class Term:
    """The words for one value of an enumeration."""

    label: str  # its words in a list with a heading
    tip: str = ""  # its meaning, as a tip
    color: str = ""  # the color it is drawn in, ``#rrggbb``; empty for none
    standalone: str = ""  # its words without a heading, where they differ from ``label``

    @property
    def name(self) -> str:
        """Return the words for the value without a heading."""
        return self.standalone or self.label


def labels(terms: Mapping[Any, Term]) -> dict[str, str]:
    """Return the label of each value."""
    return {value: term.label for value, term in terms.items()}


def names(terms: Mapping[Any, Term]) -> dict[str, str]:
    """Return the words for each value without a heading."""
    return {value: term.name for value, term in terms.items()}


def tips(terms: Mapping[Any, Term]) -> dict[str, str]:
    """Return the tip of each value that has one."""
    return {value: term.tip for value, term in terms.items() if term.tip}


PALETTE = {
    "orange": "#e69f00",
    "sky blue": "#56b4e9",
    "green": "#009e73",
    "yellow": "#f0e442",
    "blue": "#0072b2",
    "vermilion": "#d55e00",
    "purple": "#cc79a7",
    "black": "#000000",
}
"""Okabe and Ito's colors (2008), which color-blind people can distinguish."""

Texts = tuple[str, ...]
Numbers = tuple[float, ...]
WholeNumbers = tuple[int, ...]
Range = tuple[float, float]  # the lowest and the highest number

_ROWS = tomllib.loads(Path(__file__).with_name("terms.toml").read_text(encoding="utf-8"))

Kind = TypeVar("Kind", bound=Term)


def _table(name: str, kind: type[Kind]) -> dict[Any, Kind]:
    """Return a table of ``terms.toml``; colors have names of the palette, or are ``#rrggbb``."""
    table = {}
    for value, row in _ROWS[name].items():
        facts: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}
        if "color" in facts:
            facts["color"] = PALETTE.get(facts["color"], facts["color"])
        table[value] = kind(**facts)
    return table


# Files -------------------------------------------------------------------------------------

FileFormat = Literal["su2", "su2b"]
"""The formats of SU2, by ending, which MESH_FORMAT has in capitals."""
FILE_FORMATS: dict[FileFormat, Term] = _table("FILE_FORMATS", Term)


# Boundaries --------------------------------------------------------------------------------

Role = Literal["moving", "fixed", "sliding", "periodic", "internal"]


@dataclass(frozen=True)
class RoleTerm(Term):
    """The words for a role; ``key`` is the key of a case file that lists its boundaries."""

    key: str = ""


ROLES: dict[Role, RoleTerm] = _table("ROLES", RoleTerm)
"""The roles of boundaries; fixed ones are grey, others have colors of the palette."""

NodeType = Literal[
    "moving", "fixed", "sliding_surface", "sliding_edge", "periodic", "internal", "control"
]
NODE_TYPES: dict[NodeType, Term] = _table("NODE_TYPES", Term)
"""The types of boundary nodes in the view: as the roles, with sliding edges and control nodes."""

SpanKind = Literal["twist", "stagger", "lean", "sweep", "chord", "camber"]


@dataclass(frozen=True)
class SpanTerm(Term):
    """Words for what a curve over the span changes; where it is ``neutral``, nothing changes."""

    unit: str = ""
    neutral: float = 0.0


SPAN_KINDS: dict[SpanKind, SpanTerm] = _table("SPAN_KINDS", SpanTerm)
"""What motions of a blade change over the span; verbs of ``MOTION``."""

Side = Literal["upper", "lower"]
SIDES: dict[Side, Term] = _table("SIDES", Term)
"""The sides of an airfoil."""

FfdBlending = Literal["BEZIER", "BSPLINE_UNIFORM"]
FFD_BLENDINGS: dict[FfdBlending, Term] = _table("FFD_BLENDINGS", Term)
"""The basis functions by which control points of an FFD box move the nodes inside."""

FfdSystem = Literal["CARTESIAN", "CYLINDRICAL", "SPHERICAL", "POLAR"]
FFD_SYSTEMS: dict[FfdSystem, Term] = _table("FFD_SYSTEMS", Term)
"""The coordinates in which an FFD box is straight: (r, θ, x) or (r, θ, φ) about an axis along x."""

# Method ------------------------------------------------------------------------------------

Sliding = Literal["none", "ps", "ds"]
SLIDING: dict[Sliding, Term] = _table("SLIDING", Term)
SLIDES = " or ".join(value for value in SLIDING if value != "none")
"""The values of SLIDING_MODE with which nodes slide, for messages."""

Method = Literal["rbf", "idw", "elastic"]


@dataclass(frozen=True)
class MethodTerm(Term):
    """The words for a method; with ``slides_by`` as SLIDING_MODE it is compared with others."""

    slides_by: Sliding = "ps"


METHODS: dict[Method, MethodTerm] = _table("METHODS", MethodTerm)


StiffnessType = Literal["SOLID_WALL_DISTANCE", "INVERSE_VOLUME", "CONSTANT_STIFFNESS"]
STIFFNESS_TYPES: dict[StiffnessType, Term] = _table("STIFFNESS_TYPES", Term)
"""Which cells of an elastic body are stiff: how Young's modulus is found."""
NOT_WALLS = ("far", "freestream", "inflow", "inlet", "outflow", "outlet", "exit", "sym")
"""Words in names of fixed boundaries that are not walls, for the distance to these."""


@dataclass(frozen=True)
class KernelTerm(Term):
    """The words for a radial function.

    ``compact`` is whether it has compact support, ``polynomial`` whether it needs the polynomial.
    """

    compact: bool = True
    polynomial: bool = False

    @property
    def name(self) -> str:
        """Return the label, with "compact" or "global" in brackets."""
        return f"{self.label} ({'compact' if self.compact else 'global'})"


KERNELS: dict[str, KernelTerm] = _table("KERNELS", KernelTerm)
"""The radial functions of thesis Tables 2.1 and 2.2, with formulas in `slideviz.rbf.kernels`."""

Device = Literal["auto", "cpu", "gpu"]
DEVICES: dict[Device, Term] = _table("DEVICES", Term)
"""Where sums of radial functions and their systems are computed."""

Polynomial = Literal["auto", "no", "yes"]
POLYNOMIALS: dict[Polynomial, Term] = _table("POLYNOMIALS", Term)
"""Whether sums of radial functions have a linear polynomial (thesis Eq. 2.1)."""

Selection = Literal["block", "double", "one"]
SELECTIONS: dict[Selection, Term] = _table("SELECTIONS", Term)
"""How many control nodes data reduction adds in a cycle."""

DataReduction = Literal["AUTO", "NO", "YES"]
DATA_REDUCTIONS: dict[DataReduction, Term] = _table("DATA_REDUCTIONS", Term)
"""Whether only some of the boundary nodes are control nodes."""

Relax = Literal["auto", "no", "yes"]
RELAXES: dict[Relax, Term] = _table("RELAXES", Term)
"""Whether the mesh is relaxed after the last step."""

Rims = Literal["free", "slide"]
RIMS: dict[Rims, Term] = _table("RIMS", Term)
"""What nodes of moving boundaries do that are also on walls."""

Repair = Literal["auto", "no", "yes"]
REPAIRS: dict[Repair, Term] = _table("REPAIRS", Term)
"""Whether inverted and poor cells are mended."""

RepairTarget = Literal["reference", "ideal"]
REPAIR_TARGETS: dict[RepairTarget, Term] = _table("REPAIR_TARGETS", Term)
"""The shapes that mended cells shall have."""

Layers = Literal["auto", "no", "keep"]
LAYERS: dict[Layers, Term] = _table("LAYERS", Term)
"""Whether nodes near walls go with the walls' own displacement and rotation."""

LevelCriterion = Literal["size", "tol"]
LEVEL_CRITERIA: dict[LevelCriterion, Term] = _table("LEVEL_CRITERIA", Term)
"""What ends a level of data reduction."""

PHASES: dict[str, Term] = _table("PHASES", Term)
"""The phases of a run, which ``Progress.phase`` names."""

# Periodicity -------------------------------------------------------------------------------

PeriodicMode = Literal["none", "periodic", "fixed", "moving"]
PERIODIC_MODES: dict[PeriodicMode, Term] = _table("PERIODIC_MODES", Term)

Vector = tuple[float, float, float]
AXES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
"""The directions that can be given by a letter."""

PeriodicKind = Literal["translational", "rotational"]
PeriodicType = Literal["auto", "translational", "rotational"]
PERIODIC_TYPES: dict[PeriodicType, Term] = {
    "auto": Term("automatic"),
    **{kind: Term(kind) for kind in get_args(PeriodicKind)},
}

PERIODIC_DIRECTIONS: dict[str, tuple[int, PeriodicKind | None]] = {
    "0": (0, None),
    "1": (1, None),
    "2": (2, None),
    "x": (0, "translational"),
    "y": (1, "translational"),
    "z": (2, None),
    "r": (0, "rotational"),
    "theta": (1, "rotational"),
}
"""Values of PERIODIC_DIRECTION: number of the component, and the type of periodicity implied."""

# Quality -----------------------------------------------------------------------------------

SkewMetric = Literal["knupp", "rbf-slide"]
SKEW_METRICS: dict[SkewMetric, Term] = _table("SKEW_METRICS", Term)

CellState = Literal["valid", "inverted", "unproven"]
CELL_STATES: tuple[CellState, ...] = get_args(CellState)
"""The states of cells: the place of each is its code in `slideviz.mesh.quality.Quality.status`."""

NO_REFERENCE = "no reference: relative to itself"
"""The remark, in pictures too, where there is no undeformed mesh to compare cells with: size is
rated 1 then."""

# Metrics and other quantities ----------------------------------------------------------------

Metric = Literal[
    "size-skew",
    "size",
    "skew",
    "orthogonality",
    "area-ratio",
    "volume-ratio",
    "non-orthogonality",
    "skewness",
    "expansion",
    "scaled-jacobian",
    "equiangle-skew",
    "smallest-angle",
    "largest-angle",
    "aspect-ratio",
    "straight-margin",
]
WallValue = Literal[
    "first-height", "height-ratio", "growth", "equal-layers", "wall-angle", "angle-change"
]
Quantity = Literal[Metric, WallValue, "displacement"]
Difference = Literal["run-distance", "quality-gain"]
ColorBy = Literal["role", Quantity, Difference]


@dataclass(frozen=True)
class ColorByTerm(Term):
    """The words for a quantity that cells are colored by; ``unit`` is empty if it has none.

    ``color_map`` is a diverging color map that it always has, with 0 in the middle; else empty.
    """

    unit: str = ""
    color_map: str = ""

    @property
    def axis(self) -> str:
        """Return the label of a plot's axis: label and unit, [-] without one."""
        return f"{self.label} {self.unit or '[-]'}"


@dataclass(frozen=True)
class MetricTerm(ColorByTerm):
    """The facts about a number that rates the cells or nodes of a mesh."""

    range: tuple[float, float] = (0.0, 1.0)  # the values that are possible
    best: Literal["high", "low"] = "high"  # which end of the range is good
    limit: float | None = None
    """The value beyond which solvers or their manuals call it poor; None where none is usual."""
    where: Literal["cells", "nodes"] = "cells"
    """Whether it belongs to cells, or to nodes: a cell then has the worst of its nodes."""
    alone: bool = True
    """Whether the nodes of a cell, deformed and undeformed, are enough to compute its value."""
    compares: bool = False  # whether there is none without the undeformed mesh
    colors: tuple[float, float] | None = None
    """The default ends of the color bar; None: those of ``range``, or of the mesh if infinite."""


METRICS: dict[Metric, MetricTerm] = _table("METRICS", MetricTerm)
"""The metrics: numbers that rate cells or nodes. `slideviz.mesh.metrics` computes them."""

FARTHEST = METRICS["straight-margin"].range[1]
"""The largest safe fraction of a motion that is looked for."""

SIZE_SKEW: tuple[Metric, ...] = ("size-skew", "size", "skew")
"""Those of `slideviz.mesh.quality`: 0 to 1, relative to the undeformed cell."""

WALL_VALUES: dict[WallValue, MetricTerm] = _table("WALL_VALUES", MetricTerm)
"""The numbers of `slideviz.mesh.walls`: values of the cells at walls with layers, or at all walls
where none has; other cells have none. They have no usual range."""

RATED: dict[Quantity, MetricTerm] = dict(METRICS.items())
"""The quantities of which one end is better."""
RATED.update(WALL_VALUES.items())
QUANTITIES: dict[Quantity, ColorByTerm] = dict(RATED.items())
"""The quantities that are values of cells; the first is the default."""
QUANTITIES["displacement"] = ColorByTerm("displacement", unit="[mesh units]")
DIFFERENCES: dict[Difference, MetricTerm] = _table("DIFFERENCES", MetricTerm)
"""What the cells of the runs in two views differ by."""
RANKED: dict[ColorBy, MetricTerm] = dict(RATED.items())
"""The values of cells of which one end is better, or of more interest."""
RANKED.update(DIFFERENCES.items())
CELL_VALUES: dict[ColorBy, ColorByTerm] = dict(QUANTITIES.items())
"""The values of cells."""
CELL_VALUES.update(DIFFERENCES.items())
COLOR_BY: dict[ColorBy, ColorByTerm] = {"role": ColorByTerm("role"), **CELL_VALUES}
"""The quantities to color by; a mesh just opened has the first."""


def quantity_of(color_by: ColorBy) -> ColorBy:
    """Return the quantity that is colored by, or size-skew for roles."""
    return "size-skew" if color_by == "role" else color_by


def field_of(metric: str) -> str:
    """Return the name of a metric in files, reports and limits: ``scaled_jacobian``."""
    return metric.replace("-", "_")


# View --------------------------------------------------------------------------------------

ColorMap = Literal["viridis", "cividis", "plasma", "inferno", "gray"]
COLOR_MAPS: dict[ColorMap, Term] = {name: Term(name) for name in get_args(ColorMap)}
"""Color maps of matplotlib that color-blind people can read; the first is the default."""

PointsShown = Literal["none", "types", "control"]
POINTS_SHOWN: dict[PointsShown, Term] = _table("POINTS_SHOWN", Term)

Shown = Literal[
    "edges",
    "undeformed",
    "motion_ghost",
    "legend",
    "triad",
    "inverted",
    "repaired",
    "ffd",
    "support",
    "perspective",
]


@dataclass(frozen=True)
class ShownTerm(Term):
    """The words for a thing in the view that the user can switch on and off."""

    shortcut: str = ""  # the key that switches it
    at_first: bool = False  # whether it is drawn by default
    needs: Literal["mesh", "boxes", "3d"] = "mesh"  # any mesh, FFD boxes, or a 3D mesh
    why_not: str = ""  # the tip where this is missing
    in_bar: bool = True  # whether the tool bar has a button for it


SHOWN: dict[Shown, ShownTerm] = _table("SHOWN", ShownTerm)
"""Things in the view that can be switched on and off; VIEW_SHOW has them with hyphens."""
