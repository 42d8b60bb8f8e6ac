"""``magbend rig``."""

from __future__ import annotations

from .console import group

app = group(
    "rig",
    "Drive the bench: stage, camera, Tesla-meter, runs.",
    "magbend rig run plan.toml --out runs/gmc2",
)
