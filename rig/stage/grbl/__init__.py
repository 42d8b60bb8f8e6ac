"""Stages that speak GRBL, and its relatives."""
