"""Motions before they are computed: ghosts, what these hit, and their words."""
