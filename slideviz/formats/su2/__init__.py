"""SU2's text form: reading and writing."""

ROWS, TEXT, KEYWORD = 0, 1, 2
"""Kinds of runs of lines (see `lines.Lines`) by their first line: a row or a blank line, text, text
with ``=``."""
