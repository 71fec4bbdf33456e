"""The table of all keys of a case file, by which they are read, checked, written and explained.

Values are put into a case in the order of the table, whatever their order in the file. Groups with
many keys have modules of their own.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from slideviz.case.ffd_keys import FFD_ROWS
from slideviz.case.key import BOUNDARIES, FILES, MOTION, QUALITY, Key, role, setting
from slideviz.case.method_keys import METHOD_ROWS
from slideviz.case.model import Case, FromFile, Motion
from slideviz.case.motion_text import MOTIONS
from slideviz.case.periodic_keys import PERIODIC_ROWS
from slideviz.case.reduction_keys import REDUCTION_ROWS
from slideviz.case.values import NAMES, PAIRS, PATH, YES_NO, choice, one_of, whole
from slideviz.case.view_keys import VIEW_ROWS
from slideviz.terms import FILE_FORMATS, METRICS


def put_boundaries(case: Case, names: tuple[str, ...]) -> Case:
    """Return the case where those ``names`` slide that have no role (RBF-SliDe's MARKER_BDRY)."""
    return case.change(roles={**dict.fromkeys(names, "sliding"), **case.roles})


def _leading_file(case: Case) -> tuple[Motion, ...]:
    """Return the first motion if it is a displacement file of all moving markers, (1,); else ()."""
    return tuple(m for m in case.motions[:1] if isinstance(m, FromFile) and not m.marker)


def put_file(case: Case, path: Path | None) -> Case:
    """Return the case with ``path`` as the leading displacement file, or None: without one."""
    remaining = case.motions[len(_leading_file(case)) :]
    return case.change(motions=remaining if path is None else (FromFile(path), *remaining))


def get_file(case: Case) -> Path | None:
    """Return the displacement file of all moving markers, if motions begin with one, or None."""
    files = [motion.path for motion in _leading_file(case) if isinstance(motion, FromFile)]
    return files[0] if files else None


def put_motions(case: Case, motions: tuple[Motion, ...]) -> Case:
    """Return the case with ``motions`` after its leading displacement file, if it has one."""
    return case.change(motions=(*_leading_file(case), *motions))


def get_motions(case: Case) -> tuple[Motion, ...] | None:
    """Return the motions after the leading displacement file, None if there are none."""
    return case.motions[len(_leading_file(case)) :] or None


_FORMAT = choice({term.label: value for value, term in FILE_FORMATS.items()})

_ROWS = (
    setting("MESH_FILENAME", FILES, PATH, "mesh_file", "The mesh to deform."),
    setting("MESH_OUT_FILENAME", FILES, PATH, "mesh_out", "Where the deformed mesh is written."),
    setting(
        "MESH_FORMAT",
        FILES,
        _FORMAT,
        "mesh_format",
        "SU2's text or binary; without it ending and content of the file tell.",
    ),
    setting(
        "MESH_OUT_FORMAT",
        FILES,
        _FORMAT,
        "mesh_out_format",
        "SU2's text or binary, whatever the ending of the file.",
    ),
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
        label="a displacement file",
    ),
    Key(
        "MOTION",
        MOTION,
        MOTIONS,
        "What the moving boundaries do, one after the other, after DEFORMATION_FILENAME.",
        put_motions,
        get_motions,
        label="Motion",
    ),
    *FFD_ROWS,
    *PERIODIC_ROWS,
    *METHOD_ROWS,
    *REDUCTION_ROWS,
    setting(
        "GENERATE_QUALITY",
        QUALITY,
        YES_NO,
        "generate_quality",
        "Write the quality of the deformed mesh too.",
        run_label="",
    ),
    setting(
        "QUALITY_METRIC",
        QUALITY,
        one_of(METRICS),
        "quality_metric",
        "Size-skew as published, or as RBF-SliDe computes it (differs for hexahedra).",
        label="Quality",
        form="more",
        tip="How cells are judged: Knupp's published size-skew, or as the program RBF-SliDe "
        "computes it for hexahedra.",
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
    *("SELECTION", "MULTILEVEL", "LVL_SIZE", "GAMMA"),
)
BY_WEIGHT = tuple(KEYS[name] for name in dict.fromkeys((*_FIRST, *KEYS)))
"""All rows, the most important first: the order of fields in the window and of words on a run."""
