"""Turbomachines: passages, wheels, blades: arrays in, arrays out."""
