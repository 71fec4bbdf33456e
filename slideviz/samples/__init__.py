"""Sample cases: mesh generators, and the table of the samples."""
