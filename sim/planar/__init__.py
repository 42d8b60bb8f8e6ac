"""Rods in the plane: marched from the tip, solved, followed from no load."""
