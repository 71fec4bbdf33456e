"""The exit codes of the command line; SIGTERM adds 143 (`slideviz.__main__`)."""

DONE = 0
WRONG_INPUT = 1
"""The mesh or the case is wrong."""
WRONG_USAGE = 2
"""Said by argparse itself."""
INVERTED = 3
"""Done, but cells are inverted."""
CANCELLED = 130
