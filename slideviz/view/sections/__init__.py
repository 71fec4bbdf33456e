"""Cuts through a mesh: planes and cylinders, in space and laid flat."""
