"""What a run gives: its progress, its steps, and the numbers of steps that it tried."""

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
    """How far the work is.

    Attributes
    ----------
    step, total : int
        The step in work (from 1), and all steps.
    phase : str
        ``classify``, ``select``, ``solve``, ``evaluate``, ``project`` or ``correct``.
    fraction : float
        Of the phase, 0 to 1.
    left : float or None
        Seconds that all the work may still take, where that is known.
    """

    step: int
    total: int
    phase: str
    fraction: float
    left: float | None = None


@dataclass(frozen=True)
class Trial:
    """A number of steps that STEPS= auto tried.

    Attributes
    ----------
    planned, steps : int
        Steps asked for, and made: more where folding steps were halved.
    min, mean : float
        Quality of the result.
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
        Nodes in the interpolation system of this step.
    max_error : float
        Largest misfit at nodes of known displacement before they are set exactly, in the mesh's
        length unit.
    condition : float
        Estimated condition number of the interpolation system.
    node_counts : Mapping of str to int
        ``moving``, ``fixed``, ``sliding_edge``, ``sliding_surface``, ``internal``.
    seconds : Mapping of str to float
        Spent in this step, by phase; ``classify`` only in the first.
    warnings : tuple of str
        What the user should know; those of all steps so far.
    history : tuple of Cycle
        Convergence of the greedy selection in this step; empty without data reduction.
    tried : tuple of Trial
        The numbers of steps tried by STEPS= auto, in the last step of the run.
    control : (c,) int64
        The control nodes of this step; empty where a method has none.
    candidates : int
        Nodes that could have been control nodes; periodic images count as one.
    tolerance : float or None
        Of the data reduction, in the mesh's length unit; None where there was none.
    periodic_misfit : float or None
        Largest difference of the displacements of periodic images so far, in the mesh's length
        unit: rounding, for more is an error. None where images need not move alike.
    part : float
        Of the whole displacement, after this step.
    field : Field or None
        What displaced the nodes that are no boundary, where a run keeps it.
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
    periodic_misfit: float | None = None
    part: float = 1.0
    field: Field | None = None
