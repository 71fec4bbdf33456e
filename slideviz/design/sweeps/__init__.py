"""A deformation for each row of a table of designs."""
