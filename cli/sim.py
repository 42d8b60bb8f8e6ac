"""``magbend sim``."""

from __future__ import annotations

from .console import group

app = group(
    "sim",
    "Predict shapes: rods, magnets, equilibria, sweeps.",
    "magbend sim shape --gmc 2 --field-mT 50 --angle-deg 90",
)
