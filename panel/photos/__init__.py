"""Photographs of the bench's folder, pointed at and drawn upon."""
