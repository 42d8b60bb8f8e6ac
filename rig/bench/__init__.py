"""The bench of a rig file, opened."""
