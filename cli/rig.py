"""``magbend rig``."""

from __future__ import annotations

from . import rig_ask, rig_export, rig_flux, rig_gap, rig_run, rig_snapshot, rig_stage
from .console import group

app = group(
    "rig",
    "Drive the bench: stage, camera, Tesla-meter, runs.",
    "magbend rig run plan.toml --out runs/gmc2",
)
rig_stage.register(app)
rig_gap.register(app)
rig_ask.register(app)
rig_run.register(app)
rig_flux.register(app)
rig_export.register(app)
rig_snapshot.register(app)
