"""``magbend analysis``."""

from __future__ import annotations

from . import (
    analysis_fit,
    analysis_import,
    analysis_lumen,
    analysis_model,
    analysis_out,
    analysis_ring,
    analysis_runs,
    recipe,
)
from .console import group

app = group(
    "analysis",
    "Compare, fit, report, train, search and design.",
    "magbend analysis report runs/gmc2",
)

analysis_runs.register(app)
analysis_fit.register(app)
analysis_ring.register(app)
analysis_import.register(app)
app.command("lumen", epilog=analysis_lumen.EXAMPLE)(analysis_lumen.lumen)
analysis_model.register(app)
analysis_out.register(app)
app.add_typer(recipe.app)
