"""``magbend vision``."""

from __future__ import annotations

from .console import group

app = group(
    "vision",
    "Photographs to calibrated centrelines in mm.",
    "magbend vision extract photo.png --calibration calibration.json --out measured",
)
