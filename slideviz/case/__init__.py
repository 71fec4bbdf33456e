"""The case: roles, motions and settings; case files and displacement files."""
