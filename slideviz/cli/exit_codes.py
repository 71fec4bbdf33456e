"""The exit codes of the command line; another one, 143 for SIGTERM, is in `slideviz.__main__`."""

DONE = 0
WRONG_INPUT = 1
"""The mesh or the case is wrong."""
WRONG_USAGE = 2
"""The arguments are wrong; argparse itself exits with this code."""
INVERTED = 3
"""Done, but cells are inverted."""
CANCELLED = 130
