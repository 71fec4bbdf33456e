"""The results of a run: its progress, its steps, and the numbers of steps that STEPS= auto tried.

Steps are made in `slideviz.solver.stepping`, their number is chosen in `.solver`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as made_by

import numpy as np

from slideviz.mesh.model import IntArray, Mesh
from slideviz.rbf.field import Field
from slideviz.rbf.problem import Cycle


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Attributes
    ----------
    step, total : int
        The number of the current step, from 1, and of all steps.
    phase : str
        ``classify``, ``select``, ``solve``, ``evaluate``, ``project`` or ``correct``; in a streamed
        run also ``read``, ``quality`` and ``write``.
    fraction : float
        The part of the phase that is done, 0 to 1.
    left : float or None
        Estimate of the seconds that the whole run will still take; None where there is none.
    """

    step: int
    total: int
    phase: str
    fraction: float
    left: float | None = None


@dataclass(frozen=True)
class Trial:
    """A trial of STEPS= auto: a number of steps, and the quality it gave.

    Attributes
    ----------
    planned, steps : int
        Steps planned, and made: more where steps that folded cells were halved.
    min, mean : float
        Minimum and mean quality of the result.
    inverted : int
        Inverted cells of the result.
    """

    planned: int
    steps: int
    min: float
    mean: float
    inverted: int


@dataclass(frozen=True, eq=False)
class Step:
    """The mesh after one step.

    Attributes
    ----------
    index, total : int
        Number of the step, from 1, and of all steps.
    mesh : Mesh
        The deformed mesh.
    control_nodes : int
        Nodes in the interpolation system of this step, or of known displacement where a method
        has no such system.
    max_error : float
        Largest misfit at nodes of known or projected displacement before the correction sets them
        exactly, with data reduction that of all steps so far, in the mesh's length unit.
    condition : float
        Estimated condition number of the interpolation system; NaN where a method has none.
    node_counts : Mapping of str to int
        ``moving``, ``fixed``, ``sliding_edge``, ``sliding_surface``, ``internal``.
    seconds : Mapping of str to float
        Spent in this step, by phase; ``classify`` only in the first.
    warnings : tuple of str
        What the user should know of case, mesh and all steps so far.
    history : tuple of Cycle
        Convergence of the greedy selection in this step; empty without data reduction.
    tried : tuple of Trial
        The numbers of steps tried by STEPS= auto; empty but in the last step of such a run.
    control : (c,) int64
        The control nodes of this step; empty where a method has none.
    candidates : int
        Nodes that could have been control nodes; periodic images count as one.
    tolerance : float or None
        The tolerance of the data reduction, in the mesh's length unit; None where there was none.
    layers : float
        The tolerance that layers at moving boundaries need where it is smaller than ``tolerance``
        (`slideviz.solver.reduction.LAYER`); else 0.
    periodic_misfit : float or None
        Largest difference of the displacements of periodic images so far, in the mesh's length
        unit. It is rounding only, since more raises. None where images need not move alike.
    part : float
        The part of the whole displacement that is reached after this step, 0 to 1.
    support_radius : float or None
        Of the radial functions, in the mesh's length unit; None where a method has none.
    field : Field or None
        The function that displaced the nodes off the boundary in this step; kept in streamed runs.
    """

    index: int
    total: int
    mesh: Mesh
    control_nodes: int
    max_error: float
    condition: float
    node_counts: Mapping[str, int]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]
    history: tuple[Cycle, ...] = ()
    tried: tuple[Trial, ...] = ()
    control: IntArray = made_by(default_factory=lambda: np.empty(0, np.int64))
    candidates: int = 0
    tolerance: float | None = None
    layers: float = 0.0
    periodic_misfit: float | None = None
    part: float = 1.0
    support_radius: float | None = None
    field: Field | None = None
