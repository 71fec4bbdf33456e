"""The middle of the window: 3D views, handles, flat sections, the player."""
