"""The table of all keys of a case file, by which they are read, checked, written and explained.

Values are put into a case in the order of the table, whatever their order in the file. Groups with
many keys have modules of their own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from slideviz.case.ffd_keys import FFD_ROWS
from slideviz.case.key import BOUNDARIES, FILES, MOTION, PERIODICITY, QUALITY, Key, role, setting
from slideviz.case.limits import LIMITS
from slideviz.case.method_keys import METHOD_ROWS, REDUCTION_ROWS
from slideviz.case.motion_text import MOTIONS
from slideviz.case.motions.file import FromFile
from slideviz.case.motions.motion import Motion
from slideviz.case.values import (
    AXIS,
    COUPLES,
    ENDS,
    NAMES,
    PAIRS,
    PATH,
    POINT,
    choice,
    integer,
    one_of,
)
from slideviz.case.view_keys import VIEW_ROWS
from slideviz.errors import CaseError
from slideviz.formats.table import FILE_FORMATS
from slideviz.terms import PERIODIC_DIRECTIONS, PERIODIC_TYPES

if TYPE_CHECKING:
    from slideviz.case.model import Case


def no_pair(case: Case) -> str:
    """Return why settings of periodicity have no effect in a case; "" where they have one."""
    return "" if "periodic" in case.roles.values() else "no boundary has the role “periodic”"


def _put_direction(case: Case, word: str) -> Case:
    direction, implied = PERIODIC_DIRECTIONS[word]
    if implied is not None and case.periodic_type not in ("auto", implied):
        raise CaseError(
            f"{word} is a direction of {implied} periodicity, and PERIODIC_TYPE= "
            f"{case.periodic_type}; change one of the two"
        )
    return case.change(direction=direction, periodic_type=implied or case.periodic_type)


_setting = partial(setting, PERIODICITY)
PERIODIC_ROWS = (
    _setting(
        "PERIODIC_MODE",
        "How boundaries are periodic: not at all, in the distance only, or also in the "
        "displacement with fixed or moving vertices.",
        field="periodic",
        label="Periodicity",
        form="main",
        tip="What the periodic boundaries do: nothing special (none), only the distance is "
        "periodic (periodic), or both sides deform in the same way, with the corners of the "
        "domain fixed (fixed vertices) or sliding (moving vertices).",
        run_label="",
        idle_reason=no_pair,
    ),
    _setting(
        "PERIODIC_TYPE",
        "Shift (0) or rotation (1); auto finds out by matching the markers.",
        one_of(PERIODIC_TYPES, {"0": "translational", "1": "rotational"}),
        label="Type",
        form="main",
        tip="Whether one side is the other one shifted or rotated; automatic takes the one that "
        "matches.",
        run_label="{} type",
        idle_reason=no_pair,
    ),
    Key(
        "PERIODIC_DIRECTION",
        PERIODICITY,
        choice({word: word for word in PERIODIC_DIRECTIONS}),
        "No effect, except that x, y, r and theta imply PERIODIC_TYPE: the direction (0, 1, 2 "
        "for x, y, z or r, theta, z) is found by matching the markers.",
        _put_direction,
        lambda case: None if case.direction is None else str(case.direction),
        field="direction",
        run_label="",
        no_effect="matching the periodic markers finds the direction",
    ),
    _setting(
        "PERIODIC_AXIS",
        "Axis of rotational periodicity.",
        AXIS,
        field="axis",
        label="Axis",
        form="main",
        tip="The axis that the mesh repeats about, for rotational periodicity.",
        idle_reason=no_pair,
    ),
    _setting(
        "PERIODIC_ORIGIN",
        "A point on that axis.",
        POINT,
        field="origin",
        label="Through",
        form="main",
        run_label="axis through {}",
        idle_reason=no_pair,
    ),
    _setting(
        "SPAN",
        "Hub and shroud, between which the span of a machine goes from 0 to 1. AUTO takes the "
        "boundaries whose names contain hub, and shroud or casing.",
        ENDS,
        label="Hub and shroud",
        run_label="span {}",
    ),
)


def _leading_file(case: Case) -> tuple[Motion, ...]:
    """Return the displacement file of all moving markers, if motions begin with one."""
    return tuple(motion for motion in case.motions[:1] if motion.is_case_file)


def _put_file(case: Case, path: Path | None) -> Case:
    files = () if path is None else (FromFile(path),)
    return case.change(motions=(*files, *case.motions[len(_leading_file(case)) :]))


_FORMAT = choice({term.label: value for value, term in FILE_FORMATS.items()})

_ROWS = (
    setting(FILES, "MESH_FILENAME", "The mesh to deform.", PATH, field="mesh_file"),
    setting(
        FILES, "MESH_OUT_FILENAME", "Where the deformed mesh is written.", PATH, field="mesh_out"
    ),
    setting(
        FILES,
        "MESH_FORMAT",
        "SU2's text or binary format; without this key, ending and content of the file decide.",
        _FORMAT,
    ),
    setting(
        FILES, "MESH_OUT_FORMAT", "SU2's text or binary, whatever the ending of the file.", _FORMAT
    ),
    setting(
        FILES,
        "ZONE",
        "The zone to deform alone, from 1, of a mesh with several; without it all.",
        integer(1),
    ),
    role("MARKER_MOVING", NAMES, "moving", "Boundaries whose displacement is prescribed."),
    role("MARKER_FIXED", NAMES, "fixed", "Boundaries that stay. Boundaries in no list stay, too."),
    role("MARKER_SLIDING", NAMES, "sliding", "Boundaries along which their nodes may slide."),
    role("MARKER_PERIODIC", PAIRS, "periodic", "Periodic boundaries, in pairs of any order."),
    role(
        "MARKER_INTERNAL",
        NAMES,
        "internal",
        "Boundaries treated as inner nodes: they move freely, only their rim is kept in place.",
    ),
    Key(
        "MARKER_ZONE_INTERFACE",
        BOUNDARIES,
        COUPLES,
        "Pairs of boundaries of two zones whose nodes stay together where they coincide. Without "
        "it all that coincide do.",
        lambda case, names: case.change(interfaces=names),
        lambda case: case.interfaces or None,
        field="interfaces",
        run_label="",
    ),
    Key(
        "MARKER_BDRY",
        BOUNDARIES,
        NAMES,
        "All boundaries; those in no other list slide (with SLIDING_MODE= none they stay).",
        lambda case, names: case.change(roles={**dict.fromkeys(names, "sliding"), **case.roles}),
        lambda _: None,
    ),
    Key(
        "DEFORMATION_FILENAME",
        MOTION,
        PATH,
        "Displacements of the moving nodes: node, dx, dy[, dz] in each line; the others stay.",
        _put_file,
        lambda case: next((motion.files[0] for motion in _leading_file(case)), None),
        label="a displacement file",
    ),
    Key(
        "MOTION",
        MOTION,
        MOTIONS,
        "Motions of the moving boundaries, one after the other, after DEFORMATION_FILENAME.",
        lambda case, motions: case.change(motions=(*_leading_file(case), *motions)),
        lambda case: case.motions[len(_leading_file(case)) :] or None,
        label="Motion",
    ),
    *FFD_ROWS,
    *PERIODIC_ROWS,
    *METHOD_ROWS,
    *REDUCTION_ROWS,
    setting(
        QUALITY, "GENERATE_QUALITY", "Write the quality of the deformed mesh too.", run_label=""
    ),
    setting(
        QUALITY,
        "QUALITY_METRIC",
        "Size-skew as published, or as RBF-SliDe computes it (differs for hexahedra).",
        label="Quality",
        form="more",
        tip="How the quality of cells is measured: Knupp's published size-skew, or as the program "
        "RBF-SliDe computes it for hexahedra.",
    ),
    Key(
        "LIMITS",
        QUALITY,
        LIMITS,
        "What the deformed mesh must meet; if it does not, `run` ends with exit code 4. A number "
        "that each cell or wall has must be within its limit everywhere. Numbers of walls cover "
        "all boundaries with layers, or one, e.g. growth@blade < 1.5.",
        lambda case, limits: case.change(limits=limits),
        lambda case: case.limits or None,
        field="limits",
        label="Limits",
        run_label="",
    ),
    *VIEW_ROWS,
)
_RBF_SLIDE = {
    *("MESH_FILENAME", "MESH_OUT_FILENAME", "DEFORMATION_FILENAME", "GENERATE_QUALITY"),
    *("MARKER_BDRY", "MARKER_MOVING", "MARKER_INTERNAL", "MARKER_PERIODIC"),
    *("PERIODIC_MODE", "PERIODIC_TYPE", "PERIODIC_DIRECTION"),
    *("SLIDING_MODE", "STEPS", "INFLUENCE_FACTOR", "CURVED"),
    *("DATA_REDUCTION", "DATA_RED_TOLERANCE", "DOUBLE_EDGE", "GAMMA"),
    *("MULTILEVEL", "MULTI_CRIT", "LVL_TOL_CRIT", "LVL_SIZE"),
}

KEYS: dict[str, Key] = {row.name: replace(row, rbf_slide=row.name in _RBF_SLIDE) for row in _ROWS}

_FIRST = (
    *("METHOD", "SLIDING_MODE", *(row.name for row in PERIODIC_ROWS), "STEPS"),
    *("RBF_KERNEL", "INFLUENCE_FACTOR", "DATA_REDUCTION", "DATA_RED_TOLERANCE", "FEATURE_ANGLE"),
    *("STEPS_GAIN", "IDW_POWER", "IDW_FIXED_WEIGHT", "QUALITY_METRIC"),
    *("DEFORM_STIFFNESS_TYPE", "DEFORM_COEFF"),
    *("SELECTION", "MULTILEVEL", "LVL_SIZE", "GAMMA"),
)
BY_WEIGHT = tuple(KEYS[name] for name in dict.fromkeys((*_FIRST, *KEYS)))
"""All rows, the most important first: the order of fields in the window and of words on a run."""
