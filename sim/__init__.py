"""Rods, magnets and their equilibria."""

from __future__ import annotations

from .fields import (
    PULLED_IN,
    STABLE,
    UNSTABLE,
    Field,
    MagnetField,
    Solution,
    Support,
    UniformField,
)

__all__ = [
    "PULLED_IN",
    "STABLE",
    "UNSTABLE",
    "Field",
    "MagnetField",
    "Solution",
    "Support",
    "UniformField",
]
