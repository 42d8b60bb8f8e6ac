"""Descriptors of shapes, and which shapes can be."""
