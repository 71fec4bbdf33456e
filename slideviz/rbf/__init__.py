"""Interpolation with radial basis functions: arrays in, arrays out."""
