"""Motions and meshes in words: a motion in full, or in few words that distinguish cases."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from slideviz.case.motions.motion import Motion, Target, named
from slideviz.mesh.model import Mesh, Skin
from slideviz.mesh.polyhedra import parts_words

if TYPE_CHECKING:
    from slideviz.case.model import Case

MOST_NAMED = 4  # most markers of a motion whose names are all in its words


def describe(motion: Motion, dim: int = 2, extent: float = 0.0) -> str:
    """Return a motion in a few words.

    ``dim``: dimensions of the mesh; in 3D a rotation has an axis. ``extent``: extent of the mesh:
    coordinates that are only rounding beside it are written as 0.
    """
    return f"{target_words(motion.marker)}: {motion.described(dim, extent)}"


def target_words(target: Target) -> str:
    """Return the markers that a motion moves, in words: of many the first ones, and a number."""
    names = named(target)
    more = len(names) - MOST_NAMED + 1
    if more > 1:
        names = (*names[: MOST_NAMED - 1], f"{more} more")
    return " + ".join(names) or "all moving"


def deformation(case: Case) -> tuple[object, ...]:
    """Return what cases must have in common to be compared: moving markers, and motions."""
    return frozenset(case.markers_with("moving")), case.motions


def motion_labels(cases: Sequence[Case]) -> list[str]:
    """Return a short label of the motions of each case; all are "" if all motions are the same.

    If the cases have equally many motions, labels contain only those that differ. Labels name
    boundaries only if several boundaries move. They contain points, axes and folders only if
    different motions would have the same label otherwise.
    """
    if len({case.motions for case in cases}) < 2:
        return [""] * len(cases)
    every = [case.motions for case in cases]
    if len({len(motions) for motions in every}) == 1:
        # What all have in common would push what differs out of a narrow list.
        places = [at for at, column in enumerate(zip(*every, strict=True)) if len({*column}) > 1]
        every = [tuple(motions[at] for at in places) for motions in every]
    several = len({motion.marker for motions in every for motion in motions} - {""}) > 1
    labels = [_label(motions, several, exact=False) for motions in every]
    alike: dict[str, set[object]] = {}
    for label, motions in zip(labels, every, strict=True):
        alike.setdefault(label, set()).add(motions)
    return [
        _label(motions, several, exact=True) if len(alike[label]) > 1 else label
        for label, motions in zip(labels, every, strict=True)
    ]


def _label(motions: Sequence[Motion], several: bool, exact: bool) -> str:
    parts = []
    for motion in motions:
        words = motion.label(".15g" if exact else ".4g", exact=exact)
        if exact:
            words += motion.about()
        with_target = several and bool(motion.marker)
        parts.append(f"{target_words(motion.marker)}: {words}" if with_target else words)
    return " + ".join(parts) or "no motion"


def mesh_words(mesh: Mesh) -> tuple[str, str]:
    """Return a line on a mesh, and further ones: halo, what is in memory, extreme coordinates."""
    halo = "" if mesh.halo is None else f"  (halo: {int(mesh.halo.cells.sum()):,})"
    about = "" if mesh.halo is None else f"With {mesh.halo.describe()}.\n"
    size, ends = bounds_words(mesh)
    points, cells = mesh.file_counts
    if mesh.whole_cells is not None:
        about += f"{parts_words(mesh.whole_cells)}.\n".lstrip(".\n")
    count = f"{cells:,} cells{halo}   {points:,} points"
    if isinstance(mesh, Skin):
        count += "   boundary and sections only"
        about += f"In memory: {len(mesh.cells):,} cells at the boundary; the rest is in its file.\n"
    return f"{mesh.dim}D   {count}   {size}", about + ends


def bounds_words(mesh: Mesh) -> tuple[str, str]:
    """Return the mesh's size along each axis, and its extreme coordinates; "" without points."""
    if not len(mesh.points):
        return "", ""
    low, high = mesh.bounds
    size = " × ".join(f"{value:.4g}" for value in high - low)
    rows = zip("xyz", low, high, high - low, strict=False)
    ends = (f"{axis} from {a:.6g} to {b:.6g}: {c:.6g}" for axis, a, b, c in rows)
    return size, "\n".join(["The undeformed mesh, in its length unit:", *ends])
