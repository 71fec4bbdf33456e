"""Samples: generated meshes, each with a case that deforms it, and their table ``SAMPLES``."""
