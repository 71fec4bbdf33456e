"""The parts of a scene: each draws one thing and keeps it up to date."""
