"""The fields of a case with their defaults, from which the table of keys is made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any

from slideviz import terms
from slideviz.argument_types import CheckedFields, frozen
from slideviz.case.limits import Limit, read_limits
from slideviz.case.motions.motion import Motion
from slideviz.errors import CaseError, Remark, not_one_of
from slideviz.mesh.model import DEFAULT_FEATURE_ANGLE_DEG
from slideviz.rbf.reduction import AUTO, Reduction

_ROLES = 'a role for each marker, e.g. {"blade": "moving"}'


@frozen
class CaseFields(CheckedFields):
    """The fields of `slideviz.case.model.Case`, each of the right type."""

    mesh_file: Path | None = None
    mesh_out: Path | None = None
    reference_file: Path | None = None
    mesh_format: terms.FileFormat | None = field(default=None, metadata=terms.FILE_FORMATS)
    mesh_out_format: terms.FileFormat | None = field(default=None, metadata=terms.FILE_FORMATS)
    zone: int | None = None
    roles: Annotated[Mapping[str, terms.Role], _ROLES] = field(default_factory=dict)
    motions: Annotated[tuple[Motion, ...], "a tuple of motions, e.g. Translate(...)"] = ()
    interfaces: tuple[str, ...] = ()
    zone_settings: tuple[Any, ...] = ()
    ffd_boxes: tuple[tuple[str, tuple[float, ...]], ...] = ()
    ffd_degrees: tuple[tuple[int, int, int], ...] = ()
    ffd_blending: terms.FfdBlending = field(default="BEZIER", metadata=terms.FFD_BLENDINGS)
    ffd_orders: tuple[int, int, int] = (2, 2, 2)
    ffd_system: terms.FfdSystem = field(default="CARTESIAN", metadata=terms.FFD_SYSTEMS)
    ffd_axis: terms.Vector = (0.0, 0.0, 0.0)
    method: terms.Method = field(default="rbf", metadata=terms.METHODS)
    sliding: terms.Sliding = field(default="none", metadata=terms.SLIDING)
    rims: terms.Rims = field(default="free", metadata=terms.RIMS)
    periodic: terms.PeriodicMode = field(default="none", metadata=terms.PERIODIC_MODES)
    periodic_type: terms.PeriodicType = field(default="auto", metadata=terms.PERIODIC_TYPES)
    axis: terms.Vector = (0.0, 0.0, 1.0)
    origin: terms.Vector = (0.0, 0.0, 0.0)
    direction: int | None = None
    span: tuple[str, str] | None = None
    span_axis: terms.Vector | None = None
    feature_angle_deg: float = DEFAULT_FEATURE_ANGLE_DEG
    curved: bool = False
    steps: Annotated[int, 'a whole number, or "auto"'] = 1
    steps_gain: float = 0.02
    influence_factor: Annotated[float, 'a number, or "auto"'] = 0.0
    support_radius: float | None = None
    kernel: str = field(default="wendland-c2", metadata=terms.KERNELS)
    reduction: Reduction | None = AUTO
    device: terms.Device = field(default="auto", metadata=terms.DEVICES)
    polynomial: terms.Polynomial = field(default="auto", metadata=terms.POLYNOMIALS)
    relax: terms.Relax = field(default="no", metadata=terms.RELAXES)
    layers: terms.Layers = field(default="no", metadata=terms.LAYERS)
    layer_thickness: Annotated[float, 'a length, or "auto"'] = 0.0
    layer_minimum_gap: float = 0.33
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
    warnings: tuple[Remark, ...] = ()

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
        for name in ("mesh_file", "mesh_out", "reference_file", "source"):
            if (path := getattr(self, name)) is not None:
                object.__setattr__(self, name, Path(path))
