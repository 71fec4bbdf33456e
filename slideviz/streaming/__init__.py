"""Meshes larger than memory, deformed and measured from file to file, block by block."""
