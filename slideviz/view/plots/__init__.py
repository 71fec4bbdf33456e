"""Curves and histograms, and what they are made of."""
