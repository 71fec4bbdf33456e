"""Pictures and films, drawn offscreen through the scene."""
