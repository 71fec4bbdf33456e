"""SU2's binary form: reading, in blocks too, and writing."""
