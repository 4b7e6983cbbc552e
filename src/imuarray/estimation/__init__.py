"""Maximum likelihood: motion given positions, and positions with the motion."""
