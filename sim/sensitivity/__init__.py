"""Exact derivatives of shapes by the implicit function theorem."""
