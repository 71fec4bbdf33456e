"""
Choose a tolerance
==================

See how many control nodes a tolerance needs, and how it changes the quality of a stator passage of
about 5,000 hexahedra.
"""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

import slideviz as sv

folder = Path(mkdtemp())
sample = ["sample", "stator", "--size", "5000", "-o", str(folder)]
subprocess.run([sys.executable, "-m", "slideviz", *sample], check=True, stdout=subprocess.DEVNULL)
mesh, case = sv.read(folder / "mesh.su2"), sv.Case.read(folder / "stator.cfg")
case = case.change(steps=1)

# %%
# ``DATA_RED_RELATIVE`` is the tolerance as a part of the largest extent of the mesh.

results = []
for relative in (1e-3, 3e-4, 1e-4, 3e-5, 1e-5):
    changed = case.change(reduction=replace(case.reduction, relative=relative))
    *_, last = sv.deform(changed, mesh)
    quality = sv.quality(last.mesh, reference=mesh)
    results.append((relative, last.control_nodes, quality.min))
    print(f"{relative:.0e}: {last.control_nodes} control nodes, minimum {quality.min:.4f}")

# %%
# Control nodes cost memory and time. The minimum quality converges long before the selection has
# taken all nodes. Choose the largest tolerance below which the quality no longer changes.

tolerances, nodes, lowest = zip(*results, strict=True)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
left.loglog(tolerances, nodes, "o-")
left.set(xlabel="tolerance / extent", ylabel="control nodes")
right.semilogx(tolerances, lowest, "o-")
right.set(xlabel="tolerance / extent", ylabel="minimum quality", ylim=(0, 1))
plt.show()
