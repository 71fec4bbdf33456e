"""
A turbine blade in its passage
==============================

Read a mesh and a case, deform the mesh, measure its quality, draw it with PyVista, and write it.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import mkdtemp

import pyvista as pv

import slideviz as sv

# %%
# The sample ``passage`` is one passage of a linear cascade. The command ``slideviz sample passage
# -o DIR`` writes its mesh and its case; here Python calls it.

folder = Path(mkdtemp())
sample = ["sample", "passage", "-o", str(folder)]
subprocess.run([sys.executable, "-m", "slideviz", *sample], check=True, stdout=subprocess.DEVNULL)

mesh = sv.read(folder / "mesh.su2")
case = sv.Case.read(folder / "passage.cfg")
print(mesh)
print(dict(case.roles))

# %%
# ``sv.deform`` is a generator: it computes a step when the loop asks for one. The loop may stop at
# any time.

for step in sv.deform(case, mesh):
    print(f"step {step.index} of {step.total}: {step.control_nodes} control nodes")
deformed = step.mesh

# %%
# Quality is size-skew, from 0 to 1, relative to the undeformed mesh.

quality = sv.quality(deformed, reference=mesh)
print(f"minimum {quality.min:.3f}, mean {quality.mean:.3f}, {quality.inverted} inverted cells")
print("worst cells:", quality.worst(3))

# %%
# A VTU file also stores values of the cells. PyVista and ParaView read it.

sv.write(folder / "deformed.vtu", deformed, cell_data={"quality": quality.values}, base=mesh)
plotter = pv.Plotter(window_size=(900, 560))
plotter.add_mesh(pv.read(folder / "deformed.vtu"), scalars="quality", clim=(0, 1), show_edges=True)
plotter.view_xy()
plotter.camera.zoom(1.4)
plotter.show()

# %%
# Write the same mesh for SU2, with everything else that the input file had:

sv.write(folder / "deformed.su2", deformed)
