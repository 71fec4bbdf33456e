"""Repair: cells that are folded, unproved or too bad are mended by moving nodes near them."""
