"""What is asked: case files, roles, motions and displacement files."""
