"""Mesh files: SU2 text and binary, CGNS, VTU and the other formats of meshio, VTKHDF."""
