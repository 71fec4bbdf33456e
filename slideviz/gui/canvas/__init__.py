"""The 3D view and the flat ones beside it, with the handles in them."""
