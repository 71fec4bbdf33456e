"""A step with everything discrete kept, and its derivatives on a tape."""
