"""OpenMDAO and MPhys: the deformation of a mesh as a component, with exact derivatives.

`MeshDeformation` is the component between one that gives the surface (a parametrisation or a
structure) and one that needs the mesh (a flow solver). `MeshDeformationBuilder` puts it into the
scenarios of MPhys, alone or before the flow solver of another builder. Variables have the names and
tags of MPhys 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slideviz.errors import SlidevizError
from slideviz.mesh.quality import quality
from slideviz.mesh.quality_derivative import smooth_margin

try:
    import openmdao.api as om
    from mphys import Builder, MPhysGroup, MPhysVariables
except ImportError as problem:
    raise ImportError(
        "slideviz.openmdao needs OpenMDAO and MPhys, and cannot load them "
        f"({problem}); install them with: pip install 'slideviz[openmdao]'"
    ) from problem

from collections.abc import Sequence

from slideviz.design.deformer import Deformer
from slideviz.mesh.model import FloatArray, IntArray

Slope = tuple[float, "FloatArray"]  # a number, and its derivative by the points (n, d)
SURFACE = MPhysVariables.Aerodynamics.Surface.COORDINATES
MESH_SURFACE = MPhysVariables.Aerodynamics.Surface.Mesh.COORDINATES
VOLUME = "aero_vol_coords"
MINIMUM = "minimum_quality"
MEAN = "mean_quality"
MARGIN = "minimum_margin"


class MeshDeformation(om.ExplicitComponent):  # type: ignore[misc]
    """OpenMDAO component that computes all points of a mesh from those of its moving surface.

    The input ``x_aero`` (m d,) has the *current* coordinates of the moving nodes, in the order of
    ``deformer.nodes``, not their displacement. The output ``aero_vol_coords`` (n d,) has all
    points. Both are flat, and in the mesh's length unit. With ``quality=True`` there are two more
    outputs, ``minimum_quality``, the smooth minimum (`slideviz.QualityDerivative`), and
    ``mean_quality``. With ``margin=True`` there is ``minimum_margin``, the smooth minimum of the
    margins, which is 0 where the first cell folds (`slideviz.Deformer.constraint`).

    Products with the Jacobian, forward and reverse, are those of the deformer: exact for its frozen
    choices, such as the control nodes. These are made at the deformer's reference; to renew them,
    set the option ``deformer`` to ``deformer.refresh(displacement)``.

    Variables are not distributed: it is made for one process.

    Options: ``deformer``, a `slideviz.Deformer`; ``quality``; ``margin``; ``p``, the exponent of
    the smooth minima. Errors of the deformer become an `openmdao.api.AnalysisError`, after which an
    optimiser may try another design.
    """

    def initialize(self) -> None:
        """Declare the options."""
        self.options.declare("deformer", recordable=False, desc="what deforms the mesh")
        self.options.declare("quality", False, types=bool, desc="whether it has the quality too")
        self.options.declare("margin", False, types=bool, desc="whether it has the margin too")
        self.options.declare("p", 50.0, types=(int, float), desc="exponent of the smooth minimum")

    def setup(self) -> None:
        """Declare the variables, with the undeformed mesh as their values."""
        self._measured: tuple[Deformer, FloatArray, dict[str, Slope]] | None = None
        deformer = self.options["deformer"]
        points = deformer.mesh.points
        self.add_input(
            SURFACE,
            points[deformer.nodes].ravel(),
            tags=["mphys_coupling"],
            desc="coordinates of the moving nodes",
        )
        self.add_output(
            VOLUME, points.ravel(), tags=["mphys_coupling"], desc="coordinates of all points"
        )
        if self.options["quality"]:
            self.add_output(MINIMUM, tags=["mphys_result"], desc="smooth minimum of the quality")
            self.add_output(MEAN, tags=["mphys_result"], desc="mean quality")
        if self.options["margin"]:
            self.add_output(MARGIN, tags=["mphys_result"], desc="smooth minimum of the margins")

    def compute(self, inputs: Any, outputs: Any) -> None:
        """Deform the mesh, and write points and qualities to ``outputs``."""
        deformer, displacement = self._at(inputs)
        try:
            points = deformer.deform(displacement)
            outputs[VOLUME] = points.ravel()
            for name, (value, _) in self._measure(displacement, points).items():
                outputs[name] = value
        except SlidevizError as problem:
            raise om.AnalysisError(str(problem)) from problem

    def compute_jacvec_product(self, inputs: Any, d_inputs: Any, d_outputs: Any, mode: str) -> None:
        """Add the product with the Jacobian to ``d_outputs``, or its transpose to ``d_inputs``."""
        if SURFACE not in d_inputs:
            return
        deformer, displacement = self._at(inputs)
        slopes = {}
        if any(name in d_outputs for name in (MINIMUM, MEAN, MARGIN)):
            slopes = {name: slope for name, (_, slope) in self._measure(displacement).items()}
        if mode == "fwd":
            moved = deformer.jvp(displacement, d_inputs[SURFACE].reshape(displacement.shape))
            if VOLUME in d_outputs:
                d_outputs[VOLUME] += moved.ravel()
            for name, slope in slopes.items():
                if name in d_outputs:
                    d_outputs[name] += (slope * moved).sum()
            return
        weights = np.zeros(deformer.mesh.points.shape)
        if VOLUME in d_outputs:
            weights += d_outputs[VOLUME].reshape(weights.shape)
        for name, slope in slopes.items():
            if name in d_outputs:
                weights += d_outputs[name] * slope
        d_inputs[SURFACE] += deformer.vjp(displacement, weights).ravel()

    def _at(self, inputs: Any) -> tuple[Deformer, FloatArray]:
        """Return the deformer and the displacement (m, d) of its moving nodes."""
        deformer = self.options["deformer"]
        start = deformer.mesh.points[deformer.nodes]
        return deformer, np.asarray(inputs[SURFACE]).reshape(start.shape) - start

    def _measure(
        self, displacement: FloatArray, points: FloatArray | None = None
    ) -> dict[str, Slope]:
        """Return the numbers that are outputs at a displacement (m, d); the last ones are cached.

        ``points`` (n, d) are those of the deformed mesh, if known.
        """
        deformer = self.options["deformer"]
        kept = self._measured
        options = self.options
        if kept is None or kept[0] is not deformer or not np.array_equal(kept[1], displacement):
            found: dict[str, Slope] = {}
            if options["quality"] or options["margin"]:
                base = deformer.mesh
                mesh = base.with_points(deformer.deform(displacement) if points is None else points)
            if options["quality"]:
                metric = deformer.case.quality_metric
                slope = quality(mesh, base, metric, derivative=True, p=options["p"]).derivative
                assert slope is not None
                found[MINIMUM] = slope.minimum, slope.of_minimum
                found[MEAN] = slope.mean, slope.of_mean
            if options["margin"]:
                margin = smooth_margin(mesh, base, options["p"])
                found[MARGIN] = margin.value, margin.of_points
            kept = self._measured = deformer, displacement.copy(), found
        return kept[2]


class MeshSurface(om.IndepVarComp):  # type: ignore[misc]
    """OpenMDAO component whose output ``x_aero0_mesh`` (m d,) is the undeformed moving surface."""

    def initialize(self) -> None:
        """Declare the option."""
        super().initialize()
        self.options.declare("deformer", recordable=False, desc="what deforms the mesh")

    def setup(self) -> None:
        """Declare the variable."""
        deformer = self.options["deformer"]
        surface = deformer.mesh.points[deformer.nodes].ravel()
        self.add_output(MESH_SURFACE, surface, tags=["mphys_coordinates"])


class MeshDeformationBuilder(Builder):  # type: ignore[misc]
    """Builder of MPhys for `MeshDeformation`, alone or before a flow solver.

    Parameters
    ----------
    deformer : Deformer
        Deforms the mesh. Scenarios may share it.
    solver : mphys.Builder, optional
        The builder of the flow solver, which takes ``aero_vol_coords``; its subsystems follow the
        deformation.
    in_coupling : bool
        Whether to deform the mesh in the coupling group, as needed for a structure that deflects;
        else once before it. Without a solver it is always in the coupling group.
    quality, margin, p
        As the options of `MeshDeformation`.
    """

    def __init__(
        self,
        deformer: Deformer,
        solver: Builder | None = None,
        *,
        in_coupling: bool = False,
        quality: bool = False,
        margin: bool = False,
        p: float = 50.0,
    ) -> None:
        super().__init__()
        self.deformer = deformer
        self.solver = solver
        self.in_coupling = in_coupling or solver is None
        self._options = {"deformer": deformer, "quality": quality, "margin": margin, "p": p}

    def initialize(self, comm: Any) -> None:
        """Prepare the solver; the deformer is ready."""
        if self.solver is not None:
            self.solver.initialize(comm)

    def get_mesh_coordinate_subsystem(self, scenario_name: str | None = None) -> om.IndepVarComp:
        """Return the component with the undeformed surface, ``x_aero0_mesh``."""
        del scenario_name
        return MeshSurface(deformer=self.deformer)

    def get_pre_coupling_subsystem(self, scenario_name: str | None = None) -> om.Group | None:
        """Return the group before the coupling group: deformation and solver's part; or None."""
        solver = self.solver and self.solver.get_pre_coupling_subsystem(scenario_name)
        return self._group(not self.in_coupling, solver)

    def get_coupling_group_subsystem(self, scenario_name: str | None = None) -> om.Group | None:
        """Return the coupling group: deformation and solver's part; or None."""
        solver = self.solver and self.solver.get_coupling_group_subsystem(scenario_name)
        return self._group(self.in_coupling, solver)

    def get_post_coupling_subsystem(self, scenario_name: str | None = None) -> Any:
        """Return the subsystem that the solver has after the coupling group, or None."""
        solver = self.solver
        return None if solver is None else solver.get_post_coupling_subsystem(scenario_name)

    def get_number_of_nodes(self) -> int:
        """Return the number of moving nodes."""
        return len(self.deformer.nodes)

    def get_ndof(self) -> int:
        """Return the dimension of the mesh; transfer schemes of MPhys require 3."""
        return int(self.deformer.mesh.dim)

    def get_tagged_indices(self, tags: Sequence[str]) -> IntArray:
        """Return the places (k,) in ``deformer.nodes`` of those on boundaries with these names.

        Raises MeshError if the mesh has no such boundary.
        """
        mesh = self.deformer.mesh
        found = np.zeros(len(self.deformer.nodes), bool)
        for tag in tags:
            found |= np.isin(self.deformer.nodes, mesh.marker(tag).nodes)
        return np.flatnonzero(found)

    def _group(self, deforms: bool, solver: Any) -> om.Group | None:
        """Return a group with the deformation, if it ``deforms``, and a solver's part, or None."""
        if not deforms and solver is None:
            return None
        group = MPhysGroup()
        if deforms:
            group.mphys_add_subsystem("mesh_deformation", MeshDeformation(**self._options))
        if solver is not None:
            group.mphys_add_subsystem("solver", solver)
        return group
