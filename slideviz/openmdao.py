"""`MeshDeformation` and `MeshDeformationBuilder`: components of OpenMDAO and MPhys."""

from slideviz.adapters.openmdao import MeshDeformation, MeshDeformationBuilder

__all__ = ["MeshDeformation", "MeshDeformationBuilder"]
