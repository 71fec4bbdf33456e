"""Runs that keep every bit from one release to the next, where the libraries are the same."""
