"""UGRID, the binary format of AFLR3, FUN3D and others."""
