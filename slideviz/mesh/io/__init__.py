"""Mesh files: SU2, VTU and the formats of meshio; atomic writing and checks of files."""
