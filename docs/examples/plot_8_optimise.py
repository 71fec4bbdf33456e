"""
Widen a throat, keep the mesh
=============================

Turn and bend the blade of a cascade until its throat is as wide as it can be, while the quality of
the mesh stays above 0.5: nine design variables, exact gradients, by SciPy's SLSQP and by OpenMDAO.
"""

import subprocess
import sys
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import openmdao.api as om
from matplotlib.collections import PolyCollection
from scipy.optimize import minimize
from scipy.stats import binom

import slideviz as sv
from slideviz.openmdao import MeshDeformation

QUADRILATERAL = 9
"""Its number in SU2 and VTK."""

folder = Path(mkdtemp())
sample = ["sample", "passage", "--size", "12", "-o", str(folder)]
subprocess.run([sys.executable, "-m", "slideviz", *sample], check=True, stdout=subprocess.DEVNULL)
mesh, case = sv.read(folder / "mesh.su2"), sv.Case.read(folder / "passage.cfg")

# %%
# The deformation is prepared once. All discrete choices are made here and kept, so that the mesh is
# a smooth function of the blade, and its derivatives are exact.

deformer = sv.Deformer(mesh, case.change(steps=1))
blade = mesh.points[deformer.nodes]
pitch = np.array([0.0, np.ptp(mesh.points[mesh.marker("inflow").nodes, 1])])
print(f"{len(mesh.cells)} cells, {len(blade)} nodes on the blade")

# %%
# **The design.** The first variable rotates the blade about its centre, in degrees. The others move
# the 4 x 2 control points of a box around it in y: free-form deformation with Bernstein
# polynomials, whose values are those of binomial distributions.

low, high = blade.min(axis=0) - 0.02, blade.max(axis=0) + 0.02
u, v = ((blade - low) / (high - low)).T
box = [binom.pmf(i, 3, u) * binom.pmf(j, 1, v) for i in range(4) for j in range(2)]
middle = blade.mean(axis=0)
bounds = [(-30.0, 30.0)] + 8 * [(-0.15, 0.15)]
start = np.zeros(9)


def shape(design):
    """Return the blade (m, 2), and its derivative (m, 2, 9)."""
    design = np.asarray(design)
    angle = np.radians(design[0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    bent = blade - middle
    bent[:, 1] += design[1:] @ box
    derivative = np.empty((*blade.shape, len(design)))
    derivative[:, :, 0] = np.radians(bent @ turn.T[:, ::-1] * (-1, 1))
    derivative[:, :, 1:] = turn[:, 1, None] * np.transpose(box)[:, None]
    return middle + bent @ turn.T, derivative


# %%
# **The throat** is the smallest distance between two neighbouring blades: here a smooth minimum
# over all pairs of nodes, ``(Σ distance^-60)^(-1/60)``.


def throat(surface):
    """Return the width of the throat, and its derivative (m, 2)."""
    across = surface[:, None] - surface - pitch
    distance = np.linalg.norm(across, axis=2)
    width = distance.min() * ((distance.min() / distance) ** 60).sum() ** (-1 / 60)
    pull = ((width / distance) ** 61 / distance)[:, :, None] * across
    return width, pull.sum(axis=1) - pull.sum(axis=0)


# %%
# **The mesh.** ``sv.quality`` returns the derivative of a smooth minimum by all points. The
# deformer's ``vjp`` turns it into a derivative by the blade, and the shape's derivative into one by
# the design.

calls = dict.fromkeys(("meshes", "gradients of the mesh"), 0)


@lru_cache(maxsize=1)
def measured(design):
    """Return the mesh of a design and its quality; the last one is kept."""
    calls["meshes"] += 1
    moved = mesh.with_points(deformer.deform(shape(design)[0] - blade))
    return moved, sv.quality(moved, reference=mesh, derivative=True)


def least_quality(design):
    """Return what must not become negative."""
    return measured(tuple(design))[1].derivative.minimum - 0.5


def slope_of_least_quality(design):
    """Return its derivative (9,)."""
    calls["gradients of the mesh"] += 1
    surface, by_design = shape(design)
    by_points = measured(tuple(design))[1].derivative.of_minimum
    by_blade = deformer.vjp(surface - blade, by_points)
    return np.einsum("mi,mij->j", by_blade, by_design)


def narrowness(design):
    """Return what is to be small."""
    return -throat(shape(design)[0])[0]


def slope_of_narrowness(design):
    """Return its derivative (9,)."""
    surface, by_design = shape(design)
    return -np.einsum("mi,mij->j", throat(surface)[1], by_design)


# %%
# SLSQP with these gradients, and with finite differences in their place. With exact gradients each
# iteration costs a mesh and one product with the transposed Jacobian, however many design
# variables there are; with differences a mesh for each of them.

results = {}
for name, exact in {"exact gradients": True, "finite differences": False}.items():
    calls.update(dict.fromkeys(calls, 0))
    measured.cache_clear()
    constraint = {"type": "ineq", "fun": least_quality}
    results[name] = minimize(
        narrowness,
        start,
        jac=slope_of_narrowness if exact else None,
        constraints=constraint | ({"jac": slope_of_least_quality} if exact else {}),
        bounds=bounds,
        method="SLSQP",
    )
    counted = ", ".join(f"{count} {what}" for what, count in calls.items())
    print(f"{name}: throat {-results[name].fun:.4f}, {results[name].nit} iterations, {counted}")
best = results["exact gradients"].x
print("bounds reached:", int(np.isclose(np.abs(best), np.max(bounds, axis=1)).sum()))

# %%
# The throat is nearly a third wider, and the worst cell is where it may be: at 0.5, a little above
# it in truth, as the smooth minimum is never above the minimum.

figure, all_axes = plt.subplots(
    1, 2, figsize=(9, 4.2), sharex=True, sharey=True, layout="constrained"
)
for axes, design in zip(all_axes, (start, best), strict=True):
    moved, quality = measured(tuple(design))
    ids, nodes = mesh.cells.by_type[QUADRILATERAL]
    for shift in (0, pitch):
        corners = moved.points[nodes] + shift
        cells = PolyCollection(corners, array=quality.values[ids], ec="k", lw=0.2)
        cells.set_clim(0, 1)
        axes.add_collection(cells)
    title = f"throat {-narrowness(design):.3f}, minimum quality {quality.min:.3f}"
    axes.set(title=title, aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()
figure.colorbar(cells, ax=all_axes, label="size-skew quality", shrink=0.75)
plt.show()

# %%
# **The same in OpenMDAO.** The mesh is a component of slideviz, with its quality as an output and
# exact derivatives; shape and throat are components of one's own, as a flow solver would be.


class Shape(om.ExplicitComponent):
    """The blade by its design."""

    def setup(self):
        """Declare the variables."""
        self.add_input("design", start)
        self.add_output("x_aero", blade.ravel())
        self.declare_partials("x_aero", "design")

    def compute(self, inputs, outputs):
        """Find the blade."""
        outputs["x_aero"] = shape(inputs["design"])[0].ravel()

    def compute_partials(self, inputs, partials):
        """Find its derivative."""
        partials["x_aero", "design"] = shape(inputs["design"])[1].reshape(blade.size, -1)


class Throat(om.ExplicitComponent):
    """The width of the throat by the blade."""

    def setup(self):
        """Declare the variables."""
        self.add_input("x_aero", blade.ravel())
        self.add_output("width")
        self.declare_partials("width", "x_aero")

    def compute(self, inputs, outputs):
        """Find the width."""
        outputs["width"] = throat(inputs["x_aero"].reshape(blade.shape))[0]

    def compute_partials(self, inputs, partials):
        """Find its derivative."""
        partials["width", "x_aero"] = throat(inputs["x_aero"].reshape(blade.shape))[1].ravel()


problem = om.Problem(reports=False, work_dir=str(folder))
problem.model.add_subsystem("shape", Shape(), promotes=["*"])
problem.model.add_subsystem("throat", Throat(), promotes=["*"])
problem.model.add_subsystem(
    "mesh", MeshDeformation(deformer=deformer, quality=True), promotes=["*"]
)
problem.model.add_design_var("design", *np.transpose(bounds))
problem.model.add_constraint("minimum_quality", lower=0.5)
problem.model.add_objective("width", scaler=-1.0)
problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", disp=False)
problem.setup(mode="rev")
done = problem.run_driver()
width, least = problem.get_val("width")[0], problem.get_val("minimum_quality")[0]
print(f"OpenMDAO: throat {width:.4f}, minimum quality {least:.4f}")
print(f"{done.model_evals} meshes, {done.deriv_evals} gradients")
