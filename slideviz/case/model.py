"""The case: roles of the boundaries, motions, and the settings of the method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from slideviz import terms
from slideviz.argument_types import check_types, frozen
from slideviz.case.cfg import read_case, set_key, write_case
from slideviz.case.check import key_problems
from slideviz.case.fields import CaseFields
from slideviz.errors import CaseError, nearest, raise_all

_NUMBERS = (
    "zone", "axis", "span_axis", "origin", "feature_angle_deg", "steps", "steps_gain",
    "influence_factor", "support_radius", "reduction", "layer_thickness", "layer_minimum_gap",
    "repair_below", "idw_power", "idw_fixed_weight", "deform_coeff",
)  # fmt: skip
"""The fields of a case whose numbers must be in a range, which the table of keys has."""

NEW: dict[str, Any] = {"rims": "slide", "relax": "auto", "layers": "auto", "repair": "auto"}
"""Settings of new cases where those of a file without their keys are others, for its results."""


@frozen
class Case(CaseFields):
    """A deformation case, the content of a ``.cfg`` file.

    Markers of the mesh that are not in ``roles`` are fixed. Paths are absolute, or relative to the
    current folder. Of the other fields, of which ``slideviz keys`` has all:

    * ``reference_file``: the undeformed mesh, if ``mesh_file`` was deformed from it.
    * ``mesh_format``, ``mesh_out_format``: None: by the ending of the file.
    * ``axis``, ``origin``: direction and a point of the axis of rotational periodicity.
    * ``span``: hub and shroud, or root and tip of a wing, between which the span is from 0 to 1;
      None: by their names, or where the wing meets a flat boundary. ``span_axis``: the direction of
      a straight span; None: the normal of flat walls that do not turn about ``axis``.
    * ``direction``, ``curved``: RBF-SliDe's, without effect: both are found from the mesh.
      ``direction`` is 0, 1, 2 for x, y, z or r, theta, z, or None.
    * ``feature_angle_deg``: the angle in degrees from which a bend in a boundary is an edge; the
      default is ``DEFAULT_FEATURE_ANGLE_DEG`` of `slideviz.mesh.model`.
    * ``steps``: 0, or "auto", finds the number of steps; ``steps_gain`` is when to stop.
    * ``influence_factor``: the support radius over the extent of the mesh; 0, or "auto", fits it
      to the motion. ``support_radius``, if not None, is used instead: a length.
    * ``reduction``: None: all boundary nodes are control nodes, however many.
    * ``layer_thickness``: how far from walls ``layers`` acts: a length; 0, or "auto", finds it.
    * ``layer_minimum_gap``: the part of their height that cells beside layers keep before layers
      give way; 0: they never do.
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

    zone_settings: tuple[Case, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        usual = self.__dataclass_fields__
        if any(getattr(self, name) is not usual[name].default for name in _NUMBERS):
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

    def set(self, **keys: str) -> Case:
        """Return the case with other values of some keys, as texts like those of a case file.

        As with the option ``--set`` of the commands, a list of markers replaces all with that role.

        Raises
        ------
        CaseError
            There is no such key, or the value is wrong.

        Examples
        --------
        >>> import slideviz as sv
        >>> sv.Case().set(STEPS="5", MARKER_MOVING="( blade )").markers_with("moving")
        ('blade',)
        """
        case = self
        for key, text in keys.items():
            case = set_key(case, key, text, "set")
        return case

    def markers_with(self, role: terms.Role) -> tuple[str, ...]:
        """Return the names of the markers with a role, in the order of ``roles``."""
        return tuple(name for name, given in self.roles.items() if given == role)

    @property
    def around_span(self) -> tuple[object, ...]:
        """Return the fields of the case on which the span of a mesh depends."""
        roles = tuple(self.roles.items())
        return self.span, self.span_axis, self.axis, self.origin, self.periodic_type, roles

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
        if self.reference_file is not None:
            inputs[self.reference_file] = "the undeformed mesh"
        if self.source is not None:
            inputs[self.source] = "the case file"
        files = (path for motion in self.motions for path in motion.files)
        return inputs | dict.fromkeys(files, "a file of a motion")

    def with_paths(self, change: Callable[[Path], Path]) -> Case:
        """Return the case with changed paths of its meshes and of the files of its motions."""
        return self.change(
            mesh_file=change(self.mesh_file) if self.mesh_file else None,
            mesh_out=change(self.mesh_out) if self.mesh_out else None,
            reference_file=change(self.reference_file) if self.reference_file else None,
            motions=tuple(motion.with_files(change) for motion in self.motions),
        )

    @classmethod
    @check_types
    def read(cls, path: str | Path) -> Case:
        """Return the case that a ``.cfg`` file describes.

        Raises CaseError if the file cannot be read, or has mistakes: all of them, each with its
        line.
        """
        return read_case(Path(path), cls())

    @check_types
    def write(self, path: str | Path) -> None:
        """Write the ``.cfg`` file, with paths relative to its folder."""
        write_case(Path(path), self)
