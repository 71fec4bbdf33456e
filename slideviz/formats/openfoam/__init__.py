"""OpenFOAM's meshes (``polyMesh``): reading, and writing back with other points."""
