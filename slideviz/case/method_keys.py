"""Keys of a case file about the method, and about data reduction: which nodes are control nodes.

The numbers of DATA_REDUCTION= AUTO in the text below are EXACT_NODES and AUTO_TOLERANCE of
`slideviz.solver.setup`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from slideviz import terms
from slideviz.case.key import METHOD, REDUCTION, Key, field_row, other_method, setting
from slideviz.case.values import MAX_STEPS, YES_NO, Kind, integer, one_of, real
from slideviz.case.words import number
from slideviz.errors import CaseError
from slideviz.rbf.reduction import Reduction

if TYPE_CHECKING:
    from slideviz.case.model import Case


def _why_no_reduction(case: Case) -> str:
    off = "" if case.reduction is not None else "data reduction is off"
    return other_method(case, "rbf") or off


_AUTO = "DATA_REDUCTION= AUTO finds the tolerance; YES uses this one"


def why_no_tolerance(case: Case) -> str:
    """Return why a tolerance of data reduction has no effect in a case; "" where it has one."""
    auto = case.reduction is not None and case.reduction.auto
    return _why_no_reduction(case) or (_AUTO if auto else "")


def _why_no_levels(case: Case) -> str:
    levels = case.reduction is not None and case.reduction.multilevel
    return _why_no_reduction(case) or ("" if levels else "there are no levels")


def _why_no_repair(case: Case) -> str:
    return "repair is off" if case.repair == "no" else ""


def greedy(
    name: str, meaning: str, kind: Kind | None = None, *, field: str = "", **window: Any
) -> Key:
    """Return the row of a key whose value is a field of ``Reduction``, as `field_row`.

    Where a case has no data reduction, the value is checked and not kept.
    """
    field = field or name.lower()
    usual = getattr(Reduction(), field)
    window = {"switch": _why_no_reduction, **window}

    def put(case: Case, value: Any) -> Case:
        if case.reduction is None:
            return case
        return case.change(reduction=replace(case.reduction, **{field: value}))

    def get(case: Case) -> Any:
        reduction = case.reduction
        if reduction is None:
            return None
        value = getattr(reduction, field)
        # A tolerance without effect is written to a file only where it is not the default.
        idle = reduction.auto and window["switch"] is why_no_tolerance and value == usual
        return None if idle else value

    return field_row(
        Reduction(), REDUCTION, name, meaning, kind, field=field, put=put, get=get, **window
    )


def _put_double_edge(case: Case, wanted: bool) -> Case:
    if case.reduction is None:
        return case
    return case.change(reduction=replace(case.reduction, selection="double" if wanted else "one"))


def put_reduction(case: Case, wanted: terms.DataReduction) -> Case:
    """Return the case with data reduction (with the settings it has), automatic, or without."""
    reduction = replace(case.reduction or Reduction(), auto=wanted == "AUTO")
    return case.change(reduction=None if wanted == "NO" else reduction)


def get_reduction(case: Case) -> terms.DataReduction:
    """Return whether a case asks for data reduction: "YES", "NO" or "AUTO"."""
    if case.reduction is None:
        return "NO"
    return "AUTO" if case.reduction.auto else "YES"


REDUCTION_ROWS = (
    Key(
        "DATA_REDUCTION",
        REDUCTION,
        one_of(terms.DATA_REDUCTIONS, {"TRUE": "YES", "FALSE": "NO"}),
        "Interpolate with only some of the boundary nodes; with NO the keys below have no effect. "
        "AUTO does so if there are more than 2000. Its tolerance is a thousandth of the largest "
        "displacement, or half of the height of the first layer at sliding boundaries.",
        put_reduction,
        get_reduction,
        "AUTO",
        field="reduction",
        label="Data reduction",
        form="main",
        tip="Interpolate with only as many boundary nodes as the tolerance needs, and correct the "
        "remaining error: for meshes with more than a few thousand boundary nodes. Automatic: "
        "only for these.",
        method="rbf",
    ),
    greedy(
        "DATA_RED_TOLERANCE",
        "Largest error left before the boundary is corrected, over all steps, in the mesh's unit.",
        real(0.0),
        field="tolerance",
        label="Tolerance",
        form="main",
        tip="The largest error at the boundary that the control nodes may leave to the "
        "correction, in the mesh's length unit.",
        run_label="",
        switch=why_no_tolerance,
    ),
    greedy(
        "DATA_RED_RELATIVE",
        "The tolerance as a part of the mesh's largest extent, instead of DATA_RED_TOLERANCE.",
        real(0.0),
        field="relative",
        label="a relative tolerance of a case file,",
        run_label="",
        switch=why_no_tolerance,
    ),
    greedy(
        "MULTILEVEL",
        "Select the control nodes in levels.",
        label="Levels",
        form="more",
        tip="Whether data reduction selects in levels, each on the error that the previous ones "
        "left, and what ends a level.",
        run_label="",
    ),
    greedy(
        "MULTI_CRIT",
        "What ends a level: its number of nodes, or the decrease of its error.",
        field="criterion",
        run_label="levels by {}",
        switch=_why_no_levels,
    ),
    greedy(
        "LVL_TOL_CRIT",
        "Decrease of the error that ends a level.",
        real(0.0, 1.0),
        field="level_tolerance",
        run_label="a level ends at {}",
        switch=_why_no_levels,
    ),
    greedy(
        "LVL_SIZE",
        "Number of control nodes of a level.",
        integer(1),
        field="level_size",
        label="A level ends at",
        form="more",
        tip="Number of control nodes of a level, or the part of its error at which it ends.",
        switch=_why_no_levels,
    ),
    Key(
        "DOUBLE_EDGE",
        REDUCTION,
        YES_NO,
        "Select two nodes at a time, with opposite errors (YES), or one (NO); prefer the key "
        "SELECTION.",
        _put_double_edge,
        lambda _: None,
    ),
    greedy(
        "SELECTION",
        "Nodes added in a cycle: a growing block (fastest), two with opposite errors, or one.",
        form="more",
        tip="How many control nodes data reduction adds in a cycle: a growing block (fastest), "
        "two with opposite errors, or the one with the largest error.",
    ),
    greedy(
        "MAX_CONTROL_NODES",
        "Stop at this number of control nodes in any case.",
        integer(1),
        field="max_nodes",
        run_label="",
    ),
    greedy(
        "GAMMA",
        "Radius of the correction, divided by the largest error.",
        real(0.0),
        label="Correction radius ×",
        form="more",
        tip="How far the last correction of the boundary reaches, as a multiple of the largest "
        "error that the control nodes leave.",
    ),
)


_WAYS = " or ".join(
    f"{name} ({way})" for way, name in terms.names(terms.SLIDING).items() if way != "none"
)
FACTORS = 1e-6, 1e6  # limits of the support radius over the extent of the mesh


def nothing_slides(case: Case) -> str:
    """Return why SLIDING_MODE has no effect in a case; "" where some boundary may slide."""
    slides = {"sliding", "periodic", "internal"}.intersection(case.roles.values())
    return "" if slides else "no boundary has the role “sliding” or “periodic”"


def _no_walls(case: Case) -> str:
    walls = {"sliding", "internal"}.intersection(case.roles.values())
    return "" if walls else "no boundary has the role “sliding” or “internal”"


def or_auto(kind: Kind, word: str) -> Kind:
    """Return the kind of the values of ``kind``, which are numbers, or ``word``: 0 in the case."""
    nothing = 0 if kind.entry == "whole" else 0.0

    def read(text: str) -> Any:
        if text.lower() == word.lower():
            return nothing
        try:
            return kind.read(text)
        except CaseError as problem:
            raise CaseError(f"{problem}, or {word}") from None

    return replace(
        kind,
        allowed=f"{kind.allowed}, or {word}",
        read=read,
        write=lambda value: kind.write(value) if value else word,
        words={nothing: "automatic"},
        span=(0, kind.span[1]),
    )


def automatic_radius(case: Case) -> bool:
    """Return whether the support radius of a case is found from its motion."""
    return case.method == "rbf" and case.support_radius is None and not case.influence_factor


_RATIOS = "a number of at least 0 and below 0.5, or above 1 up to 1e12"


def _read_ratio(text: str) -> float:
    value = number(text)
    if not (0.0 <= value < 0.5 or 1.0 < value <= 1e12):
        raise CaseError(f"{text} is out of range; expected {_RATIOS}")
    return value


_setting = partial(setting, METHOD)

METHOD_ROWS = (
    _setting(
        "METHOD",
        "Radial basis functions, or for comparison inverse distance weighting, or linear "
        "elasticity (as in SU2; DEFORM_STIFFNESS_TYPE, DEFORM_COEFF). With these two, ps and ds do "
        "the same, kernel, radius and data reduction have no effect, and nothing is relaxed.",
        form="main",
        tip="How the inner nodes follow: by radial basis functions, or for comparison by inverse "
        "distance weighting, or as an elastic body whose small cells are stiffer (a choice of "
        "SU2's, not its default).",
        run_label="",
    ),
    _setting(
        "SLIDING_MODE",
        f"How nodes slide: not at all, {_WAYS}.",
        field="sliding",
        label="Sliding",
        form="main",
        tip="Whether the nodes of sliding boundaries stay (none), slide and are projected to the "
        "boundary in stages (pseudo), or slide as part of the system itself (direct).",
        run_label="",
        idle_reason=nothing_slides,
    ),
    _setting(
        "RIMS",
        "What a motion does with nodes of moving boundaries that are also on sliding or internal "
        "ones: FREE takes them off these walls, with a warning; SLIDE keeps them there, at the "
        "closest point, and the nodes beside them follow smoothly.",
        label="Nodes on walls",
        form="main",
        tip="Whether nodes that a moving boundary shares with a sliding or internal boundary, such "
        "as nodes of a blade on its hub, stay on that wall whatever the motion is; the nodes "
        "beside them follow smoothly.",
        run_label="rims {}",
        idle_reason=_no_walls,
    ),
    _setting(
        "RELAX",
        "Relax the mesh after the last step: a few iterations of an elastic body whose cells go "
        "back to their undeformed shapes, turned as they are. Cells are better in the mean, and "
        "boundary layers keep their heights and angles. AUTO does so up to a million cells in "
        "memory.",
        label="Relaxation",
        form="main",
        tip="Whether cells then go back towards their undeformed shapes, turned as they are, like "
        "an elastic body: better in the mean, and boundary layers keep their heights. A safeguard "
        "keeps the worst cells.",
        run_label="relaxation {}",
        idle_reason=lambda case: "" if case.relax == "yes" else other_method(case, "rbf"),
    ),
    _setting(
        "STEPS",
        "Steps in which the deformation is applied; auto tries 1, 2, 3, 5, 8, 13, 21 and 34, "
        "halves steps that fold a cell, and takes the fewest that are enough.",
        or_auto(integer(1, MAX_STEPS), "auto"),
        form="main",
        tip="Into how many equal parts the motion is divided: more keep large motions valid and "
        "take longer; automatic (0) takes as few as give no inverted cell.",
        run_label="",
    ),
    _setting(
        "STEPS_GAIN",
        "With STEPS= auto, steps are enough if more of them raise the minimum quality by less "
        "than this part.",
        real(0.0, 1.0),
        run_label="gain {}",
        switch=lambda case: "STEPS is a number" if case.steps else "",
    ),
    replace(
        _setting(
            "INFLUENCE_FACTOR",
            "Support radius of the radial function, divided by the largest extent of the mesh. "
            "AUTO: 15 "
            "times the largest extent of a connected moving body, or 20 times the largest "
            "displacement if that is more, and at most 2.5 extents of the mesh.",
            or_auto(real(*FACTORS), "AUTO"),
            label="Radius × extent",
            form="more",
            tip="Support radius: how far a boundary node reaches into the mesh, as a multiple of "
            "the mesh's largest extent. Automatic: as far as the motion needs.",
            run_label="radius × {}",
            method="rbf",
        ),
        put=lambda case, factor: case.change(influence_factor=factor, support_radius=None),
    ),
    _setting(
        "SUPPORT_RADIUS",
        "Support radius in the mesh's length unit, instead of INFLUENCE_FACTOR.",
        real(0.0),
        label="Support radius as a length",
        run_label="radius {}",
        method="rbf",
    ),
    _setting(
        "RBF_KERNEL",
        "The radial function; those without compact support need a smaller INFLUENCE_FACTOR.",
        replace(
            one_of(terms.KERNELS),
            allowed="one of the names below",
            details=tuple(f"{name:<22}{kernel.label}" for name, kernel in terms.KERNELS.items()),
            words=terms.names(terms.KERNELS),
        ),
        field="kernel",
        label="Kernel",
        form="more",
        tip="The radial function; a global one reaches through the whole mesh whatever the "
        "radius, and needs a smaller support radius.",
        run_label="{}",
        method="rbf",
    ),
    _setting(
        "POLYNOMIAL",
        "Add a linear polynomial to the radial functions: motions that are linear in the "
        "coordinates are exact then, with any kernel, and nodes beyond all supports move too. "
        "AUTO: only where the kernel needs it (thin-plate, multiquadric, quadric).",
        form="more",
        tip="Whether a linear polynomial is added to the radial functions: a motion that is linear "
        "in the coordinates is then exact with any kernel, and nodes far from the motion move too.",
        run_label="polynomial {}",
        method="rbf",
    ),
    _setting(
        "LAYERS",
        "Keep boundary layers: nodes near walls go with the displacement and rotation of the wall, "
        "so that first heights and angles stay. Walls are moving and fixed boundaries: AUTO takes "
        "those with flat quadrilaterals, hexahedra or prisms, KEEP all of them.",
        form="main",
        tip="Whether nodes near walls go with the wall's own displacement and rotation: this keeps "
        "the heights of boundary layers.",
        run_label="layers {}",
        idle_reason=lambda case: "" if case.layers == "keep" else other_method(case, "rbf"),
    ),
    _setting(
        "LAYER_THICKNESS",
        "How far from walls LAYERS acts, in the mesh's length unit. AUTO: a fiftieth of the wall's "
        "largest extent, or the thickness of its boundary layer if that is less.",
        or_auto(real(0.0), "AUTO"),
        form="more",
        tip="How far from walls nodes go with them, in the mesh's length unit. Automatic: a "
        "fiftieth of the wall's extent, or the thickness of its boundary layer if that is less.",
        run_label="to {}",
        switch=lambda case: "layers are off" if case.layers == "no" else "",
        method="rbf",
    ),
    _setting(
        "REPAIR",
        "Mend cells that are inverted, not proved valid, or of a quality below REPAIR_BELOW (and "
        "lower than before): nodes near them move, never nodes of moving and fixed boundaries. The "
        "mesh is never worse after it. AUTO is the same as YES.",
        form="main",
        tip="Whether inverted and poor cells are then mended, by moving the nodes near them: never "
        "nodes of moving and fixed boundaries.",
        run_label="repair {}",
    ),
    _setting(
        "REPAIR_BELOW",
        "The quality below which REPAIR mends valid cells, too; with 0 it mends only those that "
        "are not proved valid.",
        real(0.0, 1.0, with_low=True),
        form="more",
        tip="The quality below which valid cells are mended, too.",
        run_label="repair below {}",
        switch=_why_no_repair,
    ),
    _setting(
        "REPAIR_STEPS",
        "Whether REPAIR acts after each step (YES, not of a streamed mesh), or after the last one "
        "(NO).",
        label="Repair each step",
        form="more",
        tip="Whether cells are mended after each step, so that the next one starts from a better "
        "mesh, or only after the last.",
        run_label="repair of each step",
        switch=_why_no_repair,
    ),
    _setting(
        "IDW_POWER",
        "With METHOD= idw, the power of the inverse distance; by default the number of dimensions.",
        real(0.0, 20.0, closed=True),
        run_label="power {}",
        method="idw",
    ),
    _setting(
        "IDW_FIXED_WEIGHT",
        "With METHOD= idw, the weight of a boundary node that stays, relative to one that moves.",
        real(1e-12, 1e12),
        run_label="fixed weight {}",
        method="idw",
    ),
    _setting(
        "DEFORM_STIFFNESS_TYPE",
        "With METHOD= elastic, which cells are stiff, like SU2: Young's modulus is one over the "
        "mean distance of the cell's nodes to the nearest node of a wall (SU2's default), one over "
        "the cell's volume, or the same everywhere. Walls are moving boundaries, and fixed ones "
        f"whose names have none of {', '.join(terms.NOT_WALLS)}.",
        one_of(terms.STIFFNESS_TYPES, {"WALL_DISTANCE": "SOLID_WALL_DISTANCE"}),
        run_label="stiffness {}",
        method="elastic",
    ),
    _setting(
        "DEFORM_COEFF",
        "With METHOD= elastic, Poisson's ratio. With SU2's default of 1e6 cells may grow and "
        "shrink freely, and keep their angles instead.",
        Kind(_RATIOS, _read_ratio, lambda value: repr(float(value)), entry="real"),
        run_label="Poisson's ratio {}",
        method="elastic",
    ),
    _setting(
        "CURVED",
        "No effect: RBF-SliDe's switch for curved boundaries, which are always found and followed.",
        run_label="",
        no_effect="curved boundaries are always found and followed",
    ),
    _setting(
        "FEATURE_ANGLE",
        "Angle in degrees from which a bend within a boundary is an edge.",
        real(0.0, 180.0, closed=True),
        field="feature_angle_deg",
        unit="°",
        form="more",
        tip="A boundary that turns by more than this angle has an edge there, which sliding nodes "
        "do not cross.",
    ),
)
