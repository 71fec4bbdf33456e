"""`USMesh`: the mesh deformation by the names of IDWarp, for ADflow and DAFoam."""

from slideviz.adapters.idwarp import USMesh

__all__ = ["USMesh"]
