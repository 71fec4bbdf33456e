"""
What sliding does
=================

The block of the thesis is rotated by 60 degrees and moved to a corner of its square. Its outer
boundaries are held, or slide, or its periodic sides move along as well.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
from matplotlib.collections import PolyCollection

import slideviz as sv

QUADRILATERAL = 9
"""Its number in SU2 and VTK."""

folder = Path(mkdtemp())
sample = ["sample", "square", "-o", str(folder)]
subprocess.run([sys.executable, "-m", "slideviz", *sample], check=True, stdout=subprocess.DEVNULL)
mesh, case = sv.read(folder / "mesh.su2"), sv.Case.read(folder / "square.cfg")

# %%
# A case is a value: ``change`` returns another one. Compare three methods with 20 steps each, as in
# thesis section 5.1.1.

methods = {
    "all held": case.change(sliding="none", periodic="none", steps=20),
    "pseudo sliding": case.change(sliding="ps", periodic="none", steps=20),
    "and periodic sides move": case.change(sliding="ps", periodic="moving", steps=20),
}
figure, all_axes = plt.subplots(1, 3, figsize=(10, 4.2), layout="constrained")
for axes, (name, changed) in zip(all_axes, methods.items(), strict=True):
    *_, last = sv.deform(changed, mesh)
    quality = sv.quality(last.mesh, reference=mesh)
    print(f"{name}: minimum {quality.min:.6f}, mean {quality.mean:.6f}")
    ids, nodes = last.mesh.cells.by_type[QUADRILATERAL]
    cells = PolyCollection(last.mesh.points[nodes], array=quality.values[ids], ec="k", lw=0.2)
    cells.set_clim(0, 1)
    axes.add_collection(cells)
    axes.set(title=f"{name}\nminimum {quality.min:.3f}", aspect="equal", xticks=[], yticks=[])
    axes.autoscale_view()
figure.colorbar(cells, ax=all_axes, label="size-skew quality", shrink=0.75)
plt.show()
