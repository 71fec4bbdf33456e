"""Designs: many deformations of one mesh, for an optimiser or a table of them."""
