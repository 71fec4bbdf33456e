"""The case: roles of the boundaries, motions, and the settings of the method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from slideviz import terms
from slideviz.argument_types import CheckedFields, check_types
from slideviz.case.limits import Limit, read_limits
from slideviz.errors import CaseError, nearest, not_one_of
from slideviz.formats.table import FILE_FORMATS
from slideviz.mesh.model import DEFAULT_FEATURE_ANGLE_DEG, frozen_array
from slideviz.rbf.reduction import AUTO, Reduction

Point = tuple[float, ...] | Literal["centroid"]
Target = str | tuple[str, ...]
"""The markers a motion moves: one, several as one body, or, where it is empty, all moving ones."""


@dataclass(frozen=True)
class Translate(CheckedFields):
    """Shift a marker by ``vector`` (d,), in the mesh's length unit."""

    marker: Target
    vector: tuple[float, ...]


@dataclass(frozen=True)
class Rotate(CheckedFields):
    """Rotate a marker by ``angle_deg`` about an axis through ``point`` (right-handed; any length).

    In 2D the axis is z: positive angles turn counter-clockwise. Several markers have one common
    centroid.
    """

    marker: Target
    angle_deg: float
    point: Point = "centroid"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Scale(CheckedFields):
    """Scale a marker about ``point`` by ``factors``: one for all axes, or one for each."""

    marker: Target
    factors: tuple[float, ...]
    point: Point = "centroid"


@dataclass(frozen=True)
class Radial(CheckedFields):
    """Push a marker away from an axis: each radius r becomes ``factor`` r + ``distance``.

    ``factor`` 1.03 is 3 % outwards. The axis goes through ``point`` (d,) along ``axis``; in 2D it
    is z. ``distance`` is in the mesh's length unit. Nodes on the axis stay on it.
    """

    marker: Target
    factor: float = 1.0
    distance: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    point: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FromFile(CheckedFields):
    """Displace nodes as a file lists: node index, then the Cartesian displacement.

    ``marker`` empty: the file serves all moving markers (RBF-SliDe's DEFORMATION_FILENAME).
    """

    path: Path
    marker: Target = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "path", Path(self.path))


@dataclass(frozen=True)
class Onto(FromFile):
    """Lay a marker onto the surface in a file: an STL or VTU surface, or a boundary of a mesh.

    Nodes move to closest points, smoothly, from their undeformed places, so that no other motion of
    the marker may come before. Those at the rim stay on the boundaries that they have in common
    with. Of a mesh, the boundary with the marker's name counts, or its only one. ``limit`` is how
    far a node may stay from the surface, in the mesh's length unit; 0 is 1 % of the marker's size.
    """

    limit: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.limit < inf:
            raise CaseError(
                f"the limit {self.limit:g} is not above 0; leave it out for 1 % of the size"
            )


@dataclass(frozen=True)
class Ffd(CheckedFields):
    """Move control points of a box for free-form deformation, and with them the nodes inside.

    ``box`` is the name of a box of the mesh or of ``Case.ffd_boxes``, ``index`` the control point
    (i, j, k), where -1 takes all of a direction, ``vector`` its shift (dx, dy, dz), dz 0 in 2D. The
    displacement of a node depends on its undeformed place in the undeformed box, whatever motions
    come before.
    """

    marker: Target
    box: str
    index: tuple[int, int, int]
    vector: tuple[float, float, float]


@dataclass(frozen=True)
class HicksHenne(CheckedFields):
    """Raise one side of an airfoil outwards by a bump (Hicks and Henne 1978).

    It is ``height`` at ``peak``, a part of the ``chord`` between two x, and 0 at its ends. Nodes
    move along y, from their undeformed places, whatever motions come before; the upper side is
    where normals into the flow point to +y.
    """

    marker: Target
    height: float
    peak: float = 0.5
    side: terms.Side = field(default="upper", metadata=terms.SIDES)
    chord: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class Cst(CheckedFields):
    """Add ``height`` times a class and shape function to y of one side of an airfoil (Kulfan 2008).

    The function is the square root of t times (1 - t), times Bernstein polynomial k of n (from 1)
    of ``term``, with t from 0 to 1 along the ``chord``; otherwise as `HicksHenne`.
    """

    marker: Target
    height: float
    term: tuple[int, int] = (1, 1)
    side: terms.Side = field(default="upper", metadata=terms.SIDES)
    chord: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class Bump(CheckedFields):
    """Raise all sides of an airfoil towards +y by a bump; otherwise as `HicksHenne`."""

    marker: Target
    height: float
    peak: float = 0.5
    chord: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True)
class _FfdColumn(CheckedFields):
    marker: Target
    box: str
    index: tuple[int, int]
    amount: float


@dataclass(frozen=True)
class FfdCamber(_FfdColumn):
    """Shift a column of control points of a box as one, and with it the nodes inside.

    ``index`` (i, j) is the column, which goes along z; in 2D that of i, along y. -1 takes all.
    """


@dataclass(frozen=True)
class FfdThickness(_FfdColumn):
    """Stretch a column of control points of a box, and with it the nodes inside.

    Its first control point goes by -``amount``, its last one by ``amount``. ``index`` as in
    `FfdCamber`.
    """


@dataclass(frozen=True)
class FfdTwist(CheckedFields):
    """Rotate a plane j of control points of a box in 3D, and with it the nodes inside.

    It turns by ``angle_deg`` about the axis through ``point`` (right-handed; any length). A
    ``plane`` of -1 takes all.
    """

    marker: Target
    box: str
    plane: int
    angle_deg: float
    point: tuple[float, ...] = (0.0, 0.0, 0.0)
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)


@dataclass(frozen=True)
class SpanMotion(CheckedFields):
    """Change the sections of a blade, each at its span, by a curve over the span.

    The curve is the monotone cubic through ``values`` at ``spans``, from 0 at the hub to 1 at the
    shroud, and constant beyond them; a single value holds for the whole span. By ``kind``:

    * ``twist``, ``stagger``: turned about the stacking line, in degrees, from the direction of m
      towards that of growing theta; ``stagger`` has a single value.
    * ``lean``, ``sweep``: shifted along theta, or along the meridional direction, by a length.
    * ``chord``: scaled about the stacking line by a factor.
    * ``camber``: bent towards growing theta, by a part of the chord.

    Nodes keep their span, so those of hub and shroud stay on them. ``point``: a point of the
    stacking line, which then follows the line from hub to shroud through it; None: a straight line
    fitted to the sections' centroids. Displacements depend on the undeformed blade, whatever
    motions come before; several of one blade add up in any order.
    """

    marker: Target
    kind: terms.SpanKind = field(metadata=terms.SPAN_KINDS)
    spans: tuple[float, ...]
    values: tuple[float, ...]
    point: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        spans = self.spans
        if not spans or len(spans) != len(self.values):
            raise CaseError(
                f"{len(spans)} spans and {len(self.values)} values are given; a curve needs a "
                "value for each span, and one or more"
            )
        if not (spans[0] >= 0.0 and spans[-1] <= 1.0) or (np.diff(spans) <= 0.0).any():
            raise CaseError(
                f"the spans {', '.join(f'{span:g}' for span in spans)} do not ascend from 0 (hub) "
                "to 1 (shroud); sort them, each once"
            )
        if self.kind == "stagger" and len(spans) > 1:
            raise CaseError("stagger has one angle for the whole span; a curve of them is a twist")
        if self.kind == "chord" and min(self.values) <= 0.0:
            raise CaseError(
                f"the chord's factor {min(self.values):g} is not above 0: it would fold the blade"
            )


@dataclass(frozen=True, eq=False)
class Prescribed(CheckedFields):
    """Displace nodes (k,) by vectors (k, d), given by a program; it cannot be in a case file.

    Nodes are ascending, each once. Nodes of the markers that are not among them stay in place.
    """

    nodes: NDArray[np.int64]
    vectors: NDArray[np.float64]
    marker: Target = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        nodes = frozen_array(self.nodes, np.int64)
        vectors = frozen_array(self.vectors, np.float64)
        if nodes.ndim != 1 or vectors.ndim != 2 or len(nodes) != len(vectors):
            raise CaseError(
                f"nodes and vectors have the shapes {nodes.shape} and {vectors.shape}; expected "
                "(k,) and (k, d)"
            )
        if (np.diff(nodes) <= 0).any() or not np.isfinite(vectors).all():
            raise CaseError("nodes must be ascending, each once, and their vectors finite")
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "vectors", vectors)


_NUMBERS = (
    "zone", "axis", "origin", "feature_angle_deg", "steps", "steps_gain", "influence_factor",
    "support_radius", "reduction", "layer_thickness", "repair_below", "idw_power",
    "idw_fixed_weight",
)  # fmt: skip
"""The fields of a case whose numbers must be in a range, which the table of keys has."""
_ROLES = 'a role for each marker, as {"blade": "moving"}'
OnAirfoil = HicksHenne | Cst | Bump
BoxMotion = Ffd | FfdCamber | FfdThickness | FfdTwist
"""Motions of control points of boxes; those of one box act one after the other."""
PlacedMotion = OnAirfoil | BoxMotion | SpanMotion
"""Motions that depend on undeformed places, whatever motions come before."""
Motion = Translate | Rotate | Scale | Radial | PlacedMotion | FromFile | Prescribed


def named(target: Target) -> tuple[str, ...]:
    """Return the names of the markers in a target; () where it is all moving markers."""
    return (target,) * bool(target) if isinstance(target, str) else target


def applies_to(motion: Motion, marker: str) -> bool:
    """Return whether a motion moves the moving marker ``marker``."""
    return not motion.marker or marker in named(motion.marker)


def with_paths(case: Case, change: Callable[[Path], Path]) -> Case:
    """Return the case with changed paths of its meshes and of the files of its motions."""
    return case.change(
        mesh_file=change(case.mesh_file) if case.mesh_file else None,
        mesh_out=change(case.mesh_out) if case.mesh_out else None,
        motions=tuple(
            replace(motion, path=change(motion.path)) if isinstance(motion, FromFile) else motion
            for motion in case.motions
        ),
    )


NEW: dict[str, Any] = {"rims": "slide", "relax": "auto", "layers": "auto", "repair": "auto"}
"""Settings of new cases where those of a file without their keys are others, for its results."""


@dataclass(frozen=True)
class Case(CheckedFields):
    """A deformation case, the content of a ``.cfg`` file.

    Markers of the mesh that are not in ``roles`` are fixed. Paths are absolute, or relative to the
    current folder. Of the other fields, of which ``slideviz keys`` has all:

    * ``mesh_format``, ``mesh_out_format``: None: by the ending of the file.
    * ``axis``, ``origin``: direction and a point of the axis of rotational periodicity.
    * ``span``: hub and shroud, between which the span is from 0 to 1; None: by their names.
    * ``direction``, ``curved``: RBF-SliDe's, without effect: both are found from the mesh.
      ``direction`` is 0, 1, 2 for x, y, z or r, theta, z, or None.
    * ``feature_angle_deg``: the angle in degrees from which a bend in a boundary is an edge; the
      default is ``DEFAULT_FEATURE_ANGLE_DEG`` of `slideviz.mesh.model`.
    * ``steps``: 0, or "auto", finds the number of steps; ``steps_gain`` is when to stop.
    * ``influence_factor``: the support radius over the extent of the mesh; 0, or "auto", fits it
      to the motion. ``support_radius``, if not None, is used instead: a length.
    * ``reduction``: None: all boundary nodes are control nodes, however many.
    * ``layer_thickness``: how far from walls ``layers`` acts: a length; 0, or "auto", finds it.
    * ``repair``: whether cells that are inverted, or whose quality is below ``repair_below``, are
      mended: after each step if ``repair_steps``, else after the last.
    * ``idw_power``: None: the number of dimensions.
    * ``interfaces``: pairs of boundaries of two zones that stay together; (): all that coincide.
      ``zone_settings``: a case for each zone, whose settings the zone has; (): those of this one.
    * ``limits``: what the deformed mesh must meet; changes no mesh.
    * ``view``: how the window showed the case, by key; changes no result.
    * ``ffd_boxes``: boxes for free-form deformation that are not in the mesh file: name and 8
      corners (24 numbers; in 2D the first 4 corners count). ``ffd_degrees`` are their degrees,
      ``ffd_orders`` the orders of B-splines. ``ffd_system`` are the coordinates in which boxes are
      straight, those of the mesh too, about an axis along x through the point ``ffd_axis``.
    * ``source``: the file that the case was read from; ``warnings``: what reading it found.

    Examples
    --------
    >>> import slideviz as sv
    >>> case = sv.Case(
    ...     roles={"blade": "moving", "inflow": "sliding", "outflow": "sliding"},
    ...     motions=(sv.Rotate("blade", 5.0), sv.Translate("blade", (0.001, 0.0))),
    ...     sliding="ps",
    ... )
    >>> case.markers_with("sliding")
    ('inflow', 'outflow')
    >>> case.change(steps=5).write("blade.cfg")
    >>> sv.Case.read("blade.cfg").steps
    5
    """

    mesh_file: Path | None = None
    mesh_out: Path | None = None
    mesh_format: terms.FileFormat | None = field(default=None, metadata=FILE_FORMATS)
    mesh_out_format: terms.FileFormat | None = field(default=None, metadata=FILE_FORMATS)
    zone: int | None = None
    roles: Annotated[Mapping[str, terms.Role], _ROLES] = field(default_factory=dict)
    motions: Annotated[tuple[Motion, ...], "a tuple of motions, as Translate(...)"] = ()
    interfaces: tuple[str, ...] = ()
    zone_settings: tuple[Case, ...] = ()
    ffd_boxes: tuple[tuple[str, tuple[float, ...]], ...] = ()
    ffd_degrees: tuple[tuple[int, int, int], ...] = ()
    ffd_blending: terms.FfdBlending = field(default="BEZIER", metadata=terms.FFD_BLENDINGS)
    ffd_orders: tuple[int, int, int] = (2, 2, 2)
    ffd_system: terms.FfdSystem = field(default="CARTESIAN", metadata=terms.FFD_SYSTEMS)
    ffd_axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    method: terms.Method = field(default="rbf", metadata=terms.METHODS)
    sliding: terms.Sliding = field(default="none", metadata=terms.SLIDING)
    rims: terms.Rims = field(default="free", metadata=terms.RIMS)
    periodic: terms.PeriodicMode = field(default="none", metadata=terms.PERIODIC_MODES)
    periodic_type: terms.PeriodicType = field(default="auto", metadata=terms.PERIODIC_TYPES)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: int | None = None
    span: tuple[str, str] | None = None
    feature_angle_deg: float = DEFAULT_FEATURE_ANGLE_DEG
    curved: bool = False
    steps: Annotated[int, 'a whole number, or "auto"'] = 1
    steps_gain: float = 0.02
    influence_factor: Annotated[float, 'a number, or "auto"'] = 0.0
    support_radius: float | None = None
    kernel: str = field(default="wendland-c2", metadata=terms.KERNELS)
    reduction: Reduction | None = AUTO
    polynomial: terms.Polynomial = field(default="auto", metadata=terms.POLYNOMIALS)
    relax: terms.Relax = field(default="no", metadata=terms.RELAXES)
    layers: terms.Layers = field(default="no", metadata=terms.LAYERS)
    layer_thickness: Annotated[float, 'a length, or "auto"'] = 0.0
    repair: terms.Repair = field(default="no", metadata=terms.REPAIRS)
    repair_below: float = 0.1
    repair_steps: bool = False
    idw_power: float | None = None
    idw_fixed_weight: float = 1.0
    deform_stiffness_type: terms.StiffnessType = field(
        default="INVERSE_VOLUME", metadata=terms.STIFFNESS_TYPES
    )
    deform_coeff: float = 0.3
    quality_metric: terms.SkewMetric = field(default="knupp", metadata=terms.SKEW_METRICS)
    generate_quality: bool = True
    limits: Annotated[tuple[Limit, ...], 'limits, or a text as "min > 0.3, inverted = 0"'] = ()
    source: Path | None = None
    view: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("steps", "influence_factor", "layer_thickness"):
            if str(getattr(self, name)).lower() == "auto":  # as in a case file
                object.__setattr__(self, name, 0)
        if isinstance(self.limits, str):
            object.__setattr__(self, "limits", read_limits(self.limits))
        super().__post_init__()
        for marker, role in self.roles.items():
            if role not in terms.ROLES:
                raise CaseError(f"roles: {marker!r}: {not_one_of(role, terms.ROLES)}")
        for name in ("mesh_file", "mesh_out", "source"):
            if (path := getattr(self, name)) is not None:
                object.__setattr__(self, name, Path(path))
        usual = self.__dataclass_fields__
        if any(getattr(self, name) is not usual[name].default for name in _NUMBERS):
            from slideviz.case.check import key_problems, raise_all

            raise_all(tuple(key_problems(self)))

    def change(self, **values: Any) -> Case:
        """Return the case with other values of some fields.

        Raises
        ------
        CaseError
            A case has no such field, or it cannot have such a value.
        ArgumentError
            A value is of another type.
        """
        names = [each.name for each in fields(self)]
        for name in values:
            if name not in names:
                raise CaseError(f"a case has no {name!r}{nearest(name, names)}")
        return replace(self, **values)

    def markers_with(self, role: terms.Role) -> tuple[str, ...]:
        """Return the names of the markers with a role, in the order of ``roles``."""
        return tuple(name for name, given in self.roles.items() if given == role)

    def walls(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return those of the boundaries ``names`` that are neither periodic nor internal.

        Moving ones are first, then fixed ones, then sliding ones.
        """
        roles = {name: self.roles.get(name, "fixed") for name in names}
        order = ("moving", "fixed", "sliding")
        return tuple(name for role in order for name in names if roles[name] == role)

    def inputs(self) -> dict[Path, str]:
        """Return the files that the case is read from or names, with words for what each is."""
        inputs = {} if self.mesh_file is None else {self.mesh_file: "the input mesh"}
        if self.source is not None:
            inputs[self.source] = "the case file"
        files = (motion.path for motion in self.motions if isinstance(motion, FromFile))
        return inputs | dict.fromkeys(files, "a file of a motion")

    @classmethod
    @check_types
    def read(cls, path: str | Path) -> Case:
        """Return the case that a ``.cfg`` file describes.

        Raises CaseError if the file cannot be read, or has mistakes: all of them, each with its
        line.
        """
        from slideviz.case.cfg import read_case

        return read_case(Path(path))

    @check_types
    def write(self, path: str | Path) -> None:
        """Write the ``.cfg`` file, with paths relative to its folder."""
        from slideviz.case.cfg import write_case

        write_case(Path(path), self)
