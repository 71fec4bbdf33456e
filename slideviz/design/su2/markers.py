"""Markers that a configuration of SU2 names, but the mesh does not have.

One configuration often serves several meshes, so SU2 ignores such markers of some keys.
"""

from __future__ import annotations

from dataclasses import replace

from slideviz.case.check import unknown_markers
from slideviz.design.su2.config import ROLE_KEYS, Su2Config
from slideviz.errors import nearest
from slideviz.mesh.model import Mesh

PASSED_OVER = {*ROLE_KEYS, "MARKER_DEFORM_MESH"}
"""Keys whose markers are ignored if the mesh does not have them."""


def on_mesh(config: Su2Config, mesh: Mesh) -> Su2Config:
    """Return the configuration without markers that the mesh lacks, with a warning for each key.

    A periodic pair of which one is missing stays, and so does all that would move where all of it
    is missing: `problems_of_markers` tells them.
    """
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


def problems_of_markers(config: Su2Config, mesh: Mesh, needed: bool = True) -> list[str]:
    """Return that nothing would move, if some are ``needed``, or each that the mesh lacks."""
    if needed and not config.markers:
        return [f"{config.source}: DV_MARKER names no boundary; nothing would move"]
    return [f"{config.source}: {text}" for text in unknown_markers(mesh, config.named)]


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
