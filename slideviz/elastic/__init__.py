"""The mesh as an elastic body: linear elasticity, and the relaxation of deformed meshes."""
