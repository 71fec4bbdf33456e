"""IDWarp's names for a deformation, for programs that call ``idwarp.USMesh`` (ADflow, DAFoam).

The methods take and return what IDWarp's do (mdolab/idwarp, ``UnstructuredMesh.py``), so that such
a program needs another import and other options. What deforms the mesh is a `slideviz.Deformer`:
sliding, periodic and data-reduced as its case says, with exact derivatives. One process only.
"""

from slideviz.idwarp.usmesh import USMesh

__all__ = ["USMesh"]
