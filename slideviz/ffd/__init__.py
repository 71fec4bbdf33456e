"""Free-form deformation: boxes of control points that move the surface points inside."""
