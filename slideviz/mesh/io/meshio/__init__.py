"""Formats that meshio knows."""
