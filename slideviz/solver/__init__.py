"""The solver: from a case and a mesh to arrays, steps, and checks of the result."""
