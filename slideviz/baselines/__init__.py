"""Methods to compare with: inverse distance weighting and linear elasticity."""
