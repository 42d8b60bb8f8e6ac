"""Curves and their fit: splines, likelihood, joints."""
