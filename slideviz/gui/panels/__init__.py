"""The docks of the window, one subject each."""
