"""Rods that are followed while a gap, a pose, an angle or a flux goes and returns."""
