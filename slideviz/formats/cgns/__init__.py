"""CGNS files: reading, and writing as a changed copy."""
