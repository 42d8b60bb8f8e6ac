"""Sub-pixel edges: walls, tip, clamp."""
