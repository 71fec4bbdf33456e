"""All enumerations: their values, with labels, tips and colors.

Values are those of case files and of the command line. For each enumeration there is a type, such
as ``Sliding``, and a table with the words for its values, such as ``SLIDING``. All lists, checks,
options, legends and tips are made from the tables. This module imports no other module of slideviz
and no heavy library.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Literal, get_args


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

# Files -------------------------------------------------------------------------------------

FileFormat = Literal["su2", "su2b"]
"""The formats of SU2, by ending, which MESH_FORMAT has in capitals."""


# Boundaries --------------------------------------------------------------------------------

Role = Literal["moving", "fixed", "sliding", "periodic", "internal"]


@dataclass(frozen=True)
class RoleTerm(Term):
    """The words for a role; ``key`` is the key of a case file that lists its boundaries."""

    key: str = ""


ROLES: dict[Role, RoleTerm] = {
    "moving": RoleTerm(
        "moving", "is moved by the motions you list", PALETTE["vermilion"], key="MARKER_MOVING"
    ),
    "fixed": RoleTerm("fixed", "stays where it is", "#7d8793", key="MARKER_FIXED"),
    "sliding": RoleTerm(
        "sliding", "its nodes slide along the surface", PALETTE["blue"], key="MARKER_SLIDING"
    ),
    "periodic": RoleTerm(
        "periodic", "repeats another boundary", PALETTE["green"], key="MARKER_PERIODIC"
    ),
    "internal": RoleTerm(
        "internal",
        "its nodes move freely with the cells inside",
        PALETTE["purple"],
        key="MARKER_INTERNAL",
    ),
}
"""The roles of boundaries; fixed ones are grey, others have colors of the palette."""

NodeType = Literal[
    "moving", "fixed", "sliding_surface", "sliding_edge", "periodic", "internal", "control"
]
NODE_TYPES: dict[NodeType, Term] = {
    "moving": Term("moving", color=ROLES["moving"].color),
    "fixed": Term("fixed", color=ROLES["fixed"].color),
    "sliding_surface": Term("sliding face", color=ROLES["sliding"].color),
    "sliding_edge": Term("sliding edge", color=PALETTE["sky blue"]),
    "periodic": Term("periodic", color=ROLES["periodic"].color),
    "internal": Term("internal", color=ROLES["internal"].color),
    "control": Term("control", color="#d81b60"),
}
"""The types of boundary nodes in the view: as the roles, with sliding edges and control nodes."""

SpanKind = Literal["twist", "stagger", "lean", "sweep", "chord", "camber"]


@dataclass(frozen=True)
class SpanTerm(Term):
    """Words for what a curve over the span changes; where it is ``neutral``, nothing changes."""

    unit: str = ""
    neutral: float = 0.0


SPAN_KINDS: dict[SpanKind, SpanTerm] = {
    "twist": SpanTerm(
        "twist", "Turns sections about the stacking line, from m towards growing θ.", unit="°"
    ),
    "stagger": SpanTerm("stagger", "Turns all sections by one angle.", unit="°"),
    "lean": SpanTerm("lean", "Shifts sections along θ, by a length.", unit="length"),
    "sweep": SpanTerm("sweep", "Shifts sections along m, by a length.", unit="length"),
    "chord": SpanTerm(
        "chord", "Scales sections about the stacking line.", unit="factor", neutral=1.0
    ),
    "camber": SpanTerm(
        "camber", "Bends sections towards growing θ, by a part of their chord.", unit="part"
    ),
}
"""What motions of a blade change over the span; verbs of ``MOTION``."""

Side = Literal["upper", "lower"]
SIDES: dict[Side, Term] = {
    "upper": Term("upper", "Where the normal into the flow points towards +y."),
    "lower": Term("lower", "Where the normal into the flow points towards -y."),
}
"""The sides of an airfoil."""

FfdBlending = Literal["BEZIER", "BSPLINE_UNIFORM"]
FFD_BLENDINGS: dict[FfdBlending, Term] = {
    "BEZIER": Term("Bézier"),
    "BSPLINE_UNIFORM": Term("uniform B-spline"),
}
"""The basis functions by which control points of an FFD box move the nodes inside."""

FfdSystem = Literal["CARTESIAN", "CYLINDRICAL", "SPHERICAL", "POLAR"]
FFD_SYSTEMS: dict[FfdSystem, Term] = {
    "CARTESIAN": Term("Cartesian"),
    "CYLINDRICAL": Term("cylindrical"),
    "SPHERICAL": Term("spherical"),
    "POLAR": Term("polar"),
}
"""The coordinates in which an FFD box is straight: (r, θ, x) or (r, θ, φ) about an axis along x."""

# Method ------------------------------------------------------------------------------------

Sliding = Literal["none", "ps", "ds"]
SLIDING: dict[Sliding, Term] = {
    "none": Term(
        "none", "Nodes of sliding boundaries stay where they are.", standalone="no sliding"
    ),
    "ps": Term(
        "pseudo sliding",
        "Sliding nodes first move as inner nodes do. Then they are projected to their boundary: "
        "first on edges, then on surfaces.",
    ),
    "ds": Term(
        "direct sliding",
        "The system itself keeps nodes on their boundary. It has all components of the "
        "displacement at once, so it takes longer.",
    ),
}
SLIDES = " or ".join(value for value in SLIDING if value != "none")
"""The values of SLIDING_MODE with which nodes slide, for messages."""

Method = Literal["rbf", "idw", "elastic"]


@dataclass(frozen=True)
class MethodTerm(Term):
    """The words for a method; with ``slides_by`` as SLIDING_MODE it is compared with others."""

    slides_by: Sliding = "ps"


METHODS: dict[Method, MethodTerm] = {
    "rbf": MethodTerm("RBF interpolation"),
    "idw": MethodTerm("Inverse distance weighting", standalone="inverse distance"),
    "elastic": MethodTerm("Linear elasticity", standalone="linear elasticity", slides_by="ds"),
}


StiffnessType = Literal["SOLID_WALL_DISTANCE", "INVERSE_VOLUME", "CONSTANT_STIFFNESS"]
STIFFNESS_TYPES: dict[StiffnessType, Term] = {
    "SOLID_WALL_DISTANCE": Term("near walls", "One over the mean distance to the nearest wall."),
    "INVERSE_VOLUME": Term("small cells", "One over the volume of the cell."),
    "CONSTANT_STIFFNESS": Term("all alike", "The same for all cells."),
}
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


KERNELS: dict[str, KernelTerm] = {
    "wendland-c2": KernelTerm("CP C2"),
    "wendland-c0": KernelTerm("CP C0"),
    "wendland-c4": KernelTerm("CP C4"),
    "wendland-c6": KernelTerm("CP C6"),
    "ctps-c0": KernelTerm("CTPS C0"),
    "ctps-c1": KernelTerm("CTPS C1"),
    "ctps-c2a": KernelTerm("CTPS C2a"),
    "ctps-c2b": KernelTerm("CTPS C2b"),
    "thin-plate": KernelTerm("thin plate spline", compact=False, polynomial=True),
    "multiquadric": KernelTerm("multiquadric", compact=False, polynomial=True),
    "inverse-multiquadric": KernelTerm("inverse multiquadric", compact=False),
    "quadric": KernelTerm("quadric", compact=False, polynomial=True),
    "inverse-quadric": KernelTerm("inverse quadric", compact=False),
    "gaussian": KernelTerm("Gaussian", compact=False),
}
"""The radial functions of thesis Tables 2.1 and 2.2, with formulas in `slideviz.rbf.kernels`."""

Polynomial = Literal["auto", "no", "yes"]
POLYNOMIALS: dict[Polynomial, Term] = {
    "auto": Term("automatic", "Where the kernel needs it."),
    "no": Term("off", "Far from the boundary, compact kernels leave nodes where they are."),
    "yes": Term("on", "Motions that are linear in the coordinates are exact with any kernel."),
}
"""Whether sums of radial functions have a linear polynomial (thesis Eq. 2.1)."""

Selection = Literal["block", "double", "one"]
SELECTIONS: dict[Selection, Term] = {
    "block": Term("growing blocks"),
    "double": Term("two at a time"),
    "one": Term("one"),
}
"""How many control nodes data reduction adds in a cycle."""

DataReduction = Literal["AUTO", "NO", "YES"]
DATA_REDUCTIONS: dict[DataReduction, Term] = {
    "AUTO": Term(
        "automatic",
        "All boundary nodes if there are up to a few thousand; else as many as follow the motion "
        "to a thousandth of it.",
    ),
    "NO": Term(
        "off", "All boundary nodes are control nodes: exact, for up to a few thousand nodes."
    ),
    "YES": Term(
        "on", "As many boundary nodes as the tolerance needs; the remaining error is corrected."
    ),
}
"""Whether only some of the boundary nodes are control nodes."""

Relax = Literal["auto", "no", "yes"]
RELAXES: dict[Relax, Term] = {
    "auto": Term("automatic", "Relaxed, unless the mesh has more than a million cells."),
    "no": Term("off", "As the radial functions leave it."),
    "yes": Term("on", "Relaxed after the last step."),
}
"""Whether the mesh is relaxed after the last step."""

Rims = Literal["free", "slide"]
RIMS: dict[Rims, Term] = {
    "free": Term("go with the motion", "They may leave the wall; the run then warns."),
    "slide": Term("stay on walls", "They are put back on the wall, and neighbouring nodes follow."),
}
"""What nodes of moving boundaries do that are also on walls."""

Repair = Literal["auto", "no", "yes"]
REPAIRS: dict[Repair, Term] = {
    "auto": Term("automatic", "Mended where cells are bad."),
    "no": Term("off", "Cells stay as the method leaves them."),
    "yes": Term("on", "Mended where cells are bad, like automatic."),
}
"""Whether inverted and poor cells are mended."""

RepairTarget = Literal["reference", "ideal"]
REPAIR_TARGETS: dict[RepairTarget, Term] = {
    "reference": Term("undeformed shapes"),
    "ideal": Term("ideal shapes in the local size"),
}
"""The shapes that mended cells shall have."""

Layers = Literal["auto", "no", "keep"]
LAYERS: dict[Layers, Term] = {
    "auto": Term("automatic", "Walls with boundary layers carry these along; other walls do not."),
    "no": Term("off", "Boundary layers follow like all other nodes."),
    "keep": Term("at all walls", "All moving and fixed boundaries carry nodes near them along."),
}
"""Whether nodes near walls go with the walls' own displacement and rotation."""

LevelCriterion = Literal["size", "tol"]
LEVEL_CRITERIA: dict[LevelCriterion, Term] = {
    "size": Term("by size"),
    "tol": Term("by fall of the error"),
}
"""What ends a level of data reduction."""

# Periodicity -------------------------------------------------------------------------------

PeriodicMode = Literal["none", "periodic", "fixed", "moving"]
PERIODIC_MODES: dict[PeriodicMode, Term] = {
    "none": Term(
        "none",
        "Periodic boundaries are treated as sliding boundaries; distances are not periodic.",
        standalone="not periodic",
    ),
    "periodic": Term(
        "periodic distance",
        "Periodic boundaries are treated as sliding boundaries, and distances are periodic: a "
        "motion near one side also acts near the other side.",
    ),
    "fixed": Term(
        "periodic, fixed vertices",
        "Both periodic boundaries move freely and in the same way; the corners of the domain are "
        "fixed.",
    ),
    "moving": Term(
        "periodic, moving vertices",
        "Both periodic boundaries move freely and in the same way; the corners of the domain "
        "slide in the periodic direction. Needs a sliding method.",
    ),
}

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
SKEW_METRICS: dict[SkewMetric, Term] = {"knupp": Term("Knupp"), "rbf-slide": Term("as RBF-SliDe")}

CellState = Literal["valid", "inverted", "unproven"]
CELL_STATES: tuple[CellState, ...] = ("valid", "inverted", "unproven")
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
ColorBy = Literal["role", Quantity]


@dataclass(frozen=True)
class ColorByTerm(Term):
    """The words for a quantity that cells are colored by; ``unit`` is empty if it has none."""

    unit: str = ""

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


FARTHEST = 10.0  # largest safe fraction of a motion that is looked for

METRICS: dict[Metric, MetricTerm] = {
    "size-skew": MetricTerm("size-skew", "Knupp's: √size · skew. 1 is best."),
    "size": MetricTerm(
        "size", "The cell's size over its undeformed size, or the inverse if larger than 1."
    ),
    "skew": MetricTerm(
        "skew", "How near its corners are to the corners of the ideal cell. 1 is best."
    ),
    "orthogonality": MetricTerm(
        "orthogonality (SU2)",
        "Of the edges at a node and the faces of its control volume, as SU2 prints it. 90 is best.",
        unit="[°]",
        range=(-90.0, 90.0),
        limit=20.0,
        where="nodes",
        alone=False,
        colors=(0.0, 90.0),
    ),
    "area-ratio": MetricTerm(
        "face area ratio (SU2)",
        "Largest over smallest face of a node's control volume, as SU2 prints it. 1 is best.",
        range=(1.0, inf),
        best="low",
        where="nodes",
        alone=False,
    ),
    "volume-ratio": MetricTerm(
        "sub-volume ratio (SU2)",
        "Largest over smallest part of a node's control volume, as SU2 prints it. 1 is best.",
        range=(1.0, inf),
        best="low",
        where="nodes",
        alone=False,
    ),
    "non-orthogonality": MetricTerm(
        "non-orthogonality (OpenFOAM)",
        "Angle between a face and the line from cell to cell, the cell's worst. 0 is best.",
        unit="[°]",
        range=(0.0, 180.0),
        best="low",
        limit=70.0,
        alone=False,
        colors=(0.0, 90.0),
    ),
    "skewness": MetricTerm(
        "skewness (OpenFOAM)",
        "How far the line from cell to cell passes the face's center, the cell's worst. 0 is best.",
        range=(0.0, inf),
        best="low",
        limit=4.0,
        alone=False,
        colors=(0.0, 4.0),
    ),
    "expansion": MetricTerm(
        "expansion",
        "Largest ratio of the volumes of the cell and a neighbor. 1 is best.",
        range=(1.0, inf),
        best="low",
        limit=20.0,
        alone=False,
    ),
    "scaled-jacobian": MetricTerm(
        "scaled Jacobian",
        "The least, over the corners, of the Jacobian over the edges' lengths. 1 is best.",
        range=(-1.0, 1.0),
        limit=0.0,
        colors=(0.0, 1.0),
    ),
    "equiangle-skew": MetricTerm(
        "equiangle skew",
        "How far the angles of the cell's faces are from 60° or 90°. 0 is best.",
        best="low",
        limit=0.95,
    ),
    "smallest-angle": MetricTerm(
        "smallest angle",
        "The smallest angle between two edges of a face of the cell.",
        unit="[°]",
        range=(0.0, 90.0),
        limit=15.0,
    ),
    "largest-angle": MetricTerm(
        "largest angle",
        "The largest angle between two edges of a face of the cell.",
        unit="[°]",
        range=(60.0, 360.0),
        best="low",
        limit=165.0,
        colors=(60.0, 180.0),
    ),
    "aspect-ratio": MetricTerm(
        "aspect ratio", "Longest over shortest edge of the cell.", range=(1.0, inf), best="low"
    ),
    "straight-margin": MetricTerm(
        "margin on the straight line",
        "How many times as far its nodes may go on straight lines from the undeformed mesh, until "
        "it folds.",
        range=(0.0, FARTHEST),
        limit=1.0,
        compares=True,
        colors=(0.0, 2.0),
    ),
}
"""The metrics: numbers that rate cells or nodes. `slideviz.mesh.metrics` computes them."""

SIZE_SKEW: tuple[Metric, ...] = ("size-skew", "size", "skew")
"""Those of `slideviz.mesh.quality`: 0 to 1, relative to the undeformed cell."""

WALL_VALUES: dict[WallValue, MetricTerm] = {
    "first-height": MetricTerm(
        "first height", "Distance of the first node from the wall.", unit="[mesh units]"
    ),
    "height-ratio": MetricTerm(
        "height ratio", "First height after over before. 1 is best.", compares=True
    ),
    "growth": MetricTerm(
        "growth", "Largest ratio of two successive edges that leave the wall.", best="low"
    ),
    "equal-layers": MetricTerm("equal layers", "Number of first edges that are equal within 1 %."),
    "wall-angle": MetricTerm(
        "wall angle", "Angle of the first edge to the wall. 90 is best.", unit="[°]"
    ),
    "angle-change": MetricTerm(
        "angle change",
        "Change of the angle of the first edge.",
        unit="[°]",
        best="low",
        compares=True,
    ),
}
"""The numbers of `slideviz.mesh.walls`: values of the cells at walls with layers, or at all walls
where none has; other cells have none. They have no usual range."""

RATED: dict[Quantity, MetricTerm] = dict(METRICS.items())
"""The quantities of which one end is better."""
RATED.update(WALL_VALUES.items())
QUANTITIES: dict[Quantity, ColorByTerm] = dict(RATED.items())
"""The quantities that are values of cells; the first is the default."""
QUANTITIES["displacement"] = ColorByTerm("displacement", unit="[mesh units]")
COLOR_BY: dict[ColorBy, ColorByTerm] = {"role": ColorByTerm("role")}
"""The quantities to color by; a mesh just opened has the first."""
COLOR_BY.update(QUANTITIES.items())


def quantity_of(color_by: ColorBy) -> Quantity:
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
POINTS_SHOWN: dict[PointsShown, Term] = {
    "none": Term("none"),
    "types": Term("boundary nodes by type"),
    "control": Term("control nodes"),
}

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
    needs: Literal["", "boxes", "3d"] = ""  # what it needs: nothing, FFD boxes, or a 3D mesh
    why_not: str = ""  # the tip where this is missing
    in_bar: bool = True  # whether the tool bar has a button for it


SHOWN: dict[Shown, ShownTerm] = {
    "edges": ShownTerm("Mesh edges", "Draw the edges of the cells.", shortcut="E", at_first=True),
    "undeformed": ShownTerm(
        "Undeformed",
        "Draw the undeformed boundaries as a ghost; in a flat view, the outline of the undeformed "
        "section.",
        standalone="Undeformed boundaries",
        shortcut="U",
    ),
    "motion_ghost": ShownTerm(
        "Motion ghost",
        "Draw where the motions take the moving boundaries.",
        shortcut="G",
        at_first=True,
    ),
    "legend": ShownTerm(
        "Legend", "Draw the legend of roles or the color bar.", shortcut="L", at_first=True
    ),
    "triad": ShownTerm(
        "Axes",
        "Draw the directions of the axes in a corner.",
        shortcut="T",
        at_first=True,
        in_bar=False,
    ),
    "inverted": ShownTerm(
        "Inverted cells",
        "Mark inverted cells with rings of the same size at any zoom, in front of everything.",
        standalone="Rings at inverted cells",
        shortcut="I",
        at_first=True,
        in_bar=False,
    ),
    "repaired": ShownTerm(
        "Repaired cells",
        "Draw mended cells as they were before repair (ghost), and the nodes that repair moved "
        "(dots).",
        standalone="Repaired cells as they were",
        shortcut="M",
        in_bar=False,
    ),
    "ffd": ShownTerm(
        "FFD boxes",
        "Draw the control points of the boxes for free-form deformation.",
        shortcut="B",
        needs="boxes",
        why_not="There are no boxes: neither in the mesh file nor in the case (FFD_DEFINITION).",
        in_bar=False,
    ),
    "support": ShownTerm(
        "Support radius",
        "Draw how far the radial functions of the moving boundaries reach with the present "
        "settings: a circle or sphere around each of them. A comparison shows the circles of each "
        "run.",
        shortcut="D",
        in_bar=False,
    ),
    "perspective": ShownTerm(
        "Perspective",
        "Perspective instead of parallel projection (3D meshes).",
        shortcut="P",
        needs="3d",
        why_not="A 2D mesh is always shown in parallel projection.",
    ),
}
"""Things in the view that can be switched on and off; VIEW_SHOW has them with hyphens."""
