"""What the window shows, as frozen values, and the functions that change it; no Qt, no VTK."""
