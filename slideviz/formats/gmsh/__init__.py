"""The format of Gmsh."""
