"""
Hold a tip gap
==============

A body moves along a casing, with a gap of two per cent between them. Python makes the mesh, without
a file.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection

import slideviz as sv

LINE, QUADRILATERAL = 3, 9
"""Their numbers in SU2 and VTK."""

# %%
# The mesh is a channel, seen from the side. A body stands on its floor, and four layers of cells
# fill the gap between the tip of the body and the casing. Make a grid of 40 by 24 cells, and leave
# out the cells of the body.

across = np.linspace(0, 2, 41)
up = np.r_[np.linspace(0, 0.98, 21), np.linspace(0.985, 1, 4)]
points = np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2)
number = np.arange(len(points)).reshape(len(up), len(across))
body = np.zeros((len(up) - 1, len(across) - 1), bool)
body[:20, 17:23] = True
corners = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
cells = corners[~body]
used, cells = np.unique(cells, return_inverse=True)


def marker(name, *lines):
    """Return a boundary of lines of nodes, given by their numbers in the grid."""
    pairs = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
    return sv.Marker(name, sv.Cells.from_blocks([(LINE, np.searchsorted(used, pairs))]))


mesh = sv.Mesh(
    points[used],
    sv.Cells.from_blocks([(QUADRILATERAL, cells.reshape(-1, 4))]),
    (
        marker("casing", number[-1]),
        marker("floor", number[0, :18], number[0, 23:]),
        marker("ends", number[:, 0], number[:, -1]),
        marker("body", number[:21, 17], number[20, 17:24], number[:21, 23]),
    ),
)
print(mesh)

# %%
# The body moves by 0.3, fifteen times the height of the gap. If the casing is held, the cells of
# the gap are sheared. If it slides, they follow the body, and the gap keeps its height.

case = sv.Case(
    roles={"body": "moving", "casing": "sliding", "floor": "sliding"},
    motions=(sv.Translate("body", (0.3, 0.0)),),
    sliding="ps",
    steps=5,
)
held = case.change(roles={"body": "moving", "floor": "sliding"})
figure, all_axes = plt.subplots(2, 1, figsize=(7, 4.6), layout="constrained")
for axes, (name, asked) in zip(all_axes, {"held": held, "sliding": case}.items(), strict=True):
    *_, last = sv.deform(asked, mesh)
    quality = sv.quality(last.mesh, reference=mesh)
    print(f"casing {name}: minimum quality {quality.min:.3f}, {quality.inverted} inverted cells")
    ids, nodes = last.mesh.cells.by_type[QUADRILATERAL]
    drawn = PolyCollection(last.mesh.points[nodes], array=quality.values[ids], ec="k", lw=0.3)
    drawn.set_clim(0, 1)
    axes.add_collection(drawn)
    axes.set(title=f"casing {name}", xlim=(0.9, 1.7), ylim=(0.9, 1.0), yticks=(0.9, 0.98, 1))
figure.colorbar(drawn, ax=all_axes, label="size-skew quality")
plt.show()
