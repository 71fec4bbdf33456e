"""Drawings with matplotlib: curves, histograms, sections laid flat."""
