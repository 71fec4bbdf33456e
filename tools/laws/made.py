"""A random mesh with what its maker knows of it: bodies, sides and periods."""

from __future__ import annotations

from dataclasses import dataclass

from slideviz.mesh.model import FloatArray, Mesh


@dataclass(frozen=True)
class Period:
    """How some markers repeat: by a shift, or by a rotation about an axis.

    Attributes
    ----------
    sides : tuple of (str, str)
        Markers, and those that are their images.
    vector : (d,) float64
        Zero for a rotation.
    angle_deg : float
        Zero for a shift.
    """

    sides: tuple[tuple[str, str], ...]
    vector: FloatArray
    angle_deg: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Made:
    """A mesh, and what its maker knows of it.

    Attributes
    ----------
    mesh : Mesh
    bodies : tuple of tuple of str
        Markers that make sense to move, those of one body together.
    periods : tuple of Period
        The ways in which the mesh repeats; a case can have one of them.
    """

    mesh: Mesh
    bodies: tuple[tuple[str, ...], ...]
    periods: tuple[Period, ...] = ()
