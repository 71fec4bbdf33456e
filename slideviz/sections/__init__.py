"""Sections of meshes as arrays: shapes, cuts, and how they are laid flat."""
