"""Moduli from runs, and how sure they are."""
