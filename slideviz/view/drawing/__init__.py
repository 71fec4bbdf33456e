"""How cells, points and words become actors of a plotter, and what the mouse hits there."""
