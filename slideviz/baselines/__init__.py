"""Methods to compare with: inverse distance weighting."""
