"""Mesh files: SU2 text, formats of meshio, VTU; writing whole or not at all."""
