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
from .magnet_field import magnet_flux_mT, magnet_gradient_mT_per_mm
from .solve import solve
from .table1 import gmc

__all__ = [
    "PULLED_IN",
    "STABLE",
    "UNSTABLE",
    "Field",
    "MagnetField",
    "Solution",
    "Support",
    "UniformField",
    "gmc",
    "magnet_flux_mT",
    "magnet_gradient_mT_per_mm",
    "solve",
]
