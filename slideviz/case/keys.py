"""All keys of a case file, one row each: the table reads, checks, writes and explains them.

The rows are applied in the order of the table, whatever their order in the file.
"""

from __future__ import annotations

from dataclasses import replace

from slideviz.case.key import (
    BOUNDARIES,
    FILES,
    METHOD,
    MOTION,
    PERIODICITY,
    QUALITY,
    REDUCTION,
    Key,
    get_direction,
    get_file,
    get_motions,
    greedy,
    put_boundaries,
    put_direction,
    put_double_edge,
    put_file,
    put_motions,
    put_reduction,
    role,
    setting,
)
from slideviz.case.motion_text import MOTIONS
from slideviz.case.values import (
    AXIS,
    NAMES,
    PAIRS,
    PATH,
    POINT,
    YES_NO,
    choice,
    real,
    steps_kind,
    whole,
)
from slideviz.case.view_keys import VIEW_ROWS
from slideviz.terms import (
    KERNELS,
    LEVEL_CRITERIA,
    METHODS,
    METRICS,
    PERIODIC_DIRECTIONS,
    PERIODIC_MODES,
    PERIODIC_TYPES,
    SELECTIONS,
    SLIDING,
)

_ROWS = (
    setting("MESH_FILENAME", FILES, PATH, "mesh_file", "The mesh to deform."),
    setting("MESH_OUT_FILENAME", FILES, PATH, "mesh_out", "Where the deformed mesh is written."),
    setting("ZONE", FILES, whole(1), "zone", "The zone to deform, from 1, of a mesh with several."),
    role("MARKER_MOVING", NAMES, "moving", "Boundaries whose displacement is prescribed."),
    role("MARKER_FIXED", NAMES, "fixed", "Boundaries that stay; so do those in no list."),
    role("MARKER_SLIDING", NAMES, "sliding", "Boundaries along which their nodes may slide."),
    role("MARKER_PERIODIC", PAIRS, "periodic", "Boundaries that repeat, in pairs of any order."),
    role(
        "MARKER_INTERNAL",
        NAMES,
        "internal",
        "Boundaries treated as inner nodes: they move freely, only their rim is kept in place.",
    ),
    Key(
        "MARKER_BDRY",
        BOUNDARIES,
        NAMES,
        "All boundaries; those in no other list slide (with SLIDING_MODE= none they stay).",
        put_boundaries,
        lambda _: None,
    ),
    Key(
        "DEFORMATION_FILENAME",
        MOTION,
        PATH,
        "Displacements of the moving nodes: node, dx, dy[, dz] in each line; the others stay.",
        put_file,
        get_file,
    ),
    Key(
        "MOTION",
        MOTION,
        MOTIONS,
        "What the moving boundaries do, one after the other, after DEFORMATION_FILENAME.",
        put_motions,
        get_motions,
    ),
    setting(
        "PERIODIC_MODE",
        PERIODICITY,
        choice({word: word for word in PERIODIC_MODES}),
        "periodic",
        "How boundaries repeat: not, in the distance only, or also in the displacement with "
        "fixed or moving vertices.",
    ),
    setting(
        "PERIODIC_TYPE",
        PERIODICITY,
        choice({word: word for word in PERIODIC_TYPES} | {"0": "translational", "1": "rotational"}),
        "periodic_type",
        "Shift (0) or rotation (1); auto finds out by matching the markers.",
    ),
    Key(
        "PERIODIC_DIRECTION",
        PERIODICITY,
        choice({word: word for word in PERIODIC_DIRECTIONS}),
        "Without effect, but that x, y, r and theta imply PERIODIC_TYPE: the direction (0, 1, 2 "
        "for x, y, z or r, theta, z) is found by matching the markers.",
        put_direction,
        get_direction,
    ),
    setting("PERIODIC_AXIS", PERIODICITY, AXIS, "axis", "Axis of rotational periodicity."),
    setting("PERIODIC_ORIGIN", PERIODICITY, POINT, "origin", "A point on that axis."),
    setting(
        "METHOD",
        METHOD,
        choice({word: word for word in METHODS}),
        "method",
        "Radial basis functions, or to compare with them: inverse distance weighting, or linear "
        "elasticity with cells that are the stiffer the smaller they are (as SU2 by default). "
        "With both, ps and ds do the same, and kernel, radius and data reduction nothing.",
    ),
    setting(
        "SLIDING_MODE",
        METHOD,
        choice({word: word for word in SLIDING}),
        "sliding",
        "How nodes slide: not, pseudo sliding (ps) or direct sliding (ds).",
    ),
    setting(
        "STEPS",
        METHOD,
        steps_kind(),
        "steps",
        "Steps in which the deformation is applied; auto tries 1, 2, 3, 5, 8, 13, 21 and 34, "
        "halves steps that fold a cell, and takes the fewest that are enough.",
    ),
    setting(
        "STEPS_GAIN",
        METHOD,
        real(0.0, 1.0),
        "steps_gain",
        "With STEPS= auto, enough is when more steps raise the minimum quality by less than "
        "this part.",
    ),
    setting(
        "INFLUENCE_FACTOR",
        METHOD,
        real(1e-6, 1e6),
        "influence_factor",
        "Support radius of the radial function over the largest extent of the mesh.",
    ),
    setting(
        "RBF_KERNEL",
        METHOD,
        replace(
            choice({name: name for name in KERNELS}),
            allowed="one of the names below",
            details=tuple(f"{name:<22}{term.label}" for name, term in KERNELS.items()),
        ),
        "kernel",
        "The radial function; those without compact support need a smaller INFLUENCE_FACTOR.",
    ),
    setting(
        "IDW_POWER",
        METHOD,
        real(0.0, 20.0, closed=True),
        "idw_power",
        "With METHOD= idw, the power of the inverse distance; the number of dimensions if not "
        "given.",
    ),
    setting(
        "IDW_FIXED_WEIGHT",
        METHOD,
        real(1e-12, 1e12),
        "idw_fixed_weight",
        "With METHOD= idw, what a boundary node that stays counts, where one that moves counts 1.",
    ),
    setting(
        "CURVED",
        METHOD,
        YES_NO,
        "curved",
        "Without effect: curved boundaries, RBF-SliDe's switch, are found and followed anyway.",
    ),
    setting(
        "FEATURE_ANGLE",
        METHOD,
        real(0.0, 180.0, closed=True),
        "feature_angle_deg",
        "Angle in degrees from which a bend within a boundary is an edge.",
    ),
    Key(
        "DATA_REDUCTION",
        REDUCTION,
        YES_NO,
        "Interpolate with some of the boundary nodes only; without it the keys below do nothing.",
        put_reduction,
        lambda case: case.reduction is not None,
        "NO",
    ),
    greedy(
        "DATA_RED_TOLERANCE",
        real(0.0),
        "tolerance",
        "Largest error left before the boundary is corrected, over all steps, in the mesh's unit.",
    ),
    greedy(
        "DATA_RED_RELATIVE",
        real(0.0),
        "relative",
        "The tolerance as a part of the mesh's largest extent, instead of DATA_RED_TOLERANCE.",
    ),
    greedy("MULTILEVEL", YES_NO, "multilevel", "Select the control nodes in levels."),
    greedy(
        "MULTI_CRIT",
        choice({word: word for word in LEVEL_CRITERIA}),
        "criterion",
        "What ends a level: its number of nodes, or the fall of its error.",
    ),
    greedy(
        "LVL_TOL_CRIT", real(0.0, 1.0), "level_tolerance", "Fall of the error that ends a level."
    ),
    greedy("LVL_SIZE", whole(1), "level_size", "Number of control nodes of a level."),
    Key(
        "DOUBLE_EDGE",
        REDUCTION,
        YES_NO,
        "Select two nodes at a time, with opposite errors (YES), or one (NO); SELECTION says it "
        "better.",
        put_double_edge,
        lambda _: None,
    ),
    greedy(
        "SELECTION",
        choice({word: word for word in SELECTIONS}),
        "selection",
        "Nodes taken in a cycle: a growing block (fastest), two with opposite errors, or one.",
    ),
    greedy(
        "MAX_CONTROL_NODES", whole(1), "max_nodes", "Stop at so many control nodes in any case."
    ),
    greedy("GAMMA", real(0.0), "gamma", "Radius of the correction over the largest error."),
    setting(
        "GENERATE_QUALITY",
        QUALITY,
        YES_NO,
        "generate_quality",
        "Write the quality of the deformed mesh too.",
    ),
    setting(
        "QUALITY_METRIC",
        QUALITY,
        choice({word: word for word in METRICS}),
        "quality_metric",
        "Size-skew as published, or as RBF-SliDe computes it (differs for hexahedra).",
    ),
    *VIEW_ROWS,
)
_OURS = {
    "ZONE",
    "MARKER_FIXED",
    "MARKER_SLIDING",
    "MOTION",
    "PERIODIC_AXIS",
    "PERIODIC_ORIGIN",
    "FEATURE_ANGLE",
    "QUALITY_METRIC",
    "RBF_KERNEL",
    "STEPS_GAIN",
    "SELECTION",
    "MAX_CONTROL_NODES",
    "DATA_RED_RELATIVE",
    "METHOD",
    "IDW_POWER",
    "IDW_FIXED_WEIGHT",
}

KEYS: dict[str, Key] = {
    row.name: replace(row, rbf_slide=row.rbf_slide and row.name not in _OURS) for row in _ROWS
}
