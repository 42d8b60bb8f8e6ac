"""Runs with their tables, figures and description in one file, for a supplement."""
