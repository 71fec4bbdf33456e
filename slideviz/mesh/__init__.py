"""What is given: meshes, their files, topology and quality."""
