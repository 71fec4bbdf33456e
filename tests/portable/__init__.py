"""``SLIDEVIZ_TESTS=portable``: tests under the rules of Windows, on the system that there is."""
