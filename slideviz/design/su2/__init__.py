"""SU2's own files in a design loop: configuration, surfaces, sensitivities, gradients."""
