"""The panels in the docks of the window, one subject each."""
