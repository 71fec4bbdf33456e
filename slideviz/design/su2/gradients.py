"""Gradients for design variables: sensitivities of all points, pulled back to the boundaries.

SU2's adjoint solver writes the sensitivities as restart files: these are read, and matched.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from itertools import starmap
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from slideviz.argument_types import record
from slideviz.case.lines import read_text
from slideviz.case.motions.airfoil import normals_at
from slideviz.case.words import is_number
from slideviz.design.deformer import Deformer
from slideviz.design.su2.config import Su2Config
from slideviz.design.su2.surface import MovingSurface, convex_part, make_surface
from slideviz.errors import CaseError, ConditionWarning, Remark, ToleranceWarning, note
from slideviz.mesh.model import (
    Assembly,
    FloatArray,
    IntArray,
    Mesh,
    largest_coordinate,
    largest_size,
)
from slideviz.mesh.topology import unit
from slideviz.solver.deform import deform
from slideviz.solver.steps import Report
from slideviz.system.file_checks import require_regular_file

MAGIC = 535532  # the first number of SU2's binary restart files
NAME_BYTES = 33  # length of a column's name in these files


def read_restart(path: Path) -> tuple[list[str], FloatArray]:
    """Return the columns' names of a restart, and its rows (n, c); CaseError if it is damaged."""
    require_regular_file(path, CaseError)
    with path.open("rb") as file:
        binary = file.read(4) == np.int32(MAGIC).tobytes()
    return _binary(path) if binary else _csv(path)


def angle_sensitivity(path: Path) -> float | None:
    """Return the derivative with respect to the angle of attack in degrees, or None.

    SU2 notes it at the end of a restart in text: ``SENS_AOA= 0.1``.
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 10_000))
        notes = file.read().decode("latin-1").splitlines()
    words = [line.partition("=")[2].strip() for line in notes if line.startswith("SENS_AOA")]
    return float(words[-1]) if words and is_number(words[-1]) else None


def _csv(path: Path) -> tuple[list[str], FloatArray]:
    text, _ = read_text(path, "file of sensitivities")
    head, _, body = text.partition("\n")
    # SU2 writes a comma behind the last number of a row, too.
    names = [name.strip().strip('"').strip() for name in _without_last_comma(head).split(",")]
    lines = [_without_last_comma(line) for line in body.splitlines()]
    while lines and not is_number(lines[-1].partition(",")[0].strip()):
        lines.pop()  # what SU2 notes at the end
    if not lines:
        raise CaseError(f"{path}: has no row of numbers; expected one for each point")
    try:
        table = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
    except ValueError:
        table = np.empty((0, 0))
    if table.shape[1:] != (len(names),):
        rows = enumerate((line.split(",") for line in lines), start=2)
        wrong = (
            k
            for k, row in rows
            if len(row) != len(names) or not all(is_number(cell.strip()) for cell in row)
        )
        line = next(wrong, 2)  # NumPy may refuse what is a number here
        raise CaseError(
            f"{path}:{line}: expected a number for each of the {len(names)} columns, separated by "
            "commas; decimals are written with a point"
        )
    return names, table


def _without_last_comma(line: str) -> str:
    return line.rstrip().removesuffix(",")


def _binary(path: Path) -> tuple[list[str], FloatArray]:
    """Return the names of the columns and the rows of a binary restart.

    Five ``int32``: 535532, columns, points and two more; a name of 33 bytes for each column; the
    numbers, point by point.
    """
    data = path.read_bytes()
    _, width, count = np.frombuffer(data[:12].ljust(12, b"\0"), np.int32).tolist()
    begin = 20 + NAME_BYTES * width
    if width < 1 or count < 0 or len(data) < begin + 8 * width * count:
        raise CaseError(f"{path}: is cut off: {width} columns of {count} points do not fit in it")
    names = [
        data[20 + NAME_BYTES * k : 20 + NAME_BYTES * (k + 1)].split(b"\0")[0].decode("latin-1")
        for k in range(width)
    ]
    table = np.frombuffer(data, np.float64, width * count, begin).reshape(count, width)
    return [name.strip().strip('"') for name in names], table


_OBJECTIVES = Path(__file__).with_name("objectives.csv").read_text(encoding="utf-8")
SUFFIXES = dict(line.split(",") for line in _OBJECTIVES.splitlines()[1:])
"""Suffixes that SU2 adds to the names of adjoint files, by objective; ``combo`` for several."""
SURFACE = "surface_sensitivity"
"""The column, in small letters, of derivatives along normals that SU2 writes for surfaces."""
EXACT = 1e-13
CLOSE = 1e-8
SAME = 1e-6
"""Differences of positions in a file from points, as a part of the largest coordinate: up to
``EXACT`` the file is of these points, above ``CLOSE`` there is a warning, above ``SAME`` the file
is of other points."""


@record
class Sensitivities:
    """Derivatives of an objective with respect to the points of a mesh."""

    path: Path
    values: FloatArray
    """(n, d), or (n, 1) for Surface_Sensitivity, along the normal out of the mesh: in the order of
    the mesh's points; if not ``ordered``, of the rows of the file."""
    points: FloatArray | None
    """(n, d): positions of the points, in the same order; None if the file has none."""
    ordered: bool = True


@record
class Matched:
    """Sensitivities in the order of a mesh's points."""

    values: FloatArray  # (n, d)
    at_design: bool
    """Whether they were computed at the design's points; else at those of the undeformed mesh."""
    warnings: tuple[Remark, ...] = ()


def read_sensitivities(config: Su2Config, mesh: Mesh, moving: IntArray) -> Sensitivities:
    """Read the sensitivities that a configuration names; ``moving`` (m,) are the moving nodes.

    Raises CaseError if the file is missing, lacks columns or points, or has a value that is not a
    number.
    """
    paths = sensitivity_files(config, mesh)
    if _is_unordered(config):
        return _unordered(paths, mesh)
    if not isinstance(mesh, Assembly):
        return _read(paths[0], mesh, moving)
    zone_results = [
        _read(path, p.mesh, moving[:0]) for path, p in zip(paths, mesh.parts, strict=True)
    ]
    if len({result.values.shape[1] for result in zone_results}) > 1:
        files = " and ".join(map(str, paths))
        raise CaseError(
            f"{files}: some have Sensitivity_x, ..., others Surface_Sensitivity only; write all "
            "with the same columns"
        )
    points = [result.points for result in zone_results if result.points is not None]
    ordered = all(result.ordered for result in zone_results) or len(points) < len(zone_results)
    return Sensitivities(
        paths[0],
        np.concatenate([result.values for result in zone_results]),
        np.concatenate(points) if len(points) == len(zone_results) else None,
        ordered,
    )


def _read(path: Path, mesh: Mesh, moving: IntArray) -> Sensitivities:
    names, table = read_restart(path)
    column = {name.lower(): place for place, name in enumerate(names)}
    wanted = [f"sensitivity_{letter}" for letter in "xyz"[: mesh.dim]]
    lacking = [f"Sensitivity_{name[-1]}" for name in wanted if name not in column]
    if lacking and SURFACE in column:
        wanted = [SURFACE]
    elif lacking:
        raise CaseError(
            f"{path}: has no column {', '.join(lacking)}, but {', '.join(names[:8])} ...; write it "
            "with SU2's discrete adjoint (OUTPUT_FILES= RESTART_ASCII)"
        )
    letters = [letter for letter in "xyz"[: mesh.dim] if letter in column]
    points = table[:, [column[letter] for letter in letters]]
    values = table[:, [column[name] for name in wanted]]
    if wanted == [SURFACE] and len(table) < len(mesh.points) and len(letters) == mesh.dim:
        _require_finite(path, values)
        return Sensitivities(path, values, points, ordered=False)  # SU2's file of the surface
    if len(table) != len(mesh.points) and len(table) == len(moving):
        raise CaseError(
            f"{path}: has {len(table)} points, as many as move of {mesh.name}; sensitivities at "
            "moving nodes only are read with DV_SENSITIVITY_FORMAT= UNORDERED_ASCII"
        )
    if len(table) != len(mesh.points):
        raise CaseError(
            f"{path}: has {len(table)} points, and {mesh.name} {len(mesh.points)}; it is of "
            "another mesh"
        )
    order = np.arange(len(table))
    if "pointid" in column:
        number = table[:, column["pointid"]]
        order = np.argsort(number, kind="stable")
        if not np.array_equal(number[order], np.arange(len(table))):
            raise CaseError(f"{path}: its PointID are not 0 to {len(table) - 1}, each once")
    _require_finite(path, values[order])
    return Sensitivities(path, values[order], points[order] if len(letters) == mesh.dim else None)


def _is_unordered(config: Su2Config) -> bool:
    """Return whether DV_SENSITIVITY_FORMAT says that rows are matched by position."""
    return bool(config.values["DV_SENSITIVITY_FORMAT"] == "UNORDERED_ASCII")


def sensitivity_files(config: Su2Config, mesh: Mesh) -> tuple[Path, ...]:
    """Return the paths of the files of sensitivities, or CaseError.

    An adjoint restart has the suffix of its objective in its name, and ends with ``.csv`` or
    ``.dat``. Each of several zones has one, with the number of the zone, from 0, before its ending.
    """
    zones = [(config.of_zone(k), f"_{k}") for k in range(mesh.zones)]
    if _is_unordered(config):
        names = (config_of_zone.files["DV_UNORDERED_SENS_FILENAME"] for config_of_zone, _ in zones)
        return tuple(dict.fromkeys(names))
    return tuple(starmap(_restart, zones)) if isinstance(mesh, Assembly) else (_restart(config),)


def _restart(config: Su2Config, zone: str = "") -> Path:
    adjoint_file = config.files["SOLUTION_ADJ_FILENAME"]
    objective = config.values["OBJECTIVE_FUNCTION"].strip("() ").upper()
    stem = adjoint_file.with_suffix("") if adjoint_file.suffix in (".csv", ".dat") else adjoint_file
    plain = stem.name
    suffix = "combo" if "," in objective else SUFFIXES.get(objective, "")
    stem = stem.with_name(stem.name + zone)
    stems = [stem.with_name(f"{plain}_{suffix}{zone}")] if suffix else []
    endings = [".csv", ".dat"]
    if config.values["READ_BINARY_RESTART"]:
        endings.reverse()
    tried = [base.with_name(base.name + end) for base in (*stems, stem) for end in endings]
    if not zone:
        tried.append(adjoint_file)
    for path in tried:
        if path.is_file():
            return path
    raise CaseError(
        f"{config.source}: there is no adjoint solution of OBJECTIVE_FUNCTION= {objective}: "
        f"none of {', '.join(map(str, tried))}; SOLUTION_ADJ_FILENAME names it"
    )


def match(
    sensitivities: Sensitivities,
    mesh: Mesh,
    moving: IntArray,
    markers: tuple[str, ...],
    design: Callable[[], FloatArray] | None,
) -> Matched:
    """Return sensitivities in the order of the mesh's points, and whether they are at the design.

    An adjoint solution belongs to the mesh that it was computed on: that of this design, whose
    points (n, d) ``design`` returns (None: it moves nothing), or MESH_FILENAME itself where that
    is deformed already, as in SU2's own loop. The points in the file decide. ``moving`` (m,) are
    the nodes of the boundaries that move, ``markers``; a file may have these only. Raises
    CaseError if the points in the file are neither, or several rows are at one point.
    """
    normal_only = sensitivities.values.shape[1] == 1
    if normal_only and not markers:
        raise CaseError(
            f"{sensitivities.path}: has Surface_Sensitivity only, which covers the surfaces in "
            "DV_MARKER, but the design variables move the whole mesh; give Sensitivity_x, "
            "Sensitivity_y, ..."
        )
    design = None if design is None else cache(design)
    if sensitivities.points is None:
        sentence = (
            f"{sensitivities.path} has no coordinates; its rows are taken at this design's points"
        )
        positions = mesh.points if design is None or not normal_only else design()
        return Matched(
            _vectors(sensitivities.values, mesh, positions, moving, markers), True, (sentence,)
        )
    gap, rows, at_design = _rows_at(sensitivities, mesh, design)
    for interface in mesh.interfaces if isinstance(mesh, Assembly) else ():
        # A place with one row of two nodes: the row is that of the node that moves.
        alone = np.isin(interface.nodes, rows) & ~np.isin(interface.partners, rows)
        alone &= np.isin(interface.partners, moving) & ~np.isin(interface.nodes, moving)
        place = np.arange(len(mesh.points))
        place[interface.nodes[alone]] = interface.partners[alone]
        rows = place[rows]
    notes = list[Remark]()
    if gap > CLOSE * largest_coordinate(mesh.points):
        where = "this design" if at_design else mesh.name
        notes.append(
            f"{sensitivities.path}: its points differ from {where} by {gap:.2g}: is the file older?"
        )
    values = np.zeros((len(mesh.points), sensitivities.values.shape[1]))
    index, counts = np.unique(rows, return_counts=True)
    if (counts > 1).any():
        node = index[int(np.argmax(counts))]
        raise CaseError(
            f"{sensitivities.path}: several rows are at the point {node}; one each is needed"
        )
    values[rows] = sensitivities.values
    missing = len(mesh.points) - len(index)
    if missing:
        lost = len(np.setdiff1d(moving, index))
        of = f", {lost} of the {len(moving)} moving nodes among them" if lost else ""
        sentence = (
            f"{sensitivities.path}: {missing} points of the mesh are not in it{of}; taken as 0"
        )
        expected = np.array_equal(index, moving) or (normal_only and not lost)
        notes.append(note(sentence) if expected else sentence)
    positions = design() if design is not None and at_design and normal_only else mesh.points
    return Matched(_vectors(values, mesh, positions, moving, markers), at_design, tuple(notes))


def _rows_at(
    sensitivities: Sensitivities, mesh: Mesh, design: Callable[[], FloatArray] | None
) -> tuple[float, IntArray, bool]:
    """Return how far points in the file are off, the node of each row, and whether at the design.

    Raises CaseError if they are neither those of the mesh nor those of the design.
    """
    unit = largest_coordinate(mesh.points)
    gap, rows = _nearest(sensitivities, mesh.points)
    at_design = design is None
    if design is not None and gap > EXACT * unit:
        there, others = _nearest(sensitivities, design())
        if there <= gap:
            gap = there
            rows = others
            at_design = True
    if gap > SAME * unit:
        raise CaseError(
            f"{sensitivities.path}: its points match neither {mesh.name} nor this design (they "
            f"differ by {gap:.3g}); run the adjoint solver on the mesh that `slideviz def` writes"
        )
    return gap, rows, at_design


def _vectors(
    values: FloatArray, mesh: Mesh, points: FloatArray, moving: IntArray, markers: tuple[str, ...]
) -> FloatArray:
    """Return derivatives by position (n, d) of those along normals out of the mesh (n, 1).

    As SU2_DOT takes Surface_Sensitivity (``SetProjection_FD``): at the moving nodes (m,), with the
    normals of the median-dual mesh, when the points are at ``points`` (n, d). Others (n, d) are
    returned as they are.
    """
    if values.shape[1] > 1:
        return values
    out = np.zeros(points.shape)
    normals = unit(normals_at(mesh.with_points(points), markers, moving))
    out[moving] = -values[moving] * normals
    return out


def _nearest(sensitivities: Sensitivities, points: FloatArray) -> tuple[float, np.ndarray]:
    """Return the largest distance to a nearest point, and that point for each row of the file."""
    assert sensitivities.points is not None
    if sensitivities.ordered:
        gap = np.abs(sensitivities.points - points)
        return float(gap.max(initial=0.0)), np.arange(len(points))
    far, rows = map(np.asarray, cKDTree(points).query(sensitivities.points))
    # Nodes of several zones may be in one place: each has a row, or the first of them.
    again = np.setdiff1d(np.arange(len(rows)), np.unique(rows, return_index=True)[1])
    left = np.setdiff1d(np.arange(len(points)), rows)
    if len(again) and len(left):
        gaps, others = map(np.asarray, cKDTree(points[left]).query(sensitivities.points[again]))
        near = gaps <= SAME * largest_coordinate(points)
        rows[again[near]] = left[others[near]]
        far[again[near]] = gaps[near]
    return float(np.max(far, initial=0.0)), rows


def _unordered(paths: Sequence[Path], mesh: Mesh) -> Sensitivities:
    path = paths[0]
    rows = [row for file in paths for row in _rows(file) if row]
    dim = mesh.dim
    width = len(rows[0]) if rows else 0
    if width not in {6, 2 * dim} or any(len(row) != width for row in rows):
        raise CaseError(f"{path}: expected rows x, y, z, dJ/dx, dJ/dy, dJ/dz of numbers")
    table = np.array(rows)
    values = table[:, width // 2 : width // 2 + dim]
    _require_finite(path, table)
    return Sensitivities(path, values, table[:, :dim], ordered=False)


def _rows(path: Path) -> Iterator[list[float]]:
    text, _ = read_text(path, "file of sensitivities")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.replace(",", " ").split()
        if not words or not is_number(words[0]):
            continue
        try:
            yield [float(word) for word in words]
        except ValueError:
            raise CaseError(f"{path}:{number}: has a value that is not a number") from None


def _require_finite(path: Path, values: FloatArray) -> None:
    if not np.isfinite(values).all():
        row = int(np.argmax(~np.isfinite(values).all(axis=1)))
        raise CaseError(f"{path}: the sensitivity of point {row} is not finite; did SU2 diverge?")


DIRECTIONS = 16  # most displacements for which control nodes are chosen at a design of zeros
REACH = 1e-3  # size of these displacements, as a part of the mesh's extent

INSUFFICIENT = (
    "boundary nodes still get exactly their displacement, and the gradient belongs to such a "
    "deformation; see what `slideviz def` warns of"
)


@record
class Gradients:
    """Gradients of an objective at a design."""

    surface: FloatArray
    """(m, d): with respect to the displacement of each moving node, with all inner points
    following."""
    variables: FloatArray  # (v,): with respect to each value of the design variables
    points: FloatArray  # (m, d): positions of the moving nodes at the design
    at_design: bool
    """Whether the design is that of the configuration; else it is the undeformed mesh."""
    source: str  # path of the sensitivities
    warnings: tuple[Remark, ...]


def design_gradients(
    config: Su2Config, mesh: Mesh, progress: Report | None
) -> tuple[MovingSurface, Gradients]:
    """Return the moving boundaries of a configuration, and the gradients (`find_gradients`).

    With CONVEXITY_CHECK both are of the part of the design that `slideviz def` does; gradients are
    with respect to the values in the configuration.
    """
    if not config.values["CONVEXITY_CHECK"]:
        surface = make_surface(config, mesh)
        return surface, find_gradients(surface, progress)

    def attempt(config: Su2Config) -> tuple[MovingSurface, Mesh]:
        surface = make_surface(config, mesh)
        if surface.moves_whole_mesh or not surface.displacement.any():
            return surface, surface.moved()
        *_, last = deform(surface.case(), mesh, progress, converged=True)
        return surface, last.mesh

    part, (surface, _), messages = convex_part(config, mesh, attempt, lambda each: each[1])
    gradients = find_gradients(surface, progress)
    variables = part * gradients.variables if gradients.at_design else gradients.variables
    return surface, replace(
        gradients, variables=variables, warnings=(*gradients.warnings, *messages)
    )


def find_gradients(surface: MovingSurface, progress: Report | None) -> Gradients:
    """Return the gradients of the objective whose sensitivities the configuration names.

    Raises SlidevizError if the sensitivities are missing or of another mesh, or the deformation is
    not possible. The warnings of the `Deformer` are among the warnings of the result.
    """
    mesh = surface.mesh
    markers = surface.config.markers
    sensitivities = read_sensitivities(surface.config, mesh, surface.nodes)
    displacement = surface.displacement
    if surface.moves_whole_mesh:
        matched = match(sensitivities, mesh, surface.nodes, (), lambda: surface.moved().points)
        moved = displacement if matched.at_design else np.zeros_like(displacement)
        warnings = (*surface.case().warnings, *matched.warnings)
        return _gradients(surface, sensitivities, matched, matched.values, moved, warnings)
    moves = bool(displacement.any())
    prepared: list[Deformer] = []
    written: list[FloatArray] = []

    def design() -> FloatArray:  # as `slideviz def` writes it
        prepared.append(_deformer(surface, displacement, progress))
        points = prepared[0].as_run()
        if points is None:
            *_, last = deform(surface.case(), mesh, progress, converged=True)
            points = last.mesh.points
        written.append(points)
        return points

    messages: list[Remark] = []
    with _heard(messages):
        matched = match(sensitivities, mesh, surface.nodes, markers, design if moves else None)
        if moves and not matched.at_design:
            displacement = np.zeros_like(displacement)
            prepared.clear()
        deformer = (prepared or [_deformer(surface, displacement, progress)])[0]
        if written and matched.at_design:
            messages += _difference(deformer.deform(displacement), written[0])
        pulled = deformer.vjp(displacement, matched.values)
    messages = [*deformer.warnings, *matched.warnings, *dict.fromkeys(messages)]
    return _gradients(surface, sensitivities, matched, pulled, displacement, messages)


def _gradients(
    surface: MovingSurface,
    found: Sensitivities,
    matched: Matched,
    pulled: FloatArray,
    displacement: FloatArray,
    said: Sequence[Remark],
) -> Gradients:
    """Return the gradients from that for each moving node, ``pulled`` (m, d)."""
    slopes = (
        surface.slope(place, part, undeformed=not matched.at_design)
        for place, part in surface.values
    )
    gradient = np.array([float((pulled * slope).sum()) for slope in slopes])
    angles = np.array([surface.config.variables[place].is_angle for place, _ in surface.values])
    if angles.any():
        rate = angle_sensitivity(found.path)
        gradient[angles] = rate or 0.0
        lacks = (
            f"{found.path} has no SENS_AOA= (SU2's text files have it): 0 is written for the angle"
        )
        said = [*said, lacks] if rate is None else said
    return Gradients(
        surface=pulled,
        variables=gradient,
        points=surface.mesh.points[surface.nodes] + displacement,
        at_design=matched.at_design,
        source=str(found.path),
        warnings=tuple(said),
    )


@contextmanager
def _heard(said: list[Remark]) -> Iterator[None]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ConditionWarning)
        warnings.simplefilter("always", ToleranceWarning)
        yield
    for one in caught:
        assert isinstance(one.message, Warning)
        if one.category is ConditionWarning:
            said.append(one.message.args[0])  # a `note`, where little
        elif one.category is ToleranceWarning:  # its remedy is one for Python
            said.append(f"{one.message.args[0].rule}; {INSUFFICIENT}")
        else:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)


def _difference(found: FloatArray, written: FloatArray) -> list[str]:
    """Return a message if ``found`` (n, d) is not what ``slideviz def`` writes; else none."""
    gap = largest_size(found - written)
    if gap <= CLOSE * largest_coordinate(written):
        return []
    messages = f"the gradient belongs to a deformation whose points differ by up to {gap:.2g} from"
    return [f"{messages} the points that `slideviz def` writes"]


def _deformer(
    surface: MovingSurface, displacement: FloatArray, progress: Report | None
) -> Deformer:
    """Return a deformer made at ``displacement`` (m, d); if zero, also for `_directions`."""
    reference = displacement[None]
    if not displacement.any():
        reference = np.concatenate([reference, _directions(surface)])
    deformer = Deformer(surface.mesh, surface.case(), reference, progress)
    assert np.array_equal(deformer.nodes, surface.nodes)
    return deformer


def _directions(surface: MovingSurface) -> FloatArray:
    """Return k displacements (k, m, d), `DIRECTIONS` sums of all variables, each up to `REACH`."""
    sums: list[FloatArray] = []
    for k, (place, part) in enumerate(surface.values):
        slope = surface.slope(place, part, undeformed=True)
        largest = largest_size(slope)
        unit = slope * (REACH * surface.mesh.extent / largest) if largest else slope
        if len(sums) < DIRECTIONS:
            sums.append(np.array(unit))
        else:
            sums[k % DIRECTIONS] += unit
    moving = [each for each in sums if each.any()]
    if not moving:  # such as an angle of attack: any displacement tells how the rest follows
        moving = [np.full((len(surface.nodes), surface.mesh.dim), REACH * surface.mesh.extent)]
    return np.array(moving).reshape(-1, len(surface.nodes), surface.mesh.dim)
