"""The one way to draw cells with VTK, for the window, the command line and films."""
