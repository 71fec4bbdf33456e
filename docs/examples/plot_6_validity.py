"""
When is a cell inverted?
========================

Push one corner of a square cell across the cell, and plot its size, skew, quality and validity.
"""

import matplotlib.pyplot as plt
import numpy as np

import slideviz as sv

QUADRILATERAL = 9
"""Its number in SU2 and VTK."""


def cell(corner):
    """Return a mesh of one quadrilateral whose last corner but one is at (corner, corner)."""
    points = [[0, 0], [1, 0], [corner, corner], [0, 1]]
    return sv.Mesh(points, sv.Cells.from_types([QUADRILATERAL], [0, 1, 2, 3]))


# %%
# With the corner at 1, the cell is the undeformed square. At 0.5 three corners lie on one line, and
# the Jacobian at the middle one is 0. Below 0.5, the cell is folded, and its quality is 0, whatever
# the formulas would give.

corners = np.linspace(0.3, 1.8, 151)
measured = [sv.quality(cell(corner), reference=cell(1.0)) for corner in corners]
inverted = np.array([quality.inverted for quality in measured], bool)
print(f"inverted up to {corners[inverted].max():.2f}")

figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
axes.axvspan(0.3, 0.5, color="C3", alpha=0.2, label="inverted")
axes.plot(corners, [quality.size[0] for quality in measured], label="size")
axes.plot(corners, [quality.skew[0] for quality in measured], label="skew")
axes.plot(corners, [quality.values[0] for quality in measured], "k", label="quality = √size · skew")
axes.set(xlabel="position of the corner", ylabel="0 to 1", xlim=(0.3, 1.8), ylim=(0, 1.02))
axes.legend(loc="lower right")
plt.show()
