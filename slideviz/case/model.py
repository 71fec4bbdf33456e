"""The case: roles of the boundaries, motions, and the settings of the method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from slideviz.case.reduction import AUTO, Reduction, require_chosen
from slideviz.case.words import nearest, not_one_of
from slideviz.errors import FILE, CaseError, takes
from slideviz.mesh.model import frozen_array
from slideviz.terms import (
    FFD_BLENDINGS,
    FILE_FORMATS,
    KERNELS,
    METHODS,
    METRICS,
    PERIODIC_MODES,
    PERIODIC_TYPES,
    ROLES,
    SLIDING,
    FfdBlending,
    FileFormat,
    Method,
    Metric,
    PeriodicMode,
    PeriodicType,
    Role,
    Sliding,
)

Point = tuple[float, ...] | Literal["centroid"]
Target = str | tuple[str, ...]
"""What a motion moves: a marker, several as one body, or all that move where it is empty."""


@dataclass(frozen=True)
class Translate:
    """Shift a marker by ``vector`` (d,), in the mesh's length unit."""

    marker: Target
    vector: tuple[float, ...]


@dataclass(frozen=True)
class Rotate:
    """Turn a marker by ``angle_deg`` about ``point`` and ``axis`` (right-handed; any length).

    In 2D the axis is that of z: positive angles turn counter-clockwise. The centroid of several
    markers is their common one.
    """

    marker: Target
    angle_deg: float
    point: Point = "centroid"
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Scale:
    """Enlarge a marker by ``factors``, one for all or one for each axis, about ``point``."""

    marker: Target
    factors: tuple[float, ...]
    point: Point = "centroid"


@dataclass(frozen=True)
class Radial:
    """Push a marker away from an axis: each radius r becomes ``factor`` r + ``distance``.

    ``factor`` 1.03 is 3 % outwards. The axis goes through ``point`` (d,) along ``axis``, that of
    z in 2D; ``distance`` is in the mesh's length unit. Nodes on the axis stay on it.
    """

    marker: Target
    factor: float = 1.0
    distance: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    point: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FromFile:
    """Displace nodes as a file lists: node index, then the Cartesian displacement.

    ``marker`` empty: the file serves all moving markers (RBF-SliDe's DEFORMATION_FILENAME).
    """

    path: Path
    marker: Target = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))


@dataclass(frozen=True)
class Ffd:
    """Move control points of a box for free-form deformation, and with them what is inside.

    ``box`` is one of the mesh's or of ``Case.ffd_boxes``, ``index`` the control point (i, j, k),
    where -1 is all of that direction, ``vector`` its shift (dx, dy, dz), with dz 0 in 2D. What a
    node takes of it depends on where it was in the undeformed box, whatever other motions do.
    """

    marker: Target
    box: str
    index: tuple[int, int, int]
    vector: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Prescribed:
    """Displace nodes (k,) by vectors (k, d), which a program gives; no case file can hold it.

    Nodes are sorted, each once; nodes of the markers that are not among them stay.
    """

    nodes: NDArray[np.int64]
    vectors: NDArray[np.float64]
    marker: Target = ""

    def __post_init__(self) -> None:
        nodes = frozen_array(self.nodes, np.int64)
        vectors = frozen_array(self.vectors, np.float64)
        if nodes.ndim != 1 or vectors.ndim != 2 or len(nodes) != len(vectors):
            raise CaseError(
                f"nodes and vectors have the shapes {nodes.shape} and {vectors.shape}; needed are "
                "(k,) and (k, d)"
            )
        if (np.diff(nodes) <= 0).any() or not np.isfinite(vectors).all():
            raise CaseError("nodes must be ascending, each once, and their vectors finite")
        object.__setattr__(self, "nodes", nodes)
        object.__setattr__(self, "vectors", vectors)


Motion = Translate | Rotate | Scale | Radial | Ffd | FromFile | Prescribed


def named(target: Target) -> tuple[str, ...]:
    """Return the markers that a target names; none where the target is all that move."""
    return (target,) * bool(target) if isinstance(target, str) else target


def moves(motion: Motion, marker: str) -> bool:
    """Tell whether a motion is one of this moving marker."""
    return not motion.marker or marker in named(motion.marker)


_KINDS = (
    ("roles", Mapping, 'a role for each marker, as {"blade": "moving"}'),
    ("motions", tuple | list, "a tuple of motions"),
    ("reduction", Reduction | None, "a Reduction, or None for all boundary nodes"),
)
"""What some fields of a case are, and the words for it."""


@dataclass(frozen=True)
class Case:
    """A deformation case, the content of a ``.cfg`` file.

    Every marker of the mesh that ``roles`` does not name is fixed. Defaults are those of the
    thesis. Paths are absolute, or relative to the current folder; the formats of the meshes are
    None where their endings tell. ``direction`` is the component of the frame in which the mesh
    repeats (0, 1, 2 for x, y, z or r, theta, z), None where none is given; it and ``curved`` are
    RBF-SliDe's and without effect, since the matching of the periodic markers and the shape of the
    boundaries tell both; ``steps`` is 0, or "auto", for as many as it takes (see ``steps_gain`` in
    ``slideviz keys``); ``reduction`` is None where all boundary nodes are control nodes, however
    many, ``idw_power`` where it is the number of dimensions. ``view`` has how a window showed the
    case, by key: it changes no result. ``ffd_boxes`` are boxes for free-form deformation that the
    mesh does not have: their names and 8 corners (24 numbers; in 2D the first 4 count),
    ``ffd_degrees`` their degrees, ``ffd_orders`` the orders of B-splines.

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
    mesh_format: FileFormat | None = field(default=None, metadata=FILE_FORMATS)
    mesh_out_format: FileFormat | None = field(default=None, metadata=FILE_FORMATS)
    zone: int | None = None
    roles: Mapping[str, Role] = field(default_factory=dict)
    motions: tuple[Motion, ...] = ()
    ffd_boxes: tuple[tuple[str, tuple[float, ...]], ...] = ()
    ffd_degrees: tuple[tuple[int, int, int], ...] = ()
    ffd_blending: FfdBlending = field(default="BEZIER", metadata=FFD_BLENDINGS)
    ffd_orders: tuple[int, int, int] = (2, 2, 2)
    method: Method = field(default="rbf", metadata=METHODS)
    sliding: Sliding = field(default="none", metadata=SLIDING)
    periodic: PeriodicMode = field(default="none", metadata=PERIODIC_MODES)
    periodic_type: PeriodicType = field(default="auto", metadata=PERIODIC_TYPES)
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: int | None = None
    feature_angle_deg: float = 40.0
    curved: bool = False
    steps: int = 1
    steps_gain: float = 0.02
    influence_factor: float = 2.5
    kernel: str = field(default="wendland-c2", metadata=KERNELS)
    reduction: Reduction | None = AUTO
    idw_power: float | None = None
    idw_fixed_weight: float = 1.0
    quality_metric: Metric = field(default="knupp", metadata=METRICS)
    generate_quality: bool = True
    source: Path | None = None
    view: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_chosen(self)
        for name, kind, needed in _KINDS:
            if not isinstance(value := getattr(self, name), kind):
                raise CaseError(f"{name} is {value!r}; needed is {needed}")
        for marker, role in self.roles.items():
            if role not in ROLES:
                raise CaseError(f"roles: {marker!r}: {not_one_of(role, ROLES)}")
        for motion in self.motions:
            if not isinstance(motion, Motion):
                raise CaseError(f"motions: {motion!r} is none, as Translate(...) is")
        object.__setattr__(self, "motions", tuple(self.motions))
        given: object = self.steps
        if isinstance(given, str):
            if given.lower() != "auto":  # as in a case file
                raise CaseError(f'steps is {given!r}; needed is a whole number, or "auto"')
            object.__setattr__(self, "steps", 0)

    def change(self, **values: Any) -> Case:
        """Return the case with other values.

        Raises
        ------
        CaseError
            A case has no such value, or it is none of an enumeration.
        """
        names = [each.name for each in fields(self)]
        for name in values:
            if name not in names:
                raise CaseError(f"a case has no {name!r}{nearest(name, names)}")
        return replace(self, **values)

    def markers_with(self, role: Role) -> tuple[str, ...]:
        """Return the names that have this role, in order."""
        return tuple(name for name, given in self.roles.items() if given == role)

    def inputs(self) -> dict[Path, str]:
        """Return the files that the case is read from or names, and their roles in words."""
        found = {} if self.mesh_file is None else {self.mesh_file: "the input mesh"}
        if self.source is not None:
            found[self.source] = "the case file"
        files = (motion.path for motion in self.motions if isinstance(motion, FromFile))
        return found | dict.fromkeys(files, "a displacement file")

    @classmethod
    @takes(path=FILE)
    def read(cls, path: str | Path) -> Case:
        """Return the case that a ``.cfg`` file describes.

        Raises
        ------
        CaseError
            The file cannot be read, or has mistakes: all of them, each with its line.
        """
        from slideviz.case.cfg import read_case

        return read_case(Path(path))

    @takes(path=FILE)
    def write(self, path: str | Path) -> None:
        """Write the ``.cfg`` file, with paths relative to its folder."""
        from slideviz.case.cfg import write_case

        write_case(Path(path), self)
