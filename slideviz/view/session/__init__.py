"""What is open, computed and shown, as frozen values, and what changes it."""
