"""Meshes: points, cells and boundaries; their files, topology, periodic pairs and quality."""
