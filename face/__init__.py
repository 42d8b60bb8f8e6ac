"""Bend magnetic soft continuum rods on a bench, and say how far theory is from it.

The parts are `magbend.sim`, `magbend.vision`, `magbend.rig` and `magbend.analysis`;
each is loaded when first used.
"""

from __future__ import annotations

import lazy_loader

PARTS = ("analysis", "core", "rig", "sim", "vision")

_load, _names, _ = lazy_loader.attach(__name__, submodules=PARTS)

__all__ = ["__version__", *PARTS]


def __getattr__(name: str) -> object:
    """Load a part, or say the version."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    return _load(name)


def __dir__() -> list[str]:
    return sorted(__all__)
