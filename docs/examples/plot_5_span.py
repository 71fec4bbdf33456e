"""
Quality along the span
======================

Where along the span of a stator are the worst cells, and with which method? Measure the quality of
each cell, and sort the cells by radius.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

import slideviz as sv

HEXAHEDRON = 12
"""Its number in SU2 and VTK."""

folder = Path(mkdtemp())
sample = ["sample", "stator", "--size", "5000", "-o", str(folder)]
subprocess.run([sys.executable, "-m", "slideviz", *sample], check=True, stdout=subprocess.DEVNULL)
mesh, case = sv.read(folder / "mesh.su2"), sv.Case.read(folder / "stator.cfg")

# %%
# The stator's axis is z, so the radius of a cell is that of its centre in x and y. The passage has
# eight layers of cells from hub to shroud, all of the same size.

ids, nodes = mesh.cells.by_type[HEXAHEDRON]
middle = mesh.points[nodes].mean(axis=1)
radius = np.hypot(middle[:, 0], middle[:, 1])
layers = np.array_split(np.argsort(radius), 8)

figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
for name, changed in {
    "radial basis functions": case,
    "linear elasticity": case.change(method="elastic"),
}.items():
    *_, last = sv.deform(changed, mesh)
    values = sv.quality(last.mesh, reference=mesh).values[ids]
    lowest = [values[layer].min() for layer in layers]
    print(f"{name}: lowest {min(lowest):.3f}")
    axes.plot(lowest, [radius[layer].mean() for layer in layers], "o-", label=name)
axes.set(xlabel="lowest quality", ylabel="radius", xlim=(0, 1))
axes.legend()
plt.show()
