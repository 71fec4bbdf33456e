"""The case: roles of the boundaries, motions, and the settings of the method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

from slideviz import terms
from slideviz.argument_types import CheckedFields, check_types
from slideviz.case.limits import Limit, read_limits
from slideviz.case.motions.motion import Motion
from slideviz.errors import CaseError, nearest, not_one_of, raise_all
from slideviz.formats.table import FILE_FORMATS
from slideviz.mesh.model import DEFAULT_FEATURE_ANGLE_DEG
from slideviz.rbf.reduction import AUTO, Reduction

_NUMBERS = (
    "zone", "axis", "origin", "feature_angle_deg", "steps", "steps_gain", "influence_factor",
    "support_radius", "reduction", "layer_thickness", "repair_below", "idw_power",
    "idw_fixed_weight", "deform_coeff",
)  # fmt: skip
"""The fields of a case whose numbers must be in a range, which the table of keys has."""
_ROLES = 'a role for each marker, e.g. {"blade": "moving"}'


def with_paths(case: Case, change: Callable[[Path], Path]) -> Case:
    """Return the case with changed paths of its meshes and of the files of its motions."""
    return case.change(
        mesh_file=change(case.mesh_file) if case.mesh_file else None,
        mesh_out=change(case.mesh_out) if case.mesh_out else None,
        motions=tuple(motion.with_files(change) for motion in case.motions),
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
    motions: Annotated[tuple[Motion, ...], "a tuple of motions, e.g. Translate(...)"] = ()
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
            from slideviz.case.check import key_problems

            raise_all(key_problems(self))

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
        files = (path for motion in self.motions for path in motion.files)
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
