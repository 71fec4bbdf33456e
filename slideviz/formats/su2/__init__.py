"""SU2's text form: reading and writing."""

ROWS = 0
TEXT = 1
KEYWORD = 2
"""Kinds of runs of lines (see `lines.Lines`) by their first line: a row or a blank line, text, text
with ``=``."""
