"""Configurations of SU2 on their mesh: boundaries that it lacks, and CONFIG_LIST for its zones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from slideviz.case.check import unknown_markers
from slideviz.case.zone_cases import renamed, with_marker_names
from slideviz.design.su2.config import ROLE_KEYS, Su2Config
from slideviz.design.su2.variables import NOTHING
from slideviz.errors import CaseError, Remark, nearest, raise_all
from slideviz.formats.files import read
from slideviz.mesh.model import Assembly, IntArray, Marker, Mesh
from slideviz.mesh.zones import join_zones, names_in, numbered, spellings

PASSED_OVER = {*ROLE_KEYS, "MARKER_DEFORM_MESH"}
"""Keys whose markers are ignored if the mesh does not have them."""
_NO_MARKER = "{}: DV_MARKER names no boundary; nothing would move"
UNMIXED = {"boxes", "grid"}  # groups of variables that all zones have, or none


def read_mesh(config: Su2Config) -> Mesh:
    """Return the mesh of a configuration: of all zones, those of several files, too.

    With MULTIZONE_MESH= NO each zone is the mesh that its configuration names.
    """
    file = config.case.mesh_file
    form = config.case.mesh_format
    assert file is not None
    if config.values["MULTIZONE_MESH"] or not config.zones:
        raise_all(
            f"{zone_config.source}: MESH_FILENAME= {zone_config.case.mesh_file}, and with "
            f"MULTIZONE_MESH= YES all zones are in one file, {file}; leave the key out there, or "
            "write NO"
            for zone_config in config.zones
            if zone_config.case.mesh_file != file
        )
        return read(file, zone=config.case.zone, file_format=form)
    meshes = []
    for zone_config in config.zones:
        assert zone_config.case.mesh_file is not None
        mesh = read(zone_config.case.mesh_file, file_format=zone_config.case.mesh_format)
        if mesh.zones > 1:
            raise CaseError(
                f"{zone_config.source}: {mesh.name} has {mesh.zones} zones, and with "
                "MULTIZONE_MESH= NO it is one; write YES, or name a file for each zone"
            )
        meshes.append(replace(mesh, zone=zone_config.zone, zones=len(config.zones)))
    return join_zones(meshes)


def on_mesh(config: Su2Config, mesh: Mesh) -> Su2Config:
    """Return the configuration without markers that the mesh lacks, with a warning for each key.

    A periodic pair of which one is missing stays, and so does all that would move where all of it
    is missing: `problems_of_markers` tells them. Boundaries get the names that they have in the
    mesh, where they are written as ``1:blade``; those in CONFIG_LIST, which are of one zone,
    always. Raises CaseError if CONFIG_LIST is not one for each zone.
    """
    if not config.zones:
        return _without_missing(_renamed(config, spellings(mesh)), mesh)
    if len(config.zones) != mesh.zones:
        raise CaseError(
            f"{config.source}: CONFIG_LIST has {len(config.zones)} configurations, and {mesh.name} "
            f"{mesh.zones} zones; give one for each"
        )
    if not isinstance(mesh, Assembly):
        return on_mesh(replace(config, zones=()), mesh)
    zones = tuple(
        _without_missing(_in_zone(zone_config, mesh), mesh) for zone_config in config.zones
    )
    still = tuple(map(_as_still, zones))
    asked = {zone_config.variables[0].group for zone_config in zones}
    moves = {zone_config.variables[0].group for zone_config in still}
    if moves == {"nothing"} != asked:
        raise CaseError(_NO_MARKER.format(config.source))
    return joined(replace(config, case=with_marker_names(config.case, mesh)), still)


def _renamed(
    config: Su2Config, names: Mapping[str, str], without: frozenset[str] = frozenset()
) -> Su2Config:
    """Return a configuration with other names of boundaries, and without some."""
    case = config.case.change(
        roles={name: role for name, role in config.case.roles.items() if name not in without},
        limits=tuple(
            zone_config for zone_config in config.case.limits if zone_config.marker not in without
        ),
    )
    return replace(
        config,
        case=renamed(case, names),
        markers=tuple(names.get(name, name) for name in config.markers if name not in without),
        named={names.get(n, n): key for n, key in config.named.items() if n not in without},
    )


def _in_zone(config: Su2Config, mesh: Mesh) -> Su2Config:
    """Return the configuration of a zone without boundaries of others, named as in the mesh."""
    assert config.zone is not None
    part = mesh.parts[config.zone - 1]
    ours = {file: name for name, file in names_in(mesh, part).items()}
    ours |= {numbered(config.zone, file): name for file, name in ours.items()}
    files = {name for other in mesh.parts for name in other.mesh.marker_names}
    return _renamed(config, ours, frozenset({*files, *spellings(mesh)} - ours.keys()))


def _as_still(config: Su2Config) -> Su2Config:
    """Return a configuration as one that moves nothing, if it does not, as in SU2."""
    group = config.variables[0].group
    if group != "nothing" and (config.markers or group == "grid"):
        return config
    roles = {name: role for name, role in config.case.roles.items() if role != "moving"}
    case = config.case.change(roles=roles)
    return replace(config, case=case, markers=(), variables=NOTHING)


def joined(config: Su2Config, zones: tuple[Su2Config, ...]) -> Su2Config:
    """Return the configuration of all zones.

    Zones that have the same design variables share them, as in SU2.
    """
    moving = [
        zone_config for zone_config in zones if zone_config.variables[0].group != "nothing"
    ] or [*zones[:1]]
    groups = {zone_config.variables[0].group: zone_config for zone_config in moving}
    if len(groups) > 1 and groups.keys() & UNMIXED:
        kinds = " and ".join(zone_config.variables[0].kind for zone_config in groups.values())
        raise CaseError(f"{config.source}: zones have {kinds}, which need a run each; make two")
    checked = [zone_config for zone_config in moving if zone_config.values["CONVEXITY_CHECK"]]
    boxes = {
        box: degrees
        for zone_config in zones
        for box, degrees in zip(
            zone_config.case.ffd_boxes, zone_config.case.ffd_degrees, strict=False
        )
    }
    case = moving[0].case.change(
        source=config.source,
        mesh_file=config.case.mesh_file,
        mesh_out=config.case.mesh_out,
        interfaces=config.case.interfaces,
        roles={
            name: role for zone_config in zones for name, role in zone_config.case.roles.items()
        },
        limits=tuple(
            dict.fromkeys(limit for zone_config in zones for limit in zone_config.case.limits)
        ),
        ffd_boxes=tuple(boxes),
        ffd_degrees=tuple(boxes.values()),
        warnings=tuple(
            dict.fromkeys(
                (
                    *config.case.warnings,
                    *(text for zone_config in zones for text in zone_config.case.warnings),
                )
            )
        ),
    )
    return replace(
        config,
        case=case,
        markers=tuple(name for zone_config in moving for name in zone_config.markers),
        variables=tuple(chain(*dict.fromkeys(zone_config.variables for zone_config in moving))),
        values=(checked or moving)[0].values,
        named={name: key for zone_config in zones for name, key in zone_config.named.items()},
        zones=tuple(
            replace(zone_config, beside=tuple(other for other in zones if other is not zone_config))
            for zone_config in zones
        ),
    )


def _without_missing(config: Su2Config, mesh: Mesh) -> Su2Config:
    lacking = [name for name in config.named if name not in mesh.marker_names]
    passed = {name: key for name in lacking if (key := config.named[name]) in PASSED_OVER}
    roles = config.case.roles
    if sum(roles[name] == "periodic" for name in passed) % 2:
        # Without its partner, the other one could not repeat.
        passed = {name: key for name, key in passed.items() if roles[name] != "periodic"}
    markers = tuple(name for name in config.markers if name not in passed)
    if not markers:
        passed = {name: key for name, key in passed.items() if name not in config.markers}
        markers = config.markers
    named = {name: key for name, key in config.named.items() if name not in passed}
    left = {name: role for name, role in roles.items() if name not in passed}
    case = config.case.change(
        roles=left, warnings=(*config.case.warnings, *_warnings(config, mesh, passed))
    )
    if passed and "periodic" not in left.values():
        case = case.change(periodic="none")
        if "sliding" not in left.values():
            case = case.change(sliding="none")
    return replace(config, case=case, named=named, markers=markers)


def zone_of(config: Su2Config, mesh: Mesh) -> tuple[IntArray, tuple[Marker, ...]]:
    """Return the nodes and the boundaries of the zone that a configuration is of, or all."""
    points = slice(0, len(mesh.points))
    markers = slice(None)
    if config.zone is not None:
        part = mesh.parts[config.zone - 1]
        points = part.points
        markers = part.markers
    return np.arange(points.start, points.stop), mesh.markers[markers]


def problems_of_markers(config: Su2Config, mesh: Mesh, needed: bool = True) -> Sequence[Remark]:
    """Return that nothing would move, if some are ``needed``, or each that the mesh lacks."""
    if needed and not config.markers:
        return [_NO_MARKER.format(config.source)]
    return CaseError(*unknown_markers(mesh, config.named)).within(config.source)


def _warnings(config: Su2Config, mesh: Mesh, passed: dict[str, str]) -> list[str]:
    """Return a warning for each key with ignored markers; ``passed`` maps these to keys."""
    messages = []
    for key in dict.fromkeys(passed.values()):
        names = [name for name in passed if passed[name] == key]
        close = nearest(names[0], mesh.marker_names) if len(names) == 1 else ""
        messages.append(
            f"{config.source}: {key}: {mesh.name} has no marker {' or '.join(map(repr, names))}: "
            f"ignored, as in SU2{close}"
        )
    return messages
