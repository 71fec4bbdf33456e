"""What is seen, without Qt: state, scenes, pictures."""
