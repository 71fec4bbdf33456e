"""SU2's text form: reading and writing."""
