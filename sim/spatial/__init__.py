"""Rods in space: marched, solved, counted."""
