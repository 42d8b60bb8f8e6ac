"""Rods, magnets and their equilibria.

Names are loaded when first used, so that a command pays only for what it needs.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .batch import solve_many
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
    from .magnet_fit import MagnetFit, ReadingVerdict, fit_magnet
    from .sensitivity import Sensitivities, sensitivities
    from .table1 import gmc

# Now, not when first used: importing the submodule `solve` for itself would leave
# the module, not the function, under this name.
from .solve import solve as solve

_HOME = {
    "PULLED_IN": "fields",
    "STABLE": "fields",
    "UNSTABLE": "fields",
    "Field": "fields",
    "MagnetField": "fields",
    "MagnetFit": "magnet_fit",
    "ReadingVerdict": "magnet_fit",
    "Sensitivities": "sensitivity",
    "Solution": "fields",
    "Support": "fields",
    "UniformField": "fields",
    "fit_magnet": "magnet_fit",
    "gmc": "table1",
    "magnet_flux_mT": "magnet_field",
    "magnet_gradient_mT_per_mm": "magnet_field",
    "sensitivities": "sensitivity",
    "solve_many": "batch",
}

__all__ = [
    "PULLED_IN",
    "STABLE",
    "UNSTABLE",
    "Field",
    "MagnetField",
    "MagnetFit",
    "ReadingVerdict",
    "Sensitivities",
    "Solution",
    "Support",
    "UniformField",
    "fit_magnet",
    "gmc",
    "magnet_flux_mT",
    "magnet_gradient_mT_per_mm",
    "sensitivities",
    "solve",
    "solve_many",
]


def __getattr__(name: str) -> object:
    """Load a public name from the module that holds it."""
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted(__all__)
